//! Sums for a table over the facets that shine about each half vector, picked on the device: the twin of `Direct::about`
//! (`src/filtering/sampled.rs`), but that facets which share a normal are picked as others are.

use super::direct::{SOFTWARE_FACETS, Shared, Sum, pieces};
use super::tabulate::{Step, TableShape, columns_of, workgroups};
use super::visibility::GpuVisibility;
use super::{GpuShading, MAX_GROUPS, Variant};
use crate::effective::shading_table::columns::{Column, Part};
use crate::effective::{FacetSum, share_of};
use crate::gpu::{Gpu, GpuError, Tier};
use crate::math::simd::Lobe;

/// Lobes that one walk over picked facets sums, who all see the same.
const AT_ONCE: usize = 2;

/// Walks over all facets that picking takes.
const PICKING: u64 = 4;

/// A row of picks holds its count and, as shares that were rounded may add up to more than was asked for, a few more.
const BESIDES: usize = 16;

/// `Pick` in `table_picks.wgsl`.
type Pick = [u32; 2];

/// Which facets of a group, and what is summed over them.
pub(crate) struct OfGroup<'a> {
    pub(crate) sum: &'a FacetSum,
    pub(crate) seen: &'a GpuVisibility<'a>,
    pub(crate) shared: &'a Shared,
    pub(crate) columns: &'a [Column],
    pub(crate) group: usize,
    /// About how many facets are picked of all groups together.
    pub(crate) count: usize,
}

impl OfGroup<'_> {
    /// About how many facets are picked of the group.
    fn picked(&self) -> f32 {
        let lit = |group: &usize| self.columns.iter().any(|column| column.group == *group);
        let groups = self.sum.groups();
        let all = (0..groups.len()).filter(lit).map(|group| groups[group].range.len()).sum();
        share_of(groups[self.group].range.len(), self.count, all) as f32
    }
}

/// One more than [`Lobe::numbers`] says, as `lobe_by_number.wgsl` has it; 0 for none.
fn number(lobe: Option<Lobe>) -> [f32; 3] {
    lobe.map_or([0.0; 3], |lobe| {
        let [kind, shape, scale] = lobe.numbers();
        [kind + 1.0, shape, scale]
    })
}

impl GpuShading {
    /// What fills the columns of a group's lobes.
    pub(crate) fn picked_steps(
        &mut self,
        gpu: &Gpu,
        of: &OfGroup,
        shape: TableShape,
        [angles, values]: [&wgpu::Buffer; 2],
    ) -> Result<Vec<Step>, GpuError> {
        let OfGroup { sum, seen, shared, columns, group, .. } = *of;
        let half_vectors = shape.grid.half_vectors();
        if half_vectors > MAX_GROUPS {
            return Err(GpuError::Unsupported(format!("a table of {half_vectors} half vectors")));
        }
        let facets = &sum.groups()[group];
        let colored = facets.rgb_areas.is_some();
        let picked = of.picked();
        let room = picked as usize + BESIDES;
        let bytes = (size_of::<Pick>() * half_vectors * room) as u64;
        let picks = gpu.buffer("picks", bytes, wgpu::BufferUsages::STORAGE)?;
        let from_picks = Shared { patches: picks.clone(), ..shared.clone() };
        let layouts = [self.nodes.clone(), self.facets.clone()];
        let originals = shape.grid.originals(shape.mirrors) as u64;
        let of_originals = originals / (shape.grid.turn * shape.grid.difference).max(1) as u64;
        let most = if gpu.tier == Tier::Software { SOFTWARE_FACETS } else { room };
        let mut steps = Vec::new();
        for first in (0..facets.lobes.len()).step_by(AT_ONCE) {
            let lobes = [first, first + 1].map(|k| number(facets.lobes.get(k).map(|(lobe, _)| *lobe)));
            let constants = vec![("FIRST", f64::from(lobes[0][0])), ("SECOND", f64::from(lobes[1][0]))];
            let places = [first, first + 1].map(|lobe| {
                let of_lobe = Column { group, part: Part::Lobe(lobe), channel: None };
                columns_of(columns, &of_lobe)
            });
            let nodes = shape.nodes(&places[0]).with_lobes(&places[1], lobes, picked, room);

            let variant =
                Variant { shader: "pick_facets", entry_point: "pick", swaps: Vec::new(), constants: constants.clone() };
            let pipeline = self.pipeline_over(gpu, variant, &layouts.each_ref())?;
            let all = Sum::blank(sum, seen).over(&facets.range);
            steps.push(Step {
                pipeline,
                groups: vec![self.nodes_group(gpu, nodes, angles, &picks)?, self.sum_group(gpu, shared, all)?],
                workgroups: [half_vectors as u32, 1],
                lobes: PICKING * of_originals * facets.range.len() as u64,
            });

            let swaps = vec![
                ("visibility_unblocked", seen.file()),
                ("weights_area", if colored { "weights_rgb" } else { "weights_area" }),
            ];
            let variant = Variant { shader: "table_of_picks", entry_point: "add", swaps, constants };
            let pipeline = self.pipeline_over(gpu, variant, &layouts.each_ref())?;
            let nodes = self.nodes_group(gpu, nodes, angles, values)?;
            for range in pieces(0..room - 1, most) {
                let some = Sum::blank(sum, seen).over(&range);
                steps.push(Step {
                    pipeline: pipeline.clone(),
                    groups: vec![nodes.clone(), self.sum_group(gpu, &from_picks, some)?],
                    workgroups: workgroups(shape.grid.nodes())?,
                    lobes: originals * range.len() as u64,
                });
            }
        }
        Ok(steps)
    }
}
