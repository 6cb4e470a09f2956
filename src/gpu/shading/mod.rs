//! Deferred shading on wgpu: the twin of [`shading::radiance`](crate::render::image::shading::radiance) with an [`EffectiveBrdf`].
//!
//! A material becomes a list of compute passes over points and slices of the lights. Each pass is compiled for what it
//! meets (a lobe, a kind of visibility, shadows or none): an effect that a scene does not call for leaves no instruction.

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

use self::tabulate::Making;
pub use self::visibility::GpuVisibility;
use super::device::pipelines::{READ, UNIFORM, WRITE};
use super::{Gpu, GpuError, GpuHorizonMap, GpuMaps, Swaps};
use crate::effective::{EffectiveBrdf, GpuTileInput, Representation, Tint};
use crate::render::DirectionalLight;

const THREADS: u32 = 64;
/// The most workgroups of a dispatch along one axis.
const MAX_GROUPS: usize = 65_535;
/// The most points of one dispatch.
pub(crate) const MAX_POINTS: usize = MAX_GROUPS * THREADS as usize;

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
    horizons: Option<GpuHorizonMap>,
    maps: Option<GpuMaps>,
    making: Option<Making>,
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
pub(crate) struct Params {
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
pub(crate) struct Light([Padded; 2]);

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
            Representation::Direct(form) => {
                let (passes, making) =
                    self.direct_passes(gpu, &form.sum, &GpuVisibility::Held(&form.visibility), shadowed)?;
                return Ok(GpuMaterial { making, ..GpuMaterial::of(passes, brdf.base_area) });
            }
            Representation::LowRank(form) => vec![self.low_rank_pass(gpu, form, shadowed)?],
            Representation::Interreflecting(..) => {
                return Err(GpuError::Unsupported("light between facets is added on the CPU only".to_owned()));
            }
            Representation::Table(table) => vec![self.table_pass(gpu, table, shadowed)?],
            Representation::Wu2011(_) => {
                return Err(GpuError::Unsupported("the paper's own tables are read on the CPU only".to_owned()));
            }
        };
        Ok(GpuMaterial::of(passes, brdf.base_area))
    }

    /// A tile whose visibility and product the device makes where it can ([`GpuMaterial::make`]): a table of the sum where
    /// that pays, else the sum itself.
    ///
    /// # Errors
    /// As [`GpuShading::material`].
    pub fn tile(
        &mut self,
        gpu: &Gpu,
        tile: &GpuTileInput,
        seen: GpuVisibility,
        shadowed: bool,
    ) -> std::result::Result<GpuMaterial, GpuError> {
        let GpuTileInput { sum, nodes, interpolation, .. } = tile;
        let table = nodes.map(|nodes| self.tabulated(gpu, (sum, &seen), (nodes, *interpolation), shadowed));
        let (passes, making) = match table {
            Some(Ok((pass, table))) => (vec![pass], Some(table)),
            None | Some(Err(GpuError::Unsupported(_))) => self.direct_passes(gpu, sum, &seen, shadowed)?,
            Some(Err(error)) => return Err(error),
        };
        let (horizons, maps) = match seen {
            GpuVisibility::Marched(horizons, _) | GpuVisibility::Sliced(horizons, _) => (Some(horizons), None),
            GpuVisibility::Drawn(maps, _) => (None, Some(maps)),
            GpuVisibility::Held(_) => (None, None),
        };
        Ok(GpuMaterial { horizons, maps, making, ..GpuMaterial::of(passes, tile.base_area) })
    }

    /// [`Params`], points, lights, the bits of shadows, radiance and scales.
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
    fn of(passes: Vec<Pass>, base_area: f64) -> Self {
        Self { passes, horizons: None, maps: None, making: None, least_area: (1e-12 * base_area) as f32 }
    }

    /// Shadow maps that are to be drawn before [`GpuMaterial::make`].
    pub(crate) fn maps(&self) -> Option<&GpuMaps> {
        self.maps.as_ref()
    }

    /// What facets see, which is to be made before [`GpuMaterial::make`].
    pub(crate) fn horizons(&self) -> Option<&GpuHorizonMap> {
        self.horizons.as_ref()
    }

    /// Whether [`GpuMaterial::make`] has anything to do.
    pub(crate) fn is_to_be_made(&self) -> bool {
        self.making.is_some()
    }

    /// Buffers that [`GpuMaterial::make`] adds to.
    pub(crate) fn sums(&self) -> Vec<&wgpu::Buffer> {
        self.making.iter().flat_map(|making| &making.sums).collect()
    }

    /// Dispatches of [`GpuMaterial::make`] whose lobes are no more than these together.
    pub(crate) fn parts(&self, most_lobes: u64) -> Vec<Range<usize>> {
        self.making.as_ref().map_or_else(|| vec![Range::default()], |making| making.parts(most_lobes))
    }

    /// Records what the device has to make before the first shading with this material, all parts in order: the table of its
    /// sum, or where few normals see alike.
    /// Once is enough; twice makes the same again.
    pub(crate) fn make(&self, compute: &mut wgpu::ComputePass, part: Range<usize>) {
        if let Some(making) = &self.making {
            making.dispatch(compute, part);
        }
    }

    /// Lobes and table rows of one point.
    pub(crate) fn work(&self, lights: usize) -> u64 {
        self.passes.iter().map(|pass| pass.work * if pass.each_light { lights as u64 } else { 1 }).sum()
    }

    /// A projected area [of the tile] below this shows nothing.
    pub(crate) fn least_area(&self) -> f32 {
        self.least_area
    }

    pub(crate) fn passes(&self) -> usize {
        self.passes.len()
    }

    /// Adds radiance towards the eye to the rows of a group's points, one for each slice of the lights; by some of the passes,
    /// which must run in order.
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
