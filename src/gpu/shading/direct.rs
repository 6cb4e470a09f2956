//! Passes of the live sum over facets: a projected area, then one pass a term of each group of facets, or one
//! for all terms where normals are few.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::clustered_sum::{Patches, reach_file};
use super::tabulate::Making;
use super::visibility::GpuVisibility;
use super::{GpuShading, Padded, Pass, Second, Variant, padded, shadow_swap};
use crate::brdf::Term;
use crate::effective::{FacetSum, Group};
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
    /// Of several passes over projected areas: 1 the first, 2 the last, 3 both.
    pub(crate) place: u32,
}

/// Facets of one pass on software Vulkan: llvmpipe leaves all loops of a thread, without a word, after 65,535 rounds
/// together. SimdF32x8 lights, and eight things that hang over a facet, stay below that.
pub(crate) const SOFTWARE_FACETS: usize = 512;

/// And on others, where a pass over one row of pixels may be a submission.
const HARDWARE_FACETS: usize = 1024;

/// The buffers that all passes read.
#[derive(Clone)]
pub(crate) struct Shared {
    pub(crate) facets: wgpu::Buffer,
    pub(crate) visibility: wgpu::Buffer,
    /// Or the facets that were picked.
    pub(crate) patches: wgpu::Buffer,
}

impl GpuShading {
    /// The passes, and what the device has to make before the first.
    pub(super) fn direct_passes(
        &mut self,
        gpu: &Gpu,
        sum: &FacetSum,
        seen: &GpuVisibility,
        shadowed: bool,
    ) -> Result<(Vec<Pass>, Option<Making>), GpuError> {
        let groups = sum.groups();
        if groups.iter().any(|group| !group.measured.is_empty() && group.color != Vec3::ZERO) {
            return Err(GpuError::Unsupported(
                "tables of measured BRDFs are summed over facets on the CPU only".to_owned(),
            ));
        }
        let most = if gpu.tier == Tier::Software { SOFTWARE_FACETS } else { HARDWARE_FACETS };
        let (see, reach) = (("visibility_unblocked", seen.file()), ("reach_unblocked", reach_file(seen)));
        let weights = |vary: bool| ("weights_area", if vary { "weights_rgb" } else { "weights_area" });
        let blank = Sum::blank(sum, seen);
        let mut shared = Shared::of(gpu, sum, seen)?;
        let patches = Patches::of(sum, most);
        let (on_device, tints, making) = self.patches(gpu, (sum, seen, &shared), &patches)?;
        shared.patches = on_device;
        let of_patches = |range: Range<usize>| (blank.over(&range), patches.facets(range));

        let many = |group: &&Group| group.patches.is_none();
        let of_facets = groups.iter().filter(many).flat_map(|group| pieces(group.range.clone(), most));
        let of_facets = of_facets.map(|range| ("sum_areas", blank.over(&range), range.len() as u64));
        let of_runs = patches.passes(most, true).into_iter().map(of_patches);
        let of_runs = of_runs.map(|(sum, work)| ("sum_patch_areas", sum, work));
        let areas: Vec<_> = of_facets.chain(of_runs).collect();
        let mut passes = Vec::new();
        for (k, (file, sum, work)) in areas.iter().enumerate() {
            let place = u32::from(k == 0) + 2 * u32::from(k + 1 == areas.len());
            let swaps = vec![see, reach, ("sum_areas", *file)];
            let variant = Variant { shader: "projected_area", entry_point: "measure", swaps, constants: Vec::new() };
            passes.push(Pass {
                pipeline: self.pipeline(gpu, variant, Second::Facets)?,
                group: self.sum_group(gpu, &shared, Sum { place, ..*sum })?,
                work: *work,
                each_light: false,
            });
        }

        let mut planned = Vec::new();
        for group in groups.iter().filter(many).filter(|group| group.color != Vec3::ZERO) {
            for (lobe, term) in &group.lobes {
                let (file, sum) = blank.of_lobe(*lobe);
                let sum = Sum { tint: base_tint(term), color: group.color, ..sum };
                let swaps =
                    vec![shadow_swap(shadowed), see, ("lobe_lambertian", file), weights(group.rgb_areas.is_some())];
                let passes = pieces(group.range.clone(), most).map(|range| (sum.over(&range), range.len() as u64));
                planned.extend(passes.map(|(sum, work)| ("shade_direct", swaps.clone(), sum, work)));
            }
        }
        let swaps = vec![shadow_swap(shadowed), see, reach, ("tint_fixed", tints), weights(sum.colors_vary())];
        let of_runs = patches.passes(most, false).into_iter().map(of_patches);
        planned.extend(of_runs.map(|(sum, work)| ("shade_patches", swaps.clone(), sum, work)));
        for (shader, swaps, sum, work) in planned {
            let variant = Variant { shader, entry_point: "shade", swaps, constants: Vec::new() };
            passes.push(Pass {
                pipeline: self.pipeline(gpu, variant, Second::Facets)?,
                group: self.sum_group(gpu, &shared, sum)?,
                work,
                each_light: true,
            });
        }
        Ok((passes, making))
    }

    pub(crate) fn sum_group(&self, gpu: &Gpu, shared: &Shared, sum: Sum) -> Result<wgpu::BindGroup, GpuError> {
        let uniform = gpu.upload("sum", &[sum], wgpu::BufferUsages::UNIFORM)?;
        let bound = [&uniform, &shared.facets, &shared.visibility, &shared.patches];
        gpu.group("facets", &self.facets, &bound.map(|buffer| buffer.as_entire_binding()))
    }
}

impl Sum {
    /// A sum over nothing of the facets, as they see.
    pub(crate) fn blank(sum: &FacetSum, seen: &GpuVisibility) -> Self {
        seen.with(Self { facet_count: sum.facet_count() as u32, ..Self::default() })
    }

    /// The same with the constants of a lobe, and the file of that.
    pub(crate) fn of_lobe(self, lobe: Lobe) -> (&'static str, Self) {
        let (file, shape, scale) = lobe_file(lobe);
        (file, Self { shape, scale, ..self })
    }

    pub(crate) fn over(self, range: &Range<usize>) -> Self {
        Self { first: range.start as u32, end: range.end as u32, ..self }
    }
}

impl Shared {
    /// Facets, what they see, and no patches.
    pub(crate) fn of(gpu: &Gpu, sum: &FacetSum, seen: &GpuVisibility) -> Result<Self, GpuError> {
        Ok(Self {
            facets: gpu.upload("facets", &facet_rows(sum), wgpu::BufferUsages::STORAGE)?,
            visibility: seen.on_device(gpu)?,
            patches: gpu.upload::<u32>("patches", &[], wgpu::BufferUsages::STORAGE)?,
        })
    }
}

/// A range in pieces of `most`; an empty one is a piece.
pub(crate) fn pieces(range: Range<usize>, most: usize) -> impl Iterator<Item = Range<usize>> {
    let count = range.len().div_ceil(most).max(1);
    (0..count).map(move |k| range.start + k * most..(range.start + (k + 1) * most).min(range.end))
}

/// Normal and area of each facet; where the colours of any differ, area times colour of each after that.
fn facet_rows(sum: &FacetSum) -> Vec<Padded> {
    let facets = (0..sum.facet_count()).map(|s| sum.facet(s));
    let mut rows: Vec<Padded> = facets.map(|(v, pad)| Padded { v, pad }).collect();
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

/// The file of a lobe and its two constants.
fn lobe_file(lobe: Lobe) -> (&'static str, f32, f32) {
    match lobe {
        Lobe::Lambertian => ("lobe_lambertian", 0.0, 0.0),
        Lobe::BlinnPhong { half_exponent, scale } => ("lobe_blinn_phong", half_exponent, scale),
        Lobe::CookTorrance { inverse_m2, scale } => ("lobe_cook_torrance", inverse_m2, scale),
        Lobe::Ward { inverse_alpha2, scale } => ("lobe_ward", inverse_alpha2, scale),
        Lobe::Ggx { alpha2, scale } => ("lobe_ggx", alpha2, scale),
    }
}

/// The tint at `i·h = 1`.
pub(crate) fn base_tint(term: &Term) -> Vec3 {
    term.tint(1.0)
}
