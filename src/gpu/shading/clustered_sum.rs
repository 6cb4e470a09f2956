//! Passes over runs of facets with one normal: their visible areas, and one lobe each. The twin of `ClusteredSum`
//! (`src/filtering/clustered_sum.rs`): the device finds, too, which elevations are above or below all that a run sees.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::direct::{Shared, Sum, pieces};
use super::tabulate::{Making, Nodes, Step, workgroups};
use super::visibility::GpuVisibility;
use super::{GpuShading, Padded, TintRow, padded, tint_file};
use crate::effective::{FacetSum, Tint};
use crate::gpu::{Gpu, GpuError};

/// A row of `patches.wgsl`.
type Row = [u32; 4];

/// Rows of a patch before those of its azimuths.
const HEAD: usize = 3;

/// `Term` in `patches.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Term {
    tint: TintRow,
    lobe: u32,
    shape: f32,
    scale: f32,
    pad: u32,
}

/// The runs of one normal of a sum, none longer than a pass may take.
pub(crate) struct Patches {
    /// Group, facets and normal of each; of the groups that reflect first.
    runs: Vec<(usize, Range<usize>, Vec3)>,
    lit: usize,
}

impl Patches {
    pub(crate) fn of(sum: &FacetSum, most: usize) -> Self {
        let of_groups = |black: bool| {
            let groups = sum.groups().iter().enumerate().filter(move |(_, group)| (group.color == Vec3::ZERO) == black);
            groups.flat_map(move |(k, group)| {
                let patches = group.patches.iter().flatten();
                patches.flat_map(move |run| pieces(run.range.clone(), most).map(move |range| (k, range, run.normal)))
            })
        };
        let mut runs: Vec<_> = of_groups(false).collect();
        let lit = runs.len();
        runs.extend(of_groups(true));
        Self { runs, lit }
    }

    /// Numbers of patches that hold `most` facets together, or of one patch; of those that reflect, or of all.
    pub(crate) fn passes(&self, most: usize, all: bool) -> Vec<Range<usize>> {
        let mut passes: Vec<Range<usize>> = Vec::new();
        let mut held = 0;
        for (k, (_, facets, _)) in self.runs[..if all { self.runs.len() } else { self.lit }].iter().enumerate() {
            match passes.last_mut() {
                Some(pass) if held + facets.len() <= most => {
                    pass.end = k + 1;
                    held += facets.len();
                }
                _ => {
                    passes.push(k..k + 1);
                    held = facets.len();
                }
            }
        }
        passes
    }

    /// Facets of a run of patches.
    pub(crate) fn facets(&self, patches: Range<usize>) -> u64 {
        self.runs[patches].iter().map(|(_, facets, _)| facets.len() as u64).sum()
    }

    /// What `patches.wgsl` reads, reach yet to be found; and the file of its tints.
    fn rows(&self, sum: &FacetSum, azimuths: usize) -> (Vec<Row>, &'static str) {
        let stride = HEAD + azimuths;
        let mut terms: Vec<Term> = Vec::new();
        let mut first_of_group = vec![0; sum.groups().len()];
        for (group, first) in sum.groups().iter().zip(&mut first_of_group) {
            *first = terms.len();
            terms.extend(group.lobes.iter().map(|(lobe, term)| {
                let [kind, shape, scale] = lobe.numbers();
                let tint = TintRow::of(&Tint::Term(term.clone(), group.color));
                Term { tint, lobe: 1 + kind as u32, shape, scale, pad: 0 }
            }));
        }
        let rows_of_term = size_of::<Term>() / size_of::<Row>();
        let row_of = |term: usize| (stride * self.runs.len() + rows_of_term * term) as u32;
        let mut rows: Vec<Row> = vec![[0; 4]; stride * self.runs.len()];
        for (head, (group, facets, normal)) in rows.chunks_mut(stride).zip(&self.runs) {
            let group_of = &sum.groups()[*group];
            let area = facets.clone().map(|s| f64::from(sum.facet(s).1)).sum::<f64>() as f32;
            let inside = facets.start - group_of.range.start..facets.end - group_of.range.start;
            let whole = match &group_of.rgb_areas {
                Some(rgb) => Vec3::from(
                    rgb.each_ref().map(|areas| areas[inside.clone()].iter().map(|&a| f64::from(a)).sum::<f64>() as f32),
                ),
                None => Vec3::splat(area),
            };
            let first = first_of_group[*group];
            let [terms, end] = [first, first + group_of.lobes.len()].map(row_of);
            let [x, y, z] = normal.to_array().map(f32::to_bits);
            head[0] = [x, y, z, facets.start as u32];
            head[1] = [facets.end as u32, area.to_bits(), terms, end];
            let [r, g, b] = whole.to_array().map(f32::to_bits);
            head[2] = [r, g, b, 0];
        }
        let file = tint_file(terms.iter().map(|term| &term.tint));
        rows.extend_from_slice(bytemuck::cast_slice(&terms));
        (rows, file)
    }
}

/// Files that tell how much of a patch a direction sees, where facets see so.
pub(crate) fn reach_file(seen: &GpuVisibility) -> &'static str {
    match seen.file() {
        "visibility_unblocked" => "reach_unblocked",
        "visibility_horizons" => "reach_horizons",
        _ => "reach_unknown",
    }
}

impl GpuShading {
    /// The patches on the device, the file of their tints, and what the device has to make of them first.
    pub(crate) fn patches(
        &mut self,
        gpu: &Gpu,
        (sum, seen, shared): (&FacetSum, &GpuVisibility, &Shared),
        patches: &Patches,
    ) -> Result<(wgpu::Buffer, &'static str, Option<Making>), GpuError> {
        let blank = Sum::blank(sum, seen);
        let (rows, tints) = patches.rows(sum, blank.azimuths as usize);
        let buffer = gpu.upload("patches", &rows, wgpu::BufferUsages::STORAGE)?;
        if reach_file(seen) != "reach_horizons" || patches.runs.is_empty() {
            return Ok((buffer, tints, None));
        }
        let at = gpu.upload::<Padded>("directions", &[padded(Vec3::ZERO)], wgpu::BufferUsages::STORAGE)?;
        // A buffer that is written is bound once.
        let unbound = Shared { patches: at.clone(), ..shared.clone() };
        let threads = patches.runs.len() * blank.azimuths as usize;
        let layouts = [self.nodes.clone(), self.facets.clone()];
        let variant =
            super::Variant { shader: "find_reach", entry_point: "find", swaps: Vec::new(), constants: Vec::new() };
        let step = Step {
            pipeline: self.pipeline_over(gpu, variant, &layouts.each_ref())?,
            groups: vec![
                self.nodes_group(gpu, Nodes::zeroed(), &at, &buffer)?,
                self.sum_group(gpu, &unbound, blank.over(&(0..patches.runs.len())))?,
            ],
            workgroups: workgroups(threads)?,
            lobes: (threads * sum.facet_count() / patches.runs.len()) as u64,
        };
        Ok((buffer, tints, Some(Making::of(step))))
    }
}
