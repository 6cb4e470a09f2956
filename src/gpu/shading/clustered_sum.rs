//! Passes over normal clusters: their visible areas, and one lobe each. The twin of `ClusteredSum` in `effective`. The
//! GPU also computes the horizon bounds of each cluster.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::direct::{FacetBuffers, Sum, pieces};
use super::tabulate::{GpuNodes, Preparation, Step, workgroups};
use super::visibility::GpuVisibility;
use super::{GpuShading, PaddedVec3, TintRow, padded, tint_shader};
use crate::effective::{FacetSum, Tint};
use crate::gpu::{Gpu, GpuError};

/// A row of `clusters.wgsl`.
type Row = [u32; 4];

/// Rows of a cluster before those of its azimuths.
const HEAD: usize = 3;

/// `Term` in `clusters.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Term {
    tint: TintRow,
    lobe: u32,
    shape: f32,
    scale: f32,
    pad: u32,
}

/// The normal clusters of a sum, split so that each piece fits in one pass.
pub(crate) struct ClusterPasses {
    /// Facet group, facets and normal of each piece; pieces of groups that reflect come first.
    pieces: Vec<(usize, Range<usize>, Vec3)>,
    reflecting: usize,
}

impl ClusterPasses {
    pub(crate) fn of(sum: &FacetSum, max_facets: usize) -> Self {
        let of_groups = |black: bool| {
            let groups = sum.groups().iter().enumerate().filter(move |(_, group)| (group.color == Vec3::ZERO) == black);
            groups.flat_map(move |(k, group)| {
                let clusters = group.clusters.iter().flatten();
                clusters.flat_map(move |cluster| {
                    pieces(cluster.range.clone(), max_facets).map(move |range| (k, range, cluster.normal))
                })
            })
        };
        let mut pieces: Vec<_> = of_groups(false).collect();
        let reflecting = pieces.len();
        pieces.extend(of_groups(true));
        Self { pieces, reflecting }
    }

    /// Returns ranges of pieces for one pass each: at most `max_facets` facets, or one piece. `all`: whether pieces
    /// that do not reflect are included.
    pub(crate) fn passes(&self, max_facets: usize, all: bool) -> Vec<Range<usize>> {
        let mut passes: Vec<Range<usize>> = Vec::new();
        let mut facet_count = 0;
        for (k, (_, facets, _)) in
            self.pieces[..if all { self.pieces.len() } else { self.reflecting }].iter().enumerate()
        {
            match passes.last_mut() {
                Some(pass) if facet_count + facets.len() <= max_facets => {
                    pass.end = k + 1;
                    facet_count += facets.len();
                }
                _ => {
                    passes.push(k..k + 1);
                    facet_count = facets.len();
                }
            }
        }
        passes
    }

    /// Returns the number of facets of a range of pieces.
    pub(crate) fn facets(&self, clusters: Range<usize>) -> u64 {
        self.pieces[clusters].iter().map(|(_, facets, _)| facets.len() as u64).sum()
    }

    /// Returns the rows of `clusters.wgsl` without horizon bounds, and the shader of its tints.
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
        let row_of = |term: usize| (stride * self.pieces.len() + rows_of_term * term) as u32;
        let mut rows: Vec<Row> = vec![[0; 4]; stride * self.pieces.len()];
        for (head, (group, facets, normal)) in rows.chunks_mut(stride).zip(&self.pieces) {
            let facet_group = &sum.groups()[*group];
            let area = facets.clone().map(|s| f64::from(sum.facet(s).1)).sum::<f64>() as f32;
            let in_group = facets.start - facet_group.range.start..facets.end - facet_group.range.start;
            let total_weight = match &facet_group.rgb_areas {
                Some(rgb) => Vec3::from(
                    rgb.each_ref()
                        .map(|areas| areas[in_group.clone()].iter().map(|&a| f64::from(a)).sum::<f64>() as f32),
                ),
                None => Vec3::splat(area),
            };
            let first = first_of_group[*group];
            let [terms, end] = [first, first + facet_group.lobes.len()].map(row_of);
            let [x, y, z] = normal.to_array().map(f32::to_bits);
            head[0] = [x, y, z, facets.start as u32];
            head[1] = [facets.end as u32, area.to_bits(), terms, end];
            let [r, g, b] = total_weight.to_array().map(f32::to_bits);
            head[2] = [r, g, b, 0];
        }
        let tints = tint_shader(terms.iter().map(|term| &term.tint));
        rows.extend_from_slice(bytemuck::cast_slice(&terms));
        (rows, tints)
    }
}

/// Returns the shader that bounds the visible facets of a cluster, for a kind of visibility.
pub(crate) fn bounds_shader(visibility: &GpuVisibility) -> &'static str {
    match visibility.shader_name() {
        "visibility_unblocked" => "bounds_unblocked",
        "visibility_horizons" => "bounds_horizons",
        _ => "bounds_unknown",
    }
}

impl GpuShading {
    /// Uploads the clusters. Returns their buffer, the shader of their tints, and the dispatch that computes horizon
    /// bounds.
    pub(crate) fn clusters(
        &mut self,
        gpu: &Gpu,
        (sum, visibility, buffers): (&FacetSum, &GpuVisibility, &FacetBuffers),
        clusters: &ClusterPasses,
    ) -> Result<(wgpu::Buffer, &'static str, Option<Preparation>), GpuError> {
        let empty = Sum::empty(sum, visibility);
        let (rows, tints) = clusters.rows(sum, empty.azimuths as usize);
        let buffer = gpu.upload("clusters", &rows, wgpu::BufferUsages::STORAGE)?;
        if bounds_shader(visibility) != "bounds_horizons" || clusters.pieces.is_empty() {
            return Ok((buffer, tints, None));
        }
        let directions = gpu.upload::<PaddedVec3>("directions", &[padded(Vec3::ZERO)], wgpu::BufferUsages::STORAGE)?;
        // A buffer that is written must not be bound a second time.
        let without_clusters = FacetBuffers { clusters: directions.clone(), ..buffers.clone() };
        let threads = clusters.pieces.len() * empty.azimuths as usize;
        let layouts = [self.nodes.clone(), self.facets.clone()];
        let variant =
            super::Variant { shader: "horizon_bounds", entry_point: "find", swaps: Vec::new(), constants: Vec::new() };
        let step = Step {
            pipeline: self.pipeline_over(gpu, variant, &layouts.each_ref())?,
            groups: vec![
                self.nodes_group(gpu, GpuNodes::zeroed(), &directions, &buffer)?,
                self.sum_group(gpu, &without_clusters, empty.over(&(0..clusters.pieces.len())))?,
            ],
            workgroups: workgroups(threads)?,
            lobes: (threads * sum.facet_count() / clusters.pieces.len()) as u64,
        };
        Ok((buffer, tints, Some(Preparation::of(step))))
    }
}
