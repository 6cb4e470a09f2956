//! HorizonMap and slices of any mesh on wgpu: the twin of [`OcclusionIntervals::scan`](crate::visibility::OcclusionIntervals::scan) and
//! [`HorizonMap::scan`](crate::visibility::HorizonMap::scan), left on the device for whatever reads them there.
//!
//! A slice keeps four of the intervals that hang above its horizon; what is above the third is one where there are more (in 0.2 %
//! of slices through the densest pile of rods that ships: `looks_of_slices` in the tests prints it).

use bytemuck::{Pod, Zeroable};
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::march::{Placing, THREADS, directions, runs};
use crate::geometry::grid::ray_cast::{LIFT, lifted_origin};
use crate::geometry::{Facets, PeriodicGrid};
use crate::gpu::device::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError, GpuHorizonMap};
use crate::visibility::scan::FACING_MARGIN;

/// `KEPT` in `slice_scan.wgsl`, and the horizon.
const WORDS_A_SLICE: usize = 5;

/// The most workgroups of a dispatch along one axis.
const MAX_GROUPS: u32 = 65_535;

/// Cells and triangles that a walk looks at, besides the cells of sixteen tiles: see `scan.rs`. Fewer than there, as a device
/// looks at one triangle at a time, and must not take long. Walks that end there are not counted: the CPU's, which refine the
/// picture, are.
const MIN_LOOKS: usize = 32_768;

/// `slice_scan.wgsl`, compiled when a tile first asks for horizons or for slices: build once, use for any tile.
#[derive(Debug)]
pub struct GpuSlicer {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    to_place: wgpu::BindGroupLayout,
    place: wgpu::ComputePipeline,
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

/// `Tile` in `place_triangles.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct TileOf {
    size: Vec2,
    copies: u32,
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

/// Bytes of `Entry` in `slice_entry.wgsl`.
const ENTRY_BYTES: usize = 48;

impl GpuSlicer {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("slice_scan")?;
        let bindings = [UNIFORM, READ, READ, READ, READ, WRITE];
        let layout = gpu.layout("slices", wgpu::ShaderStages::COMPUTE, &bindings)?;
        let bindings = [UNIFORM, READ, READ, WRITE];
        let to_place = gpu.layout("triangles of cells", wgpu::ShaderStages::COMPUTE, &bindings)?;
        let place = gpu.compute_pipeline(&gpu.module("place_triangles")?, "place", &[&to_place])?;
        Ok(Self { layout, module, to_place, place, compiled: [None, None] })
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
    ) -> Result<GpuHorizonMap, GpuError> {
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
    ) -> Result<GpuHorizonMap, GpuError> {
        use wgpu::BufferUsages as Usage;
        let params = Params {
            tile_size: grid.tile_size,
            cell_size: grid.cell_size,
            cells: grid.cells,
            top: grid.top,
            facing_margin: FACING_MARGIN,
            azimuths: azimuths as u32,
            facet_count: facets.len() as u32,
            looks: (MIN_LOOKS + 16 * (grid.cells.x + grid.cells.y) as usize) as u32,
            near: 10.0 * LIFT * grid.tile_size.length(),
            first_azimuth: 0,
            pad: 0,
        };
        let diagonal = grid.tile_size.length();
        let place = |s: usize| Place {
            origin: lifted_origin(facets, s, diagonal),
            triangle: facets.triangles[s],
            normal: facets.normals[s],
            pad: 0,
        };
        let places: Vec<Place> = (0..facets.len()).into_par_iter().map(place).collect();
        let (starts, copies) = grid.all_entries();
        let entries = gpu.buffer("triangles of cells", (ENTRY_BYTES * copies.len()) as u64, Usage::STORAGE)?;
        let first = self.placing(gpu, grid, &entries)?;
        let bytes = (4 * words * facets.len() * azimuths) as u64;
        let found = gpu.buffer("slices", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        let bound = [
            &gpu.upload("cells", starts, Usage::STORAGE)?,
            &entries,
            &gpu.upload("places of facets", &places, Usage::STORAGE)?,
            &gpu.upload("azimuths", &directions(azimuths), Usage::STORAGE)?,
            &found,
        ];
        let runs = runs(facets.len(), azimuths, |first_azimuth| {
            let params = gpu.upload("tile", &[Params { first_azimuth, ..params }], Usage::UNIFORM)?;
            let bound: Vec<_> = std::iter::once(&params).chain(bound).map(wgpu::Buffer::as_entire_binding).collect();
            gpu.group("slices", &self.layout, &bound)
        })?;
        Ok(GpuHorizonMap { first: Some(first), pipeline, runs, elevations: found, azimuths })
    }

    /// The dispatch that puts the copies of triangles where cells have them: it is quicker than to upload these.
    fn placing(&self, gpu: &Gpu, grid: &PeriodicGrid, entries: &wgpu::Buffer) -> Result<Placing, GpuError> {
        use wgpu::BufferUsages as Usage;
        let (_, copies) = grid.all_entries();
        let rows: Vec<[u32; 2]> = copies.iter().map(|copy| copy.words()).collect();
        let bound = [
            &gpu.upload("tile", &[TileOf { size: grid.tile_size, copies: rows.len() as u32, pad: 0 }], Usage::UNIFORM)?,
            &gpu.upload("copies of triangles", &rows, Usage::STORAGE)?,
            &gpu.upload("triangles", bytemuck::cast_slice::<_, f32>(&grid.corners), Usage::STORAGE)?,
            entries,
        ];
        let group = gpu.group("triangles of cells", &self.to_place, &bound.map(wgpu::Buffer::as_entire_binding))?;
        let across = (rows.len() as u32).div_ceil(THREADS).clamp(1, MAX_GROUPS);
        let workgroups = [across, (rows.len() as u32).div_ceil(THREADS * across)];
        Ok((self.place.clone(), group, workgroups))
    }
}

#[cfg(test)]
#[path = "slices_tests.rs"]
pub(crate) mod tests;
