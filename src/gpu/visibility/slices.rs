//! Horizon maps and occlusion intervals of any mesh on the GPU: the twin of
//! [`OcclusionIntervals::scan`](crate::visibility::OcclusionIntervals::scan) and
//! [`HorizonMap::scan`](crate::visibility::HorizonMap::scan). The result stays on the GPU for shading.
//!
//! A slice stores at most four overhangs. If there are more, the fourth covers all above the third.

use bytemuck::{Pod, Zeroable};
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::march::{Dispatch, THREADS, directions, runs};
use crate::geometry::grid::ray_cast::{LIFT, lifted_origin};
use crate::geometry::{Facets, PeriodicGrid};
use crate::gpu::device::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError, GpuHorizonMap};
use crate::visibility::scan::FACING_MARGIN;

/// Words per slice: the horizon, and `STORED_OVERHANGS` of `slice_scan.wgsl`.
const WORDS_PER_SLICE: usize = 5;

/// Largest number of workgroups of a dispatch along one axis.
const MAX_GROUPS: u32 = 65_535;

/// Step limit of a walk, in addition to the cells of sixteen tiles. It is lower than that of `scan.rs`, because a GPU
/// thread visits one triangle at a time and must not take long. The GPU does not count truncated walks; the CPU, which
/// refines the image, does.
const STEP_LIMIT: usize = 32_768;

/// The pipelines of `slice_scan.wgsl`, for any tile. Each is compiled when it is first needed.
#[derive(Debug)]
pub struct GpuSlicer {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    placement_layout: wgpu::BindGroupLayout,
    place: wgpu::ComputePipeline,
    /// The pipelines of horizon maps and of occlusion intervals.
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
    max_steps: u32,
    near: f32,
    first_azimuth: u32,
    pad: u32,
}

/// `Tile` in `place_triangles.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct TileParams {
    size: Vec2,
    copies: u32,
    pad: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Facet {
    origin: Vec3,
    triangle: u32,
    normal: Vec3,
    pad: u32,
}

/// Bytes of `Entry` in `slice_entry.wgsl`.
const ENTRY_BYTES: usize = 48;

impl GpuSlicer {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("slice_scan")?;
        let bindings = [UNIFORM, READ, READ, READ, READ, WRITE];
        let layout = gpu.layout("slices", wgpu::ShaderStages::COMPUTE, &bindings)?;
        let bindings = [UNIFORM, READ, READ, WRITE];
        let placement_layout = gpu.layout("triangles of cells", wgpu::ShaderStages::COMPUTE, &bindings)?;
        let place = gpu.compute_pipeline(&gpu.module("place_triangles")?, "place", &[&placement_layout])?;
        Ok(Self { layout, module, placement_layout, place, compiled: [None, None] })
    }

    /// Uploads a tile and its facets, and prepares the dispatches. `overhangs`: whether overhangs are stored apart from
    /// the horizons.
    ///
    /// # Errors
    /// Errors of the GPU.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        grid: &PeriodicGrid,
        facets: &Facets,
        azimuths: usize,
        overhangs: bool,
    ) -> Result<GpuHorizonMap, GpuError> {
        let words = if overhangs { WORDS_PER_SLICE } else { 1 };
        let pipeline = match &self.compiled[usize::from(overhangs)] {
            Some(pipeline) => pipeline.clone(),
            None => {
                let constants = [("OVERHANGS", f64::from(u8::from(overhangs)))];
                gpu.compute_pipeline_with(&self.module, "scan", &[&self.layout], &constants)?
            }
        };
        self.compiled[usize::from(overhangs)] = Some(pipeline.clone());
        use wgpu::BufferUsages as Usage;
        let params = Params {
            tile_size: grid.tile_size,
            cell_size: grid.cell_size,
            cells: grid.cells,
            top: grid.top,
            facing_margin: FACING_MARGIN,
            azimuths: azimuths as u32,
            facet_count: facets.len() as u32,
            max_steps: (STEP_LIMIT + 16 * (grid.cells.x + grid.cells.y) as usize) as u32,
            near: 10.0 * LIFT * grid.tile_size.length(),
            first_azimuth: 0,
            pad: 0,
        };
        let diagonal = grid.tile_size.length();
        let facet = |s: usize| Facet {
            origin: lifted_origin(facets, s, diagonal),
            triangle: facets.triangles[s],
            normal: facets.normals[s],
            pad: 0,
        };
        let facet_rows: Vec<Facet> = (0..facets.len()).into_par_iter().map(facet).collect();
        let (starts, copies) = grid.all_entries();
        let entries = gpu.buffer("triangles of cells", (ENTRY_BYTES * copies.len()) as u64, Usage::STORAGE)?;
        let preparation = self.triangle_placement(gpu, grid, &entries)?;
        let bytes = (4 * words * facets.len() * azimuths) as u64;
        let slices = gpu.buffer("slices", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        let bound = [
            &gpu.upload("cells", starts, Usage::STORAGE)?,
            &entries,
            &gpu.upload("facets", &facet_rows, Usage::STORAGE)?,
            &gpu.upload("azimuths", &directions(azimuths), Usage::STORAGE)?,
            &slices,
        ];
        let runs = runs(facets.len(), azimuths, |first_azimuth| {
            let params = gpu.upload("tile", &[Params { first_azimuth, ..params }], Usage::UNIFORM)?;
            let bound: Vec<_> = std::iter::once(&params).chain(bound).map(wgpu::Buffer::as_entire_binding).collect();
            gpu.group("slices", &self.layout, &bound)
        })?;
        Ok(GpuHorizonMap { preparation: Some(preparation), pipeline, runs, slopes: slices, azimuths })
    }

    /// Prepares the dispatch that moves copies of triangles to the positions in their cells, which is faster than to
    /// upload them.
    fn triangle_placement(&self, gpu: &Gpu, grid: &PeriodicGrid, entries: &wgpu::Buffer) -> Result<Dispatch, GpuError> {
        use wgpu::BufferUsages as Usage;
        let (_, copies) = grid.all_entries();
        let rows: Vec<[u32; 2]> = copies.iter().map(|copy| copy.words()).collect();
        let bound = [
            &gpu.upload(
                "tile",
                &[TileParams { size: grid.tile_size, copies: rows.len() as u32, pad: 0 }],
                Usage::UNIFORM,
            )?,
            &gpu.upload("copies of triangles", &rows, Usage::STORAGE)?,
            &gpu.upload("triangles", bytemuck::cast_slice::<_, f32>(&grid.corners), Usage::STORAGE)?,
            entries,
        ];
        let group =
            gpu.group("triangles of cells", &self.placement_layout, &bound.map(wgpu::Buffer::as_entire_binding))?;
        let across = (rows.len() as u32).div_ceil(THREADS).clamp(1, MAX_GROUPS);
        let workgroups = [across, (rows.len() as u32).div_ceil(THREADS * across)];
        Ok((self.place.clone(), group, workgroups))
    }
}

#[cfg(test)]
#[path = "slices_tests.rs"]
mod tests;
