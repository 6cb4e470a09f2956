//! Horizon map of a height field on the GPU: the twin of [`HorizonMap::march`](crate::visibility::HorizonMap::march).
//! The result stays on the GPU for shading (`visibility_horizons.wgsl`).

use std::f32::consts::{FRAC_PI_2, TAU};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::geometry::{Facets, HeightGrid};
use crate::gpu::device::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};
use crate::math::directions::from_angles;
use crate::visibility::scan::FACING_MARGIN;

pub(super) const THREADS: u32 = 64;

/// The compiled pipeline of `height_march.wgsl`, for any tile.
#[derive(Debug)]
pub struct GpuHeightMarch {
    layout: wgpu::BindGroupLayout,
    march: wgpu::ComputePipeline,
}

/// A pipeline, its bindings and the workgroups of its dispatch.
pub(super) type Dispatch = (wgpu::ComputePipeline, wgpu::BindGroup, [u32; 2]);

/// A horizon map, or occlusion intervals, that a submission will compute.
#[derive(Debug)]
pub struct GpuHorizonMap {
    /// A dispatch before the first run, whose output the runs read.
    pub(super) preparation: Option<Dispatch>,
    pub(super) pipeline: wgpu::ComputePipeline,
    /// Bindings of each run, with its numbers of workgroups along facets and of azimuths.
    pub(super) runs: Vec<(wgpu::BindGroup, [u32; 2])>,
    /// Slopes of horizons, or the input of `visibility_packed_intervals.wgsl`; the azimuths of a facet are adjacent.
    /// Zeros until they are computed.
    pub slopes: wgpu::Buffer,
    pub azimuths: usize,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Params {
    size: [u32; 2],
    samples_from_tile: [f32; 2],
    top: f32,
    azimuths: u32,
    facet_count: u32,
    facing_margin: f32,
    first_azimuth: u32,
    pad: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Facet {
    position: Vec3,
    pad_p: u32,
    normal: Vec3,
    pad_n: u32,
}

impl GpuHeightMarch {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("height_march")?;
        let layout = gpu.layout("height-field", wgpu::ShaderStages::COMPUTE, &[UNIFORM, READ, READ, WRITE, READ])?;
        Ok(Self { march: gpu.compute_pipeline(&module, "march", &[&layout])?, layout })
    }

    /// Uploads the height field and its facets, and prepares the dispatches.
    ///
    /// # Errors
    /// Errors of the GPU.
    pub fn horizon_map(
        &self,
        gpu: &Gpu,
        heights: &HeightGrid,
        tile_size: glam::Vec2,
        facets: &Facets,
        azimuths: usize,
    ) -> Result<GpuHorizonMap, GpuError> {
        use wgpu::BufferUsages as Usage;
        let params = Params {
            size: heights.size.to_array(),
            samples_from_tile: (heights.size.as_vec2() / tile_size).to_array(),
            top: heights.heights.iter().fold(f32::NEG_INFINITY, |top, &z| top.max(z)),
            azimuths: azimuths as u32,
            facet_count: facets.len() as u32,
            facing_margin: FACING_MARGIN,
            first_azimuth: 0,
            pad: 0,
        };
        let facet_rows = facets.positions.iter().zip(&facets.normals);
        let facet_rows: Vec<Facet> =
            facet_rows.map(|(&position, &normal)| Facet { position, pad_p: 0, normal, pad_n: 0 }).collect();
        let slopes = gpu.buffer("horizons", (4 * facets.len() * azimuths) as u64, Usage::STORAGE | Usage::COPY_SRC)?;
        let bound = [
            &gpu.upload("heights", &heights.heights, Usage::STORAGE)?,
            &gpu.upload("facets", &facet_rows, Usage::STORAGE)?,
            &slopes,
            &gpu.upload("azimuths", &directions(azimuths), Usage::STORAGE)?,
        ];
        let runs = runs(facets.len(), azimuths, |first_azimuth| {
            let params = gpu.upload("height-field", &[Params { first_azimuth, ..params }], Usage::UNIFORM)?;
            let bound: Vec<_> = std::iter::once(&params).chain(bound).map(wgpu::Buffer::as_entire_binding).collect();
            gpu.group("height-field", &self.layout, &bound)
        })?;
        Ok(GpuHorizonMap { preparation: None, pipeline: self.march.clone(), runs, slopes, azimuths })
    }
}

/// Returns unit vectors of the plane along the azimuths. The CPU computes them, because sines and cosines of shaders
/// may be off by 2⁻¹¹ and miss the axes.
pub(super) fn directions(azimuths: usize) -> Vec<glam::Vec2> {
    let along = |azimuth: usize| from_angles(FRAC_PI_2, TAU * azimuth as f32 / azimuths as f32).truncate();
    (0..azimuths).map(along).collect()
}

/// Largest number of walks of one dispatch; small in tests, so that every test takes several dispatches.
const MAX_WALKS: usize = if cfg!(test) { 1 << 10 } else { 1 << 21 };

/// Work of a walk in lobes: the number of edges, or of cells and triangles, that a walk visits on a dense tile.
const LOBES_PER_WALK: u64 = 512;

/// Splits azimuths into runs of one dispatch each. Returns the bindings of each run, its workgroups and its number of
/// azimuths. `group` creates the bindings of the run that begins with an azimuth.
pub(super) fn runs(
    facets: usize,
    azimuths: usize,
    group: impl Fn(u32) -> Result<wgpu::BindGroup, GpuError>,
) -> Result<Vec<(wgpu::BindGroup, [u32; 2])>, GpuError> {
    let azimuths_per_run = (MAX_WALKS / facets.max(1)).max(1);
    let run = |first: usize| {
        let count = azimuths_per_run.min(azimuths - first) as u32;
        Ok((group(first as u32)?, [(facets as u32).div_ceil(THREADS), count]))
    };
    (0..azimuths).step_by(azimuths_per_run).map(run).collect()
}

impl GpuHorizonMap {
    /// Returns the number of dispatches that compute it.
    pub fn runs(&self) -> usize {
        self.runs.len()
    }

    /// Returns the work of one dispatch, in lobes.
    pub fn work(&self, run: usize) -> u64 {
        let [groups, azimuths] = self.runs[run].1.map(u64::from);
        groups * u64::from(THREADS) * azimuths * LOBES_PER_WALK
    }

    /// Records one dispatch. Dispatches must be recorded in order.
    pub fn dispatch(&self, pass: &mut wgpu::ComputePass, run: usize) {
        if let (0, Some((pipeline, group, [columns, rows]))) = (run, &self.preparation) {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(*columns, *rows, 1);
        }
        let (group, [workgroups, azimuths]) = &self.runs[run];
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.dispatch_workgroups(*workgroups, *azimuths, 1);
    }
}

#[cfg(test)]
#[path = "march_tests.rs"]
mod tests;
