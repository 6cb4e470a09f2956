//! Horizons and slices of any mesh on wgpu: the twin of [`Slices::scan`](super::Slices::scan) and
//! [`Horizons::scan`](super::Horizons::scan), left on the device for whatever reads them there.
//!
//! A slice keeps four of the intervals that hang above its horizon; what is above the third is one where there are more (in 0.2 %
//! of slices through the densest pile of rods that ships: `looks_of_slices` in the tests prints it).

use bytemuck::{Pod, Zeroable};
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::PeriodicGrid;
use super::gpu_march::{GpuHorizons, directions, runs};
use super::ray_cast::{LIFT, lifted_origin};
use super::scan::FACING_MARGIN;
use crate::geometry::Facets;
use crate::gpu::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};

/// `KEPT` in `slice_scan.wgsl`, and the horizon.
const WORDS_A_SLICE: usize = 5;

/// Cells and triangles that a walk looks at, besides the cells of sixteen tiles: see `scan.rs`. Fewer than there, as a device
/// looks at one triangle at a time, and must not take long. Walks that end there are not counted: the CPU's, which refine the
/// picture, are.
const LEAST_LOOKS: usize = 32_768;

/// `slice_scan.wgsl`, compiled when a tile first asks for horizons or for slices: build once, use for any tile.
#[derive(Debug)]
pub struct GpuSlicer {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// Of horizons, and of slices.
    compiled: [Option<wgpu::ComputePipeline>; 2],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Params {
    tile_size: Vec2,
    cell_size: Vec2,
    cells: IVec2,
    top: f32,
    facing_margin: f32,
    azimuths: u32,
    facet_count: u32,
    looks: u32,
    near: f32,
    first_azimuth: u32,
    pad: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Place {
    origin: Vec3,
    triangle: u32,
    normal: Vec3,
    pad: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Entry {
    corners: [Vec2; 3],
    z_max: f32,
    z_min: f32,
    heights: Vec3,
    triangle: u32,
}

impl Entry {
    fn new(triangle: u32, corners: [Vec3; 3]) -> Self {
        let heights = Vec3::from(corners.map(|corner| corner.z));
        let (z_max, z_min) = (heights.max_element(), heights.min_element());
        Self { corners: corners.map(Vec3::truncate), z_max, z_min, heights, triangle }
    }
}

impl GpuSlicer {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("slice_scan")?;
        let bindings = [UNIFORM, READ, READ, READ, READ, WRITE];
        let layout = gpu.layout("slices", wgpu::ShaderStages::COMPUTE, &bindings)?;
        Ok(Self { layout, module, compiled: [None, None] })
    }

    /// Uploads a tile and its facets; `hanging`: what hangs above the horizons is to be told apart from what lies below.
    ///
    /// # Errors
    /// What the device refuses.
    pub fn slices(
        &mut self,
        gpu: &Gpu,
        grid: &PeriodicGrid,
        facets: &Facets,
        azimuths: usize,
        hanging: bool,
    ) -> Result<GpuHorizons, GpuError> {
        let words = if hanging { WORDS_A_SLICE } else { 1 };
        let pipeline = match &self.compiled[usize::from(hanging)] {
            Some(pipeline) => pipeline.clone(),
            None => {
                let constants = [("HANGING", f64::from(u8::from(hanging)))];
                gpu.compute_pipeline_with(&self.module, "scan", &[&self.layout], &constants)?
            }
        };
        self.compiled[usize::from(hanging)] = Some(pipeline.clone());
        self.found_by(gpu, pipeline, words, (grid, facets, azimuths))
    }

    fn found_by(
        &self,
        gpu: &Gpu,
        pipeline: wgpu::ComputePipeline,
        words: usize,
        (grid, facets, azimuths): (&PeriodicGrid, &Facets, usize),
    ) -> Result<GpuHorizons, GpuError> {
        use wgpu::BufferUsages as Usage;
        let params = Params {
            tile_size: grid.tile_size,
            cell_size: grid.cell_size,
            cells: grid.cells,
            top: grid.top,
            facing_margin: FACING_MARGIN,
            azimuths: azimuths as u32,
            facet_count: facets.len() as u32,
            looks: (LEAST_LOOKS + 16 * (grid.cells.x + grid.cells.y) as usize) as u32,
            near: 10.0 * LIFT * grid.tile_size.length(),
            first_azimuth: 0,
            pad: 0,
        };
        let (starts, entries) = grid.all_entries();
        let corners = |&entry| grid.copy_corners(entry, IVec2::ZERO);
        let entries: Vec<Entry> = entries.par_iter().map(|entry| Entry::new(entry.triangle, corners(entry))).collect();
        let diagonal = grid.tile_size.length();
        let place = |s: usize| Place {
            origin: lifted_origin(facets, s, diagonal),
            triangle: facets.triangles[s],
            normal: facets.normals[s],
            pad: 0,
        };
        let places: Vec<Place> = (0..facets.len()).into_par_iter().map(place).collect();
        let bytes = (4 * words * facets.len() * azimuths) as u64;
        let found = gpu.buffer("slices", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        let bound = [
            &gpu.upload("cells", starts, Usage::STORAGE)?,
            &gpu.upload("triangles of cells", &entries, Usage::STORAGE)?,
            &gpu.upload("places of facets", &places, Usage::STORAGE)?,
            &gpu.upload("azimuths", &directions(azimuths), Usage::STORAGE)?,
            &found,
        ];
        let runs = runs(facets.len(), azimuths, |first_azimuth| {
            let params = gpu.upload("tile", &[Params { first_azimuth, ..params }], Usage::UNIFORM)?;
            let bound: Vec<_> = std::iter::once(&params).chain(bound).map(wgpu::Buffer::as_entire_binding).collect();
            gpu.group("slices", &self.layout, &bound)
        })?;
        Ok(GpuHorizons { pipeline, runs, elevations: found, azimuths })
    }
}

#[cfg(test)]
#[path = "gpu_slices_tests.rs"]
pub(crate) mod tests;
