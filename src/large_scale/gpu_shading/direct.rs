//! Passes of the live sum over facets: a projected area, then one pass a term of each group of facets.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::{GpuShading, Padded, Pass, Second, Variant, padded, shadow_swap};
use crate::brdf::Term;
use crate::filtering::Direct;
use crate::gpu::{Gpu, GpuError, Tier};
use crate::simd::Lobe;
use crate::visibility::{Horizons, Slices, SoftMaps, Visibility};

/// `Sum` in `facets.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(super) struct Sum {
    first: u32,
    end: u32,
    azimuths: u32,
    rings: u32,
    nodes: u32,
    sharpness: f32,
    shape: f32,
    scale: f32,
    tint: Vec3,
    facet_count: u32,
    color: Vec3,
    /// Whether a pass over projected areas is the last of them.
    last: u32,
}

/// Facets of one pass on software Vulkan: llvmpipe leaves all loops of a thread, without a word, after 65,535 rounds
/// together. Eight lights, and eight things that hang over a facet, stay below that.
pub(super) const SOFTWARE_FACETS: usize = 512;

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
pub(super) struct Shared {
    facets: wgpu::Buffer,
    visibility: wgpu::Buffer,
    patches: wgpu::Buffer,
}

impl GpuShading {
    pub(super) fn direct_passes(&mut self, gpu: &Gpu, form: &Direct, shadowed: bool) -> Result<Vec<Pass>, GpuError> {
        let groups = form.sum.groups();
        if groups.iter().any(|group| !group.measured.is_empty() && group.color != Vec3::ZERO) {
            return Err(GpuError::Unsupported(
                "tables of measured BRDFs are summed over facets on the CPU only".to_owned(),
            ));
        }
        let facet_count = form.sum.facet_count();
        let most = if gpu.tier == Tier::Software { SOFTWARE_FACETS } else { facet_count.max(1) };
        let visibility = form.visibility.as_ref();
        let see = visibility_file(visibility);
        let blank = Sum::blank(form);
        let mut patches: Vec<Patch> = Vec::new();
        let mut shared = Shared::of(gpu, form)?;
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
    /// A sum over nothing of a form's facets, as they see.
    pub(super) fn blank(form: &Direct) -> Self {
        let sum = Self { facet_count: form.sum.facet_count() as u32, ..Self::default() };
        with_visibility(sum, &form.visibility)
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
    /// A form's facets, what they see, and no patches.
    pub(super) fn of(gpu: &Gpu, form: &Direct) -> Result<Self, GpuError> {
        Ok(Self {
            facets: gpu.upload("facets", &facet_rows(form), wgpu::BufferUsages::STORAGE)?,
            visibility: upload_visibility(gpu, &form.visibility)?,
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
fn facet_rows(form: &Direct) -> Vec<Padded> {
    let facets = (0..form.sum.facet_count()).map(|s| form.sum.facet(s));
    let mut rows: Vec<Padded> = facets.map(|(v, pad)| Padded { v, pad }).collect();
    if form.sum.colors_vary() {
        for group in form.sum.groups() {
            for s in group.range.clone() {
                let k = s - group.range.start;
                rows.push(padded(match &group.rgb_areas {
                    Some([r, g, b]) => Vec3::new(r[k], g[k], b[k]),
                    None => Vec3::splat(form.sum.facet(s).1),
                }));
            }
        }
    }
    rows
}

pub(super) fn visibility_file(visibility: &Visibility) -> &'static str {
    match visibility {
        Visibility::Unblocked { .. } => "visibility_unblocked",
        Visibility::Horizons(_) => "visibility_horizons",
        Visibility::Slices(_) => "visibility_slices",
        Visibility::Maps(_) => "visibility_maps",
    }
}

fn with_visibility(sum: Sum, visibility: &Visibility) -> Sum {
    match visibility {
        Visibility::Unblocked { .. } => sum,
        Visibility::Horizons(horizons) => with_horizons(sum, horizons),
        Visibility::Slices(slices) => with_horizons(sum, &slices.horizons),
        Visibility::Maps(maps) => Sum {
            azimuths: maps.grid.azimuths as u32,
            rings: maps.grid.rings as u32,
            nodes: maps.grid.len() as u32,
            ..sum
        },
    }
}

fn with_horizons(sum: Sum, horizons: &Horizons) -> Sum {
    Sum { azimuths: horizons.azimuths() as u32, sharpness: 1.0 / horizons.ramp(), ..sum }
}

/// Side by side what neighbouring points read of one facet: they look along neighbouring directions.
fn upload_visibility(gpu: &Gpu, visibility: &Visibility) -> Result<wgpu::Buffer, GpuError> {
    let usage = wgpu::BufferUsages::STORAGE;
    match visibility {
        Visibility::Unblocked { .. } => gpu.upload::<u32>("visibility", &[], usage),
        Visibility::Slices(slices) => gpu.upload("slices", &slices_by_facet(slices), usage),
        Visibility::Horizons(horizons) => gpu.upload("horizons", &horizons_by_facet(horizons), usage),
        Visibility::Maps(maps) => gpu.upload("visibility maps", &bits_by_facet(maps), usage),
    }
}

fn horizons_by_facet(horizons: &Horizons) -> Vec<f32> {
    let azimuths = horizons.azimuths();
    (0..horizons.facets() * azimuths).map(|k| horizons.elevation(k % azimuths, k / azimuths)).collect()
}

/// Horizons, starts of the hanging intervals, and the intervals (visibility_slices.wgsl).
fn slices_by_facet(slices: &Slices) -> Vec<u32> {
    let mut words: Vec<u32> = horizons_by_facet(&slices.horizons).into_iter().map(f32::to_bits).collect();
    let (starts, intervals) = slices.hanging_by_facet();
    words.extend(starts);
    words.extend(intervals.iter().flat_map(|&(low, high)| [low.to_bits(), high.to_bits()]));
    words
}

fn bits_by_facet(maps: &SoftMaps) -> Vec<u32> {
    let (words, nodes) = (maps.packed.words_per_row(), maps.packed.direction_count);
    (0..words * nodes).map(|k| maps.packed.words[k % nodes * words + k / nodes]).collect()
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
