//! Deferred shading on the GPU: the twin of [`shading::radiance`](crate::render::image::shading::radiance) with an
//! [`EffectiveBrdf`].
//!
//! A material becomes a list of compute passes over points and slices of the lights. Each pass is compiled for its
//! lobe, its kind of visibility, and with or without shadows. Effects that a scene does not use therefore leave no
//! instructions.

mod bounced;
mod clustered_sum;
mod column_terms;
mod direct;
mod low_rank;
mod sampled_facets;
mod table;
mod tabulate;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod visibility;

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use self::tabulate::Preparation;
pub use self::visibility::GpuVisibility;
use super::device::pipelines::{READ, UNIFORM, WRITE};
use super::{Gpu, GpuError, GpuHorizonMap, GpuMaps, Swaps};
use crate::effective::{EffectiveBrdf, GpuTileInput, Representation, Tint};
use crate::render::DirectionalLight;

const THREADS: u32 = 64;
/// Largest number of workgroups of a dispatch along one axis.
const MAX_GROUPS: usize = 65_535;
/// Largest number of points of one dispatch.
pub(crate) const MAX_POINTS: usize = MAX_GROUPS * THREADS as usize;

/// The layouts of all shading passes, and the pipelines compiled so far, for any material.
#[derive(Debug)]
pub struct GpuShading {
    points: wgpu::BindGroupLayout,
    facets: wgpu::BindGroupLayout,
    factors: wgpu::BindGroupLayout,
    nodes: wgpu::BindGroupLayout,
    compiled: Vec<(Variant, wgpu::ComputePipeline)>,
}

/// The identity of a compiled pipeline.
#[derive(Debug, Clone, PartialEq)]
struct Variant {
    shader: &'static str,
    entry_point: &'static str,
    swaps: Vec<(&'static str, &'static str)>,
    constants: Vec<(&'static str, f64)>,
}

/// An effective BRDF on the GPU: the passes that shade with it, and the work before the first of them.
#[derive(Debug)]
pub struct GpuMaterial {
    passes: Vec<Pass>,
    /// Visibility that the GPU must compute first: a horizon map or occlusion intervals.
    horizons: Option<GpuHorizonMap>,
    /// Visibility that the GPU must compute first: shadow maps.
    maps: Option<GpuMaps>,
    preparation: Option<Preparation>,
    min_area: f32,
}

#[derive(Debug)]
struct Pass {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    /// Lobes or table rows per point, and per light if `each_light` is set.
    work: u64,
    /// True if there is one thread per point and slice of the lights, not one per point.
    each_light: bool,
}

/// Parameters of all passes over the points of one band.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct ShadingParams {
    pub eye: Vec3,
    pub point_count: u32,
    pub light_count: u32,
    pub words_per_point: u32,
    /// Lights per thread.
    pub slice: u32,
    pub min_area: f32,
}

/// `Light` in `shading_points.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct GpuLight([PaddedVec3; 2]);

impl From<&DirectionalLight> for GpuLight {
    fn from(light: &DirectionalLight) -> Self {
        Self([light.direction, light.irradiance].map(padded))
    }
}

/// A vector, padded to 16 bytes as in WGSL.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct PaddedVec3 {
    v: Vec3,
    pad: f32,
}

fn padded(v: Vec3) -> PaddedVec3 {
    PaddedVec3 { v, pad: 0.0 }
}

impl GpuShading {
    pub fn new(gpu: &Gpu) -> std::result::Result<Self, GpuError> {
        let layout = |label, bindings: &[wgpu::BindingType]| gpu.layout(label, wgpu::ShaderStages::COMPUTE, bindings);
        Ok(Self {
            points: layout("shading points", &[UNIFORM, READ, READ, READ, WRITE, WRITE])?,
            facets: layout("facets", &[UNIFORM, READ, READ, READ])?,
            factors: layout("factors", &[UNIFORM, READ, READ, READ])?,
            nodes: layout("nodes of a table", &[UNIFORM, READ, WRITE])?,
            compiled: Vec::new(),
        })
    }

    /// Uploads a BRDF and compiles its passes. `shadowed`: whether points have bits for their visible lights.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for representations that only the CPU evaluates, such as measured BRDFs in a
    /// direct sum; and errors of the GPU.
    pub fn material(
        &mut self,
        gpu: &Gpu,
        brdf: &EffectiveBrdf,
        shadowed: bool,
    ) -> std::result::Result<GpuMaterial, GpuError> {
        let passes = match &brdf.representation {
            Representation::Direct(form) => {
                let (passes, preparation) =
                    self.direct_passes(gpu, &form.sum, &GpuVisibility::Computed(&form.visibility), shadowed)?;
                return Ok(GpuMaterial { preparation, ..GpuMaterial::of(passes, brdf.base_area) });
            }
            Representation::LowRank(form) => vec![self.low_rank_pass(gpu, form, shadowed)?],
            Representation::Interreflecting(direct, bounced) => {
                let direct = EffectiveBrdf { representation: (**direct).clone(), base_area: brdf.base_area };
                let mut material = self.material(gpu, &direct, shadowed)?;
                self.add_bounced(gpu, &mut material, bounced, brdf.base_area, shadowed)?;
                return Ok(material);
            }
            Representation::Table(table) => vec![self.table_pass(gpu, table, shadowed)?],
            Representation::Wu2011(_) => {
                return Err(GpuError::Unsupported("the paper's own tables are evaluated on the CPU only".to_owned()));
            }
        };
        Ok(GpuMaterial::of(passes, brdf.base_area))
    }

    /// Prepares a tile whose visibility and facet sum the GPU computes ([`GpuMaterial::prepare`]). It shades with a
    /// table of the sum if that pays, else with the sum itself.
    ///
    /// # Errors
    /// Those of [`GpuShading::material`].
    pub fn tile(
        &mut self,
        gpu: &Gpu,
        tile: &GpuTileInput,
        visibility: GpuVisibility,
        shadowed: bool,
    ) -> std::result::Result<GpuMaterial, GpuError> {
        let GpuTileInput { sum, nodes, interpolation, .. } = tile;
        let table = nodes.map(|nodes| self.tabulated(gpu, (sum, &visibility), (nodes, *interpolation), shadowed));
        let (passes, preparation) = match table {
            Some(Ok((pass, table))) => (vec![pass], Some(table)),
            None | Some(Err(GpuError::Unsupported(_))) => self.direct_passes(gpu, sum, &visibility, shadowed)?,
            Some(Err(error)) => return Err(error),
        };
        let (horizons, maps) = match visibility {
            GpuVisibility::HorizonMap(horizons, _) | GpuVisibility::OcclusionIntervals(horizons, _) => {
                (Some(horizons), None)
            }
            GpuVisibility::Maps(maps, _) => (None, Some(maps)),
            GpuVisibility::Computed(_) => (None, None),
        };
        Ok(GpuMaterial { horizons, maps, preparation, ..GpuMaterial::of(passes, tile.base_area) })
    }

    /// Binds [`ShadingParams`], points, lights, bits of visible lights, radiance and scales.
    pub(crate) fn points(
        &self,
        gpu: &Gpu,
        bound: [&wgpu::Buffer; 6],
    ) -> std::result::Result<wgpu::BindGroup, GpuError> {
        gpu.group("shading points", &self.points, &bound.map(wgpu::Buffer::as_entire_binding))
    }

    fn pipeline(
        &mut self,
        gpu: &Gpu,
        variant: Variant,
        second_group: SecondGroup,
    ) -> std::result::Result<wgpu::ComputePipeline, GpuError> {
        let layout = match second_group {
            SecondGroup::Facets => &self.facets,
            SecondGroup::Factors => &self.factors,
        };
        let groups = [self.points.clone(), layout.clone()];
        self.pipeline_over(gpu, variant, &groups.each_ref())
    }

    /// Returns a pipeline over these groups of bindings; it is compiled at the first request.
    fn pipeline_over(
        &mut self,
        gpu: &Gpu,
        variant: Variant,
        groups: &[&wgpu::BindGroupLayout],
    ) -> std::result::Result<wgpu::ComputePipeline, GpuError> {
        if let Some((_, pipeline)) = self.compiled.iter().find(|(known, _)| *known == variant) {
            return Ok(pipeline.clone());
        }
        let swaps: Swaps<'_> = &variant.swaps;
        let module = gpu.swapped_module(variant.shader, swaps)?;
        let pipeline = gpu.compute_pipeline_with(&module, variant.entry_point, groups, &variant.constants)?;
        self.compiled.push((variant, pipeline.clone()));
        Ok(pipeline)
    }
}

/// The contents of the second group of bindings.
#[derive(Debug, Clone, Copy)]
enum SecondGroup {
    Facets,
    Factors,
}

impl GpuMaterial {
    fn of(passes: Vec<Pass>, base_area: f64) -> Self {
        Self { passes, horizons: None, maps: None, preparation: None, min_area: (1e-12 * base_area) as f32 }
    }

    /// Returns shadow maps that must be drawn before [`GpuMaterial::prepare`].
    pub(crate) fn maps(&self) -> Option<&GpuMaps> {
        self.maps.as_ref()
    }

    /// Returns horizons that must be computed before [`GpuMaterial::prepare`].
    pub(crate) fn horizons(&self) -> Option<&GpuHorizonMap> {
        self.horizons.as_ref()
    }

    /// Returns whether [`GpuMaterial::prepare`] has any dispatch.
    pub(crate) fn needs_preparation(&self) -> bool {
        self.preparation.is_some()
    }

    /// Returns the buffers to which [`GpuMaterial::prepare`] adds.
    pub(crate) fn sums(&self) -> Vec<&wgpu::Buffer> {
        self.preparation.iter().flat_map(|preparation| &preparation.sums).collect()
    }

    /// Returns the parts of [`GpuMaterial::prepare`], with at most `max_lobes` lobes each.
    pub(crate) fn parts(&self, max_lobes: u64) -> Vec<Range<usize>> {
        self.preparation.as_ref().map_or_else(|| vec![Range::default()], |preparation| preparation.parts(max_lobes))
    }

    /// Records a part of the dispatches that must run before the first shading: they compute the table of the sum, or
    /// horizon bounds. All parts are needed, in order. To run them again computes the same values.
    pub(crate) fn prepare(&self, compute: &mut wgpu::ComputePass, part: Range<usize>) {
        if let Some(preparation) = &self.preparation {
            preparation.dispatch(compute, part);
        }
    }

    /// Returns the lobes and table rows per point.
    pub(crate) fn work(&self, lights: usize) -> u64 {
        self.passes.iter().map(|pass| pass.work * if pass.each_light { lights as u64 } else { 1 }).sum()
    }

    /// Returns the projected area [tile units²] below which a point is black.
    pub(crate) fn min_area(&self) -> f32 {
        self.min_area
    }

    pub(crate) fn passes(&self) -> usize {
        self.passes.len()
    }

    /// Records some of the passes, which must run in order. They add radiance towards the eye to rows of points, one
    /// row per slice of the lights.
    pub(crate) fn shade(
        &self,
        compute: &mut wgpu::ComputePass,
        passes: Range<usize>,
        points: &wgpu::BindGroup,
        [point_count, slices]: [u32; 2],
    ) {
        for pass in &self.passes[passes] {
            compute.set_pipeline(&pass.pipeline);
            compute.set_bind_group(0, points, &[]);
            compute.set_bind_group(1, &pass.group, &[]);
            let rows = if pass.each_light { slices } else { 1 };
            compute.dispatch_workgroups(point_count.div_ceil(THREADS), rows, 1);
        }
    }
}

/// Returns the swap for shadows.
fn shadow_swap(shadowed: bool) -> (&'static str, &'static str) {
    ("shadows_none", if shadowed { "shadows_bits" } else { "shadows_none" })
}

/// `Tint` in `tint_row.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct TintRow {
    base: Vec3,
    follows: f32,
    color: Vec3,
    pad: u32,
}

impl TintRow {
    fn of(tint: &Tint) -> Self {
        let (base, follows, color) = match tint {
            Tint::Term(term, color) => (term.tint(1.0), term.has_fresnel(), *color),
            Tint::Fixed(color) => (Vec3::ONE, false, *color),
        };
        Self { base, follows: f32::from(u8::from(follows)), color, pad: 0 }
    }
}

/// Returns the shader of the tints that these rows need.
fn tint_shader<'a>(mut rows: impl Iterator<Item = &'a TintRow>) -> &'static str {
    if rows.any(|row| row.follows > 0.0) { "tint_fresnel" } else { "tint_fixed" }
}
