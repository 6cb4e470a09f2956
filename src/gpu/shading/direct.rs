//! Passes of a direct sum over facets: projected areas first, then one pass per term of each facet group, or one pass
//! for all terms of normal clusters.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

use super::clustered_sum::{ClusterPasses, bounds_shader};
use super::tabulate::Preparation;
use super::visibility::GpuVisibility;
use super::{GpuShading, PaddedVec3, Pass, SecondGroup, Variant, padded, shadow_swap};
use crate::brdf::Term;
use crate::effective::{FacetGroup, FacetSum};
use crate::gpu::{Gpu, GpuError, Tier};
use crate::math::simd::Lobe;

/// `Sum` in `facets.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct Sum {
    pub(crate) first: u32,
    pub(crate) end: u32,
    pub(crate) azimuths: u32,
    pub(crate) rings: u32,
    pub(crate) nodes: u32,
    pub(crate) sharpness: f32,
    pub(crate) shape: f32,
    pub(crate) scale: f32,
    pub(crate) tint: Vec3,
    pub(crate) facet_count: u32,
    pub(crate) color: Vec3,
    /// Flags of a pass over projected areas: 1 for the first pass, 2 for the last, 3 for both.
    pub(crate) area_pass: u32,
    /// The direction across grooves; 0 for a surface without.
    pub(crate) across: Vec2,
    pub(crate) padding: [u32; 2],
}

/// Largest number of facets of one pass on software Vulkan. llvmpipe silently ends all loops of a thread after a total
/// of 65,535 iterations. A pass with 8 lights and 8 overhangs per facet stays below that limit.
pub(crate) const SOFTWARE_FACETS: usize = 512;

/// Largest number of facets of one pass on a real GPU, where a pass over one row of pixels may be a submission.
const HARDWARE_FACETS: usize = 1024;

/// The buffers that all passes over facets read.
#[derive(Clone)]
pub(crate) struct FacetBuffers {
    pub(crate) facets: wgpu::Buffer,
    pub(crate) visibility: wgpu::Buffer,
    /// Normal clusters, or the subsets of sampled facets.
    pub(crate) clusters: wgpu::Buffer,
}

impl GpuShading {
    /// Returns the passes, and the dispatches that must run before the first of them.
    pub(super) fn direct_passes(
        &mut self,
        gpu: &Gpu,
        sum: &FacetSum,
        visibility: &GpuVisibility,
        shadowed: bool,
    ) -> Result<(Vec<Pass>, Option<Preparation>), GpuError> {
        let groups = sum.groups();
        if groups.iter().any(|group| !group.measured.is_empty() && group.color != Vec3::ZERO) {
            return Err(GpuError::Unsupported(
                "tables of measured BRDFs are summed over facets on the CPU only".to_owned(),
            ));
        }
        let max_facets = if gpu.tier == Tier::Software { SOFTWARE_FACETS } else { HARDWARE_FACETS };
        let (visibility_swap, bounds_swap) =
            (("visibility_unblocked", visibility.shader_name()), ("bounds_unblocked", bounds_shader(visibility)));
        let weights = |vary: bool| ("weights_area", if vary { "weights_rgb" } else { "weights_area" });
        let empty = Sum::empty(sum, visibility);
        let mut buffers = FacetBuffers::of(gpu, sum, visibility)?;
        let clusters = ClusterPasses::of(sum, max_facets);
        let (cluster_buffer, tints, preparation) = self.clusters(gpu, (sum, visibility, &buffers), &clusters)?;
        buffers.clusters = cluster_buffer;
        let of_clusters = |range: Range<usize>| (empty.over(&range), clusters.facets(range));

        let is_unclustered = |group: &&FacetGroup| group.clusters.is_none();
        let facet_sums = groups.iter().filter(is_unclustered).flat_map(|group| pieces(group.range.clone(), max_facets));
        let facet_sums = facet_sums.map(|range| ("sum_areas", empty.over(&range), range.len() as u64));
        let cluster_sums = clusters.passes(max_facets, true).into_iter().map(of_clusters);
        let cluster_sums = cluster_sums.map(|(sum, work)| ("sum_cluster_areas", sum, work));
        let areas: Vec<_> = facet_sums.chain(cluster_sums).collect();
        let mut passes = Vec::new();
        for (k, (shader, sum, work)) in areas.iter().enumerate() {
            let area_pass = u32::from(k == 0) + 2 * u32::from(k + 1 == areas.len());
            let swaps = vec![visibility_swap, bounds_swap, ("sum_areas", *shader)];
            let variant = Variant { shader: "projected_area", entry_point: "measure", swaps, constants: Vec::new() };
            passes.push(Pass {
                pipeline: self.pipeline(gpu, variant, SecondGroup::Facets)?,
                group: self.sum_group(gpu, &buffers, Sum { area_pass, ..*sum })?,
                work: *work,
                each_light: false,
            });
        }

        let mut planned = Vec::new();
        for group in groups.iter().filter(is_unclustered).filter(|group| group.color != Vec3::ZERO) {
            for (lobe, term) in &group.lobes {
                let (lobe_shader, sum) = empty.with_lobe(*lobe);
                let sum = Sum { tint: base_tint(term), color: group.color, ..sum };
                let swaps = vec![
                    shadow_swap(shadowed),
                    visibility_swap,
                    ("lobe_lambertian", lobe_shader),
                    weights(group.rgb_areas.is_some()),
                ];
                let passes =
                    pieces(group.range.clone(), max_facets).map(|range| (sum.over(&range), range.len() as u64));
                planned.extend(passes.map(|(sum, work)| ("shade_direct", swaps.clone(), sum, work)));
            }
        }
        let swaps = vec![
            shadow_swap(shadowed),
            visibility_swap,
            bounds_swap,
            ("tint_fixed", tints),
            weights(sum.colors_vary()),
        ];
        let cluster_sums = clusters.passes(max_facets, false).into_iter().map(of_clusters);
        planned.extend(cluster_sums.map(|(sum, work)| ("shade_clusters", swaps.clone(), sum, work)));
        for (shader, swaps, sum, work) in planned {
            let variant = Variant { shader, entry_point: "shade", swaps, constants: Vec::new() };
            passes.push(Pass {
                pipeline: self.pipeline(gpu, variant, SecondGroup::Facets)?,
                group: self.sum_group(gpu, &buffers, sum)?,
                work,
                each_light: true,
            });
        }
        Ok((passes, preparation))
    }

    pub(crate) fn sum_group(&self, gpu: &Gpu, buffers: &FacetBuffers, sum: Sum) -> Result<wgpu::BindGroup, GpuError> {
        let uniform = gpu.upload("sum", &[sum], wgpu::BufferUsages::UNIFORM)?;
        let bound = [&uniform, &buffers.facets, &buffers.visibility, &buffers.clusters];
        gpu.group("facets", &self.facets, &bound.map(|buffer| buffer.as_entire_binding()))
    }
}

impl Sum {
    /// Returns a sum over no facets, with the parameters of the visibility.
    pub(crate) fn empty(sum: &FacetSum, visibility: &GpuVisibility) -> Self {
        visibility.with(Self { facet_count: sum.facet_count() as u32, ..Self::default() })
    }

    /// Returns the shader of a lobe, and the sum with the constants of that lobe.
    pub(crate) fn with_lobe(self, lobe: Lobe) -> (&'static str, Self) {
        let (shader, shape, scale) = lobe_shader(lobe);
        (shader, Self { shape, scale, ..self })
    }

    pub(crate) fn over(self, range: &Range<usize>) -> Self {
        Self { first: range.start as u32, end: range.end as u32, ..self }
    }
}

impl FacetBuffers {
    /// Uploads facets and visibility, without clusters.
    pub(crate) fn of(gpu: &Gpu, sum: &FacetSum, visibility: &GpuVisibility) -> Result<Self, GpuError> {
        Ok(Self {
            facets: gpu.upload("facets", &facet_rows(sum), wgpu::BufferUsages::STORAGE)?,
            visibility: visibility.upload(gpu)?,
            clusters: gpu.upload::<u32>("clusters", &[], wgpu::BufferUsages::STORAGE)?,
        })
    }
}

/// Splits a range into pieces of at most `max_length`. An empty range is one piece.
pub(crate) fn pieces(range: Range<usize>, max_length: usize) -> impl Iterator<Item = Range<usize>> {
    let count = range.len().div_ceil(max_length).max(1);
    (0..count).map(move |k| range.start + k * max_length..(range.start + (k + 1) * max_length).min(range.end))
}

/// Returns normal and area of each facet. If colours differ, area times colour of each facet follow.
fn facet_rows(sum: &FacetSum) -> Vec<PaddedVec3> {
    let facets = (0..sum.facet_count()).map(|s| sum.facet(s));
    let mut rows: Vec<PaddedVec3> = facets.map(|(v, pad)| PaddedVec3 { v, pad }).collect();
    if sum.colors_vary() {
        for group in sum.groups() {
            for s in group.range.clone() {
                let k = s - group.range.start;
                rows.push(padded(match &group.rgb_areas {
                    Some([r, g, b]) => Vec3::new(r[k], g[k], b[k]),
                    None => Vec3::splat(sum.facet(s).1),
                }));
            }
        }
    }
    rows
}

/// Returns the shader of a lobe and its two constants.
fn lobe_shader(lobe: Lobe) -> (&'static str, f32, f32) {
    match lobe {
        Lobe::Lambertian => ("lobe_lambertian", 0.0, 0.0),
        Lobe::BlinnPhong { half_exponent, scale } => ("lobe_blinn_phong", half_exponent, scale),
        Lobe::CookTorrance { inverse_m2, scale } => ("lobe_cook_torrance", inverse_m2, scale),
        Lobe::Ward { inverse_alpha2, scale } => ("lobe_ward", inverse_alpha2, scale),
        Lobe::Ggx { alpha2, scale } => ("lobe_ggx", alpha2, scale),
    }
}

/// Returns the tint at `i·h = 1`.
pub(crate) fn base_tint(term: &Term) -> Vec3 {
    term.tint(1.0)
}
