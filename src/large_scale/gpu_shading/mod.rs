//! Deferred shading on wgpu: the twin of [`shading::radiance`](super::shading::radiance) with an [`EffectiveBrdf`].
//!
//! A material becomes a list of compute passes over points and slices of eight lights. Each pass is compiled for what it
//! meets (a lobe, a kind of visibility, shadows or none): an effect that a scene does not call for leaves no instruction.

mod direct;
mod low_rank;
mod table;
mod table_of_sum;

use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use self::table_of_sum::Making;
use super::DirectionalLight;
use super::gpu_batches::Batches;
use super::shading_points::ShadingPoints;
use super::shadow::Visible;
use crate::cancel::Cancel;
use crate::error::Result;
use crate::filtering::{EffectiveBrdf, Form, Tint};
use crate::gpu::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError, Swaps};

/// Lobes or table rows that the first submission adds up, and the most that any does.
const BATCH_WORK: [u64; 2] = [1 << 22, 1 << 28];
const THREADS: u32 = 64;
/// Lights that one thread adds up, as in the shader.
const SLICE: u32 = 8;
/// The most workgroups of a dispatch along one axis.
const MAX_GROUPS: usize = 65_535;

/// The layouts of all shading passes, and the pipelines compiled so far: build once, use for any material.
#[derive(Debug)]
pub struct GpuShading {
    points: wgpu::BindGroupLayout,
    facets: wgpu::BindGroupLayout,
    factors: wgpu::BindGroupLayout,
    nodes: wgpu::BindGroupLayout,
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
    /// What the passes read and the device has to make first.
    making: Option<Making>,
    /// Whether [`GpuShading::radiance`] has had it made.
    is_made: AtomicBool,
    least_area: f32,
    /// Whether the passes were compiled to read the bits of shadows.
    shadowed: bool,
}

#[derive(Debug)]
struct Pass {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    /// Lobes or table rows of one point, and one light if there is a thread for each slice of those.
    work: u64,
    each_light: bool,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Params {
    eye: Vec3,
    point_count: u32,
    first_point: u32,
    end_point: u32,
    light_count: u32,
    words_per_point: u32,
    least_area: f32,
    pad: [u32; 3],
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
            nodes: layout("nodes of a table", &[UNIFORM, READ, WRITE])?,
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
        Ok(GpuMaterial::of(passes, None, brdf, shadowed))
    }

    /// Radiance towards the eye of each point, as [`shading::radiance`](super::shading::radiance) gives it but for
    /// rounding. `visible`: the words of a [`Visible`] on the device; materials that were made for shadows read them.
    ///
    /// # Errors
    /// What the device refuses, or [`crate::Error::Cancelled`].
    #[expect(clippy::too_many_arguments, reason = "what to shade, and where")]
    pub fn radiance(
        &self,
        gpu: &Gpu,
        material: &GpuMaterial,
        points: &ShadingPoints,
        lights: &[DirectionalLight],
        visible: Option<&wgpu::Buffer>,
        eye: Vec3,
        cancel: &Cancel,
    ) -> Result<Vec<Vec3>> {
        use wgpu::BufferUsages as Usage;
        if points.is_empty() || lights.is_empty() {
            return Ok(vec![Vec3::ZERO; points.len()]);
        }
        let slices = lights.len().div_ceil(SLICE as usize);
        if slices > MAX_GROUPS || u32::try_from(points.len() * slices).is_err() {
            let what = format!("{} points with {} lights", points.len(), lights.len());
            return Err(GpuError::Unsupported(what).into());
        }
        if material.shadowed && visible.is_none() {
            return Err(GpuError::Unsupported("shadows without an occluder".to_owned()).into());
        }
        let point_data: Vec<[Padded; 3]> = (0..points.len())
            .map(|k| [points.positions[k], points.normals[k], points.tangents[k]].map(padded))
            .collect();
        let light_data: Vec<[Padded; 2]> =
            lights.iter().map(|light| [light.direction, light.irradiance].map(padded)).collect();
        let params = gpu.buffer("parameters", size_of::<Params>() as u64, Usage::UNIFORM | Usage::COPY_DST)?;
        let radiance = gpu.buffer("radiance", (16 * points.len() * slices) as u64, Usage::STORAGE | Usage::COPY_SRC)?;
        let bound = [
            gpu.upload("shading points", &point_data, Usage::STORAGE)?,
            gpu.upload("lights", &light_data, Usage::STORAGE)?,
            match visible {
                Some(words) => words.clone(),
                None => gpu.upload::<u32>("light visibility", &[], Usage::STORAGE)?,
            },
            radiance.clone(),
            gpu.buffer("scales", 4 * points.len() as u64, Usage::STORAGE)?,
        ];
        let resources: Vec<_> = std::iter::once(&params).chain(&bound).map(wgpu::Buffer::as_entire_binding).collect();
        let group = gpu.group("shading points", &self.points, &resources)?;
        if !material.is_made.load(Ordering::Acquire) {
            gpu.checked("making a table", || {
                let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                material.prepare(&mut encoder);
                gpu.queue.submit([encoder.finish()]);
                Ok(())
            })?;
            material.is_made.store(true, Ordering::Release);
        }
        let words = if visible.is_some() { Visible::words_of(lights.len()) } else { 0 };
        Batches::of(points.len(), material.work(lights.len()), BATCH_WORK, THREADS).each(gpu, cancel, |range| {
            let [first_point, end_point] = [range.start, range.end].map(|n| n as u32);
            gpu.write(
                &params,
                &[Params {
                    eye,
                    point_count: points.len() as u32,
                    first_point,
                    end_point,
                    light_count: lights.len() as u32,
                    words_per_point: words as u32,
                    least_area: material.least_area,
                    pad: [0; 3],
                }],
            )?;
            gpu.checked("shading", || {
                let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                for pass in &material.passes {
                    let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                    compute.set_pipeline(&pass.pipeline);
                    compute.set_bind_group(0, &group, &[]);
                    compute.set_bind_group(1, &pass.group, &[]);
                    let rows = if pass.each_light { slices as u32 } else { 1 };
                    compute.dispatch_workgroups((end_point - first_point).div_ceil(THREADS), rows, 1);
                }
                gpu.queue.submit([encoder.finish()]);
                Ok(())
            })
        })?;
        let rows: Vec<[f32; 4]> = gpu.read(&radiance)?;
        let mut total = vec![Vec3::ZERO; points.len()];
        for row in rows.chunks_exact(points.len()).take(slices) {
            for (total, [r, g, b, _]) in total.iter_mut().zip(row) {
                *total += Vec3::new(*r, *g, *b);
            }
        }
        Ok(total)
    }

    fn pipeline(
        &mut self,
        gpu: &Gpu,
        variant: Variant,
        second: Second,
    ) -> std::result::Result<wgpu::ComputePipeline, GpuError> {
        let layout = match second {
            Second::Facets => &self.facets,
            Second::Factors => &self.factors,
        };
        let groups = [self.points.clone(), layout.clone()];
        self.pipeline_over(gpu, variant, &groups.each_ref())
    }

    /// A pipeline over these groups of bindings, from those compiled before if it is there.
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

/// What the second group of bindings holds.
#[derive(Debug, Clone, Copy)]
enum Second {
    Facets,
    Factors,
}

impl GpuMaterial {
    fn of(passes: Vec<Pass>, making: Option<Making>, brdf: &EffectiveBrdf, shadowed: bool) -> Self {
        let is_made = AtomicBool::new(making.is_none());
        Self { passes, making, is_made, least_area: (1e-12 * brdf.base_area) as f32, shadowed }
    }

    /// Encodes what the device has to make before the first shading with this material: the table of
    /// [`GpuShading::tabulated`]. Nothing for other materials. To encode it once is enough; twice makes the same again.
    pub fn prepare(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(making) = &self.making {
            making.encode(encoder);
        }
    }

    /// Lobes and table rows of one point.
    fn work(&self, lights: usize) -> u64 {
        self.passes.iter().map(|pass| pass.work * if pass.each_light { lights as u64 } else { 1 }).sum()
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
