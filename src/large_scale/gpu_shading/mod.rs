//! Deferred shading on wgpu: the twin of [`shading::radiance`](super::shading::radiance) with an [`EffectiveBrdf`].
//!
//! A material becomes a list of compute passes over points and slices of the lights. Each pass is compiled for what it
//! meets (a lobe, a kind of visibility, shadows or none): an effect that a scene does not call for leaves no instruction.

mod direct;
mod low_rank;
mod table;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::DirectionalLight;
use crate::filtering::{EffectiveBrdf, Form, Tint};
use crate::gpu::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError, Swaps};

const THREADS: u32 = 64;
/// The most points of one dispatch.
pub(super) const MOST_POINTS: usize = 65_535 * THREADS as usize;

/// The layouts of all shading passes, and the pipelines compiled so far: build once, use for any material.
#[derive(Debug)]
pub struct GpuShading {
    points: wgpu::BindGroupLayout,
    facets: wgpu::BindGroupLayout,
    factors: wgpu::BindGroupLayout,
    compiled: Vec<(Variant, wgpu::ComputePipeline)>,
}

/// What tells one pipeline from another.
#[derive(Debug, Clone, PartialEq)]
struct Variant {
    shader: &'static str,
    entry_point: &'static str,
    swaps: Vec<(&'static str, &'static str)>,
    constants: Vec<(&'static str, f64)>,
}

/// An effective BRDF on the device.
#[derive(Debug)]
pub struct GpuMaterial {
    passes: Vec<Pass>,
    least_area: f32,
}

#[derive(Debug)]
struct Pass {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    /// Lobes or table rows of one point, and one light if there is a thread for each slice of those.
    work: u64,
    each_light: bool,
}

/// What all passes over the points of one band share.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct Params {
    pub eye: Vec3,
    pub point_count: u32,
    pub light_count: u32,
    pub words_per_point: u32,
    /// Lights that one thread adds up.
    pub slice: u32,
    pub least_area: f32,
}

/// A light as shaders see it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct Light([Padded; 2]);

impl From<&DirectionalLight> for Light {
    fn from(light: &DirectionalLight) -> Self {
        Self([light.direction, light.irradiance].map(padded))
    }
}

/// A vector and padding to the 16 bytes WGSL gives it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Padded {
    v: Vec3,
    pad: f32,
}

fn padded(v: Vec3) -> Padded {
    Padded { v, pad: 0.0 }
}

impl GpuShading {
    pub fn new(gpu: &Gpu) -> std::result::Result<Self, GpuError> {
        let layout = |label, bindings: &[wgpu::BindingType]| gpu.layout(label, wgpu::ShaderStages::COMPUTE, bindings);
        Ok(Self {
            points: layout("shading points", &[UNIFORM, READ, READ, READ, WRITE, WRITE])?,
            facets: layout("facets", &[UNIFORM, READ, READ, READ])?,
            factors: layout("factors", &[UNIFORM, READ, READ, READ])?,
            compiled: Vec::new(),
        })
    }

    /// Uploads a BRDF and compiles what it needs. `shadowed`: points come with the lights they see.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for what only the CPU does (measured BRDFs that are not factored), and what devices refuse.
    pub fn material(
        &mut self,
        gpu: &Gpu,
        brdf: &EffectiveBrdf,
        shadowed: bool,
    ) -> std::result::Result<GpuMaterial, GpuError> {
        let passes = match &brdf.form {
            Form::Direct(form) => self.direct_passes(gpu, form, shadowed)?,
            Form::LowRank(form) => vec![self.low_rank_pass(gpu, form, shadowed)?],
            Form::Interreflecting(..) => {
                return Err(GpuError::Unsupported("light between facets is added on the CPU only".to_owned()));
            }
            Form::Table(table) => vec![self.table_pass(gpu, table, shadowed)?],
            Form::Wu2011(_) => {
                return Err(GpuError::Unsupported("the paper's own tables are read on the CPU only".to_owned()));
            }
        };
        Ok(GpuMaterial { passes, least_area: (1e-12 * brdf.base_area) as f32 })
    }

    /// [`Params`], points, lights, the bits of shadows, radiance and scales.
    pub(super) fn points(
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
        second: Second,
    ) -> std::result::Result<wgpu::ComputePipeline, GpuError> {
        if let Some((_, pipeline)) = self.compiled.iter().find(|(known, _)| *known == variant) {
            return Ok(pipeline.clone());
        }
        let swaps: Swaps<'_> = &variant.swaps;
        let module = gpu.swapped_module(variant.shader, swaps)?;
        let layout = match second {
            Second::Facets => &self.facets,
            Second::Factors => &self.factors,
        };
        let pipeline =
            gpu.compute_pipeline_with(&module, variant.entry_point, &[&self.points, layout], &variant.constants)?;
        self.compiled.push((variant, pipeline.clone()));
        Ok(pipeline)
    }
}

/// What the second group of bindings holds.
#[derive(Debug, Clone, Copy)]
enum Second {
    Facets,
    Factors,
}

impl GpuMaterial {
    /// Lobes and table rows of one point.
    pub(super) fn work(&self, lights: usize) -> u64 {
        self.passes.iter().map(|pass| pass.work * if pass.each_light { lights as u64 } else { 1 }).sum()
    }

    /// A projected area [of the tile] below this shows nothing.
    pub(super) fn least_area(&self) -> f32 {
        self.least_area
    }

    /// Adds radiance towards the eye to the rows of a group's points, one for each slice of the lights.
    pub(super) fn shade(
        &self,
        compute: &mut wgpu::ComputePass,
        points: &wgpu::BindGroup,
        [point_count, slices]: [u32; 2],
    ) {
        for pass in &self.passes {
            compute.set_pipeline(&pass.pipeline);
            compute.set_bind_group(0, points, &[]);
            compute.set_bind_group(1, &pass.group, &[]);
            let rows = if pass.each_light { slices } else { 1 };
            compute.dispatch_workgroups(point_count.div_ceil(THREADS), rows, 1);
        }
    }
}

/// The import that shadows stand behind, and what stands in for it.
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

/// Which tints these call for.
fn tint_file<'a>(mut rows: impl Iterator<Item = &'a TintRow>) -> &'static str {
    if rows.any(|row| row.follows > 0.0) { "tint_fresnel" } else { "tint_fixed" }
}
