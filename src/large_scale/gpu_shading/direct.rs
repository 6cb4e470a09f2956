//! Passes of the live sum over facets: a projected area, then one pass a term of each group of facets.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::seen::Seen;
use super::{GpuShading, Padded, Pass, Second, Variant, padded, shadow_swap};
use crate::brdf::Term;
use crate::filtering::FacetSum;
use crate::gpu::{Gpu, GpuError, Tier};
use crate::simd::Lobe;

/// `Sum` in `facets.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(super) struct Sum {
    pub(super) first: u32,
    pub(super) end: u32,
    pub(super) azimuths: u32,
    pub(super) rings: u32,
    pub(super) nodes: u32,
    pub(super) sharpness: f32,
    pub(super) shape: f32,
    pub(super) scale: f32,
    pub(super) tint: Vec3,
    pub(super) facet_count: u32,
    pub(super) color: Vec3,
    /// Whether a pass over projected areas is the last of them.
    pub(super) last: u32,
}

/// Facets of one pass on software Vulkan: llvmpipe leaves all loops of a thread, without a word, after 65,535 rounds
/// together. Eight lights, and eight things that hang over a facet, stay below that.
pub(super) const SOFTWARE_FACETS: usize = 512;

/// And on others, where a pass over one row of pixels may be a submission.
const HARDWARE_FACETS: usize = 1024;

/// `Patch` in `sum_patches.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Patch {
    normal: Vec3,
    first: u32,
    end: u32,
    pad: [u32; 3],
}

/// The buffers that all passes read.
#[derive(Clone)]
pub(super) struct Shared {
    pub(super) facets: wgpu::Buffer,
    pub(super) visibility: wgpu::Buffer,
    /// Or the facets that were picked.
    pub(super) patches: wgpu::Buffer,
}

impl GpuShading {
    pub(super) fn direct_passes(
        &mut self,
        gpu: &Gpu,
        sum: &FacetSum,
        seen: &Seen,
        shadowed: bool,
    ) -> Result<Vec<Pass>, GpuError> {
        let groups = sum.groups();
        if groups.iter().any(|group| !group.measured.is_empty() && group.color != Vec3::ZERO) {
            return Err(GpuError::Unsupported(
                "tables of measured BRDFs are summed over facets on the CPU only".to_owned(),
            ));
        }
        let facet_count = sum.facet_count();
        let most = if gpu.tier == Tier::Software { SOFTWARE_FACETS } else { HARDWARE_FACETS };
        let see = seen.file();
        let blank = Sum::blank(sum, seen);
        let mut patches: Vec<Patch> = Vec::new();
        let mut shared = Shared::of(gpu, sum, seen)?;
        let mut planned = Vec::new();
        for group in groups.iter().filter(|group| group.color != Vec3::ZERO) {
            let ranges: Vec<Range<usize>> = match &group.patches {
                None => pieces(group.range.clone(), most).collect(),
                Some(runs) => {
                    let whole = runs.iter().map(|run| (run.normal, run.range.clone()));
                    let cut = whole.flat_map(|(normal, range)| pieces(range, most).map(move |range| (normal, range)));
                    let first = patches.len();
                    patches.extend(cut.map(|(normal, range)| Patch {
                        normal,
                        first: range.start as u32,
                        end: range.end as u32,
                        pad: [0; 3],
                    }));
                    passes_over(&patches, first, most)
                }
            };
            for (lobe, term) in &group.lobes {
                let (file, sum) = blank.of_lobe(*lobe);
                let sum = Sum { tint: base_tint(term), color: group.color, ..sum };
                let swaps = vec![
                    shadow_swap(shadowed),
                    ("visibility_unblocked", see),
                    ("lobe_lambertian", file),
                    ("weights_area", if group.rgb_areas.is_some() { "weights_rgb" } else { "weights_area" }),
                    ("sum_facets", if group.patches.is_some() { "sum_patches" } else { "sum_facets" }),
                ];
                let work = (group.range.len() / ranges.len().max(1)) as u64;
                planned.extend(ranges.iter().map(|range| (swaps.clone(), sum.over(range), work)));
            }
        }
        if !patches.is_empty() {
            shared.patches = gpu.upload("patches", &patches, wgpu::BufferUsages::STORAGE)?;
        }
        let area = Variant {
            shader: "projected_area",
            entry_point: "measure",
            swaps: vec![("visibility_unblocked", see)],
            constants: Vec::new(),
        };
        let mut passes = Vec::new();
        for range in pieces(0..facet_count, most) {
            let sum = Sum { last: u32::from(range.end == facet_count), ..blank.over(&range) };
            passes.push(Pass {
                pipeline: self.pipeline(gpu, area.clone(), Second::Facets)?,
                group: self.sum_group(gpu, &shared, sum)?,
                work: range.len() as u64,
                each_light: false,
            });
        }
        for (swaps, sum, work) in planned {
            let variant = Variant { shader: "shade_direct", entry_point: "shade", swaps, constants: Vec::new() };
            passes.push(Pass {
                pipeline: self.pipeline(gpu, variant, Second::Facets)?,
                group: self.sum_group(gpu, &shared, sum)?,
                work,
                each_light: true,
            });
        }
        Ok(passes)
    }

    pub(super) fn sum_group(&self, gpu: &Gpu, shared: &Shared, sum: Sum) -> Result<wgpu::BindGroup, GpuError> {
        let uniform = gpu.upload("sum", &[sum], wgpu::BufferUsages::UNIFORM)?;
        let bound = [&uniform, &shared.facets, &shared.visibility, &shared.patches];
        gpu.group("facets", &self.facets, &bound.map(|buffer| buffer.as_entire_binding()))
    }
}

impl Sum {
    /// A sum over nothing of the facets, as they see.
    pub(super) fn blank(sum: &FacetSum, seen: &Seen) -> Self {
        seen.with(Self { facet_count: sum.facet_count() as u32, ..Self::default() })
    }

    /// The same with the constants of a lobe, and the file of that.
    pub(super) fn of_lobe(self, lobe: Lobe) -> (&'static str, Self) {
        let (file, shape, scale) = lobe_file(lobe);
        (file, Self { shape, scale, ..self })
    }

    pub(super) fn over(self, range: &Range<usize>) -> Self {
        Self { first: range.start as u32, end: range.end as u32, ..self }
    }
}

impl Shared {
    /// Facets, what they see, and no patches.
    pub(super) fn of(gpu: &Gpu, sum: &FacetSum, seen: &Seen) -> Result<Self, GpuError> {
        Ok(Self {
            facets: gpu.upload("facets", &facet_rows(sum), wgpu::BufferUsages::STORAGE)?,
            visibility: seen.on_device(gpu)?,
            patches: gpu.upload::<u32>("patches", &[], wgpu::BufferUsages::STORAGE)?,
        })
    }
}

/// A range in pieces of `most`; an empty one is a piece.
pub(super) fn pieces(range: Range<usize>, most: usize) -> impl Iterator<Item = Range<usize>> {
    let count = range.len().div_ceil(most).max(1);
    (0..count).map(move |k| range.start + k * most..(range.start + (k + 1) * most).min(range.end))
}

/// Runs of the patches from `first` on that hold `most` facets together, or one patch.
fn passes_over(patches: &[Patch], first: usize, most: usize) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut held = 0;
    for (k, patch) in patches.iter().enumerate().skip(first) {
        let facets = (patch.end - patch.first) as usize;
        match runs.last_mut() {
            Some(run) if held + facets <= most => {
                run.end = k + 1;
                held += facets;
            }
            _ => {
                runs.push(k..k + 1);
                held = facets;
            }
        }
    }
    runs
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
pub(super) fn base_tint(term: &Term) -> Vec3 {
    term.tint(1.0)
}
