//! Sums for a table over a subset of facets of each half vector, drawn on the GPU: the twin of
//! `effective/shading_table/sampled_facets.rs`. Here, facets of a normal cluster are sampled like others.

use super::direct::{FacetBuffers, SOFTWARE_FACETS, Sum, pieces};
use super::tabulate::{Step, TableShape, columns_of, workgroups};
use super::visibility::GpuVisibility;
use super::{GpuShading, MAX_GROUPS, Variant};
use crate::effective::shading_table::columns::{Column, ColumnKind};
use crate::effective::{FacetSum, subset_size};
use crate::gpu::{Gpu, GpuError, Tier};
use crate::math::simd::Lobe;

/// Lobes that one sum over a subset evaluates; they share its visibility.
const LOBES_PER_SUM: usize = 2;

/// Walks over all facets that sampling takes.
const SAMPLING_WALKS: u64 = 4;

/// Extra length of a row: its count, and facets beyond the expected number, because rounded probabilities may add up to
/// more.
const EXTRA_LENGTH: usize = 16;

/// `SampledFacet` in `facet_subsets.wgsl`.
type SampledFacet = [u32; 2];

/// The facets of a group that are sampled, and the columns that their sums fill.
pub(crate) struct GroupSampling<'a> {
    pub(crate) sum: &'a FacetSum,
    pub(crate) visibility: &'a GpuVisibility<'a>,
    pub(crate) buffers: &'a FacetBuffers,
    pub(crate) columns: &'a [Column],
    pub(crate) group: usize,
    /// Expected number of sampled facets of all groups together.
    pub(crate) count: usize,
}

impl GroupSampling<'_> {
    /// Returns the expected number of sampled facets of the group.
    fn expected_size(&self) -> f32 {
        let has_column = |group: &usize| self.columns.iter().any(|column| column.group == *group);
        let groups = self.sum.groups();
        let all = (0..groups.len()).filter(has_column).map(|group| groups[group].range.len()).sum();
        subset_size(groups[self.group].range.len(), self.count, all) as f32
    }
}

/// Returns number, shape and scale of a lobe in `lobe_by_number.wgsl`; the number is 1 plus that of [`Lobe::numbers`],
/// and 0 without a lobe.
fn number(lobe: Option<Lobe>) -> [f32; 3] {
    lobe.map_or([0.0; 3], |lobe| {
        let [kind, shape, scale] = lobe.numbers();
        [kind + 1.0, shape, scale]
    })
}

impl GpuShading {
    /// Returns the dispatches that fill the columns of a group's lobes.
    pub(crate) fn sampling_steps(
        &mut self,
        gpu: &Gpu,
        sampling: &GroupSampling,
        shape: TableShape,
        [angles, values]: [&wgpu::Buffer; 2],
    ) -> Result<Vec<Step>, GpuError> {
        let GroupSampling { sum, visibility, buffers, columns, group, .. } = *sampling;
        let half_vectors = shape.grid.half_vectors();
        if half_vectors > MAX_GROUPS {
            return Err(GpuError::Unsupported(format!("a table of {half_vectors} half vectors")));
        }
        let facets = &sum.groups()[group];
        let colored = facets.rgb_areas.is_some();
        let size = sampling.expected_size();
        let row_length = size as usize + EXTRA_LENGTH;
        let bytes = (size_of::<SampledFacet>() * half_vectors * row_length) as u64;
        let subsets = gpu.buffer("facet subsets", bytes, wgpu::BufferUsages::STORAGE)?;
        let from_subsets = FacetBuffers { clusters: subsets.clone(), ..buffers.clone() };
        let layouts = [self.nodes.clone(), self.facets.clone()];
        let originals = shape.grid.originals(shape.mirrors) as u64;
        let original_half_vectors = originals / (shape.grid.phi_d * shape.grid.theta_d).max(1) as u64;
        let max_facets = if gpu.tier == Tier::Software { SOFTWARE_FACETS } else { row_length };
        let mut steps = Vec::new();
        for first in (0..facets.lobes.len()).step_by(LOBES_PER_SUM) {
            let lobes = [first, first + 1].map(|k| number(facets.lobes.get(k).map(|(lobe, _)| *lobe)));
            let constants = vec![("FIRST", f64::from(lobes[0][0])), ("SECOND", f64::from(lobes[1][0]))];
            let column_indices = [first, first + 1].map(|lobe| {
                let of_lobe = Column { group, kind: ColumnKind::Lobe(lobe), channel: None };
                columns_of(columns, &of_lobe)
            });
            let nodes = shape.nodes(&column_indices[0]).with_lobes(&column_indices[1], lobes, size, row_length);

            let variant = Variant {
                shader: "sample_facets",
                entry_point: "draw",
                swaps: Vec::new(),
                constants: constants.clone(),
            };
            let pipeline = self.pipeline_over(gpu, variant, &layouts.each_ref())?;
            let all = Sum::empty(sum, visibility).over(&facets.range);
            steps.push(Step {
                pipeline,
                groups: vec![self.nodes_group(gpu, nodes, angles, &subsets)?, self.sum_group(gpu, buffers, all)?],
                workgroups: [half_vectors as u32, 1],
                lobes: SAMPLING_WALKS * original_half_vectors * facets.range.len() as u64,
            });

            let swaps = vec![
                ("visibility_unblocked", visibility.shader_name()),
                ("weights_area", if colored { "weights_rgb" } else { "weights_area" }),
            ];
            let variant = Variant { shader: "table_of_subsets", entry_point: "add", swaps, constants };
            let pipeline = self.pipeline_over(gpu, variant, &layouts.each_ref())?;
            let nodes = self.nodes_group(gpu, nodes, angles, values)?;
            for range in pieces(0..row_length - 1, max_facets) {
                let part = Sum::empty(sum, visibility).over(&range);
                steps.push(Step {
                    pipeline: pipeline.clone(),
                    groups: vec![nodes.clone(), self.sum_group(gpu, &from_subsets, part)?],
                    workgroups: workgroups(shape.grid.nodes())?,
                    lobes: originals * range.len() as u64,
                });
            }
        }
        Ok(steps)
    }
}
