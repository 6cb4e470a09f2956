//! Horizons and slices of any mesh on wgpu: the twin of [`Slices::scan`](super::Slices::scan) and
//! [`Horizons::scan`](super::Horizons::scan), left on the device for whatever reads them there.
//!
//! A slice keeps four of the intervals that hang above its horizon; more come up in one of 400 slices of the densest pile of
//! rods that ships, and the highest two of those are one then.

use std::f32::consts::{FRAC_PI_2, TAU};

use bytemuck::{Pod, Zeroable};
use glam::{IVec2, Vec2, Vec3};

use super::PeriodicGrid;
use super::gpu_march::GpuHorizons;
use super::ray_cast::{LIFT, lifted_origins};
use super::scan::FACING_MARGIN;
use crate::directions::from_angles;
use crate::geometry::Facets;
use crate::gpu::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};

const THREADS: u32 = 64;

/// `KEPT` in `slice_scan.wgsl`, and the horizon.
const WORDS_A_SLICE: usize = 5;

/// Cells and triangles that a walk looks at, besides the cells of sixteen tiles: see `scan.rs`. Fewer than there, as a device
/// looks at one triangle at a time, and must not take long.
const LEAST_LOOKS: usize = 32_768;

/// `slice_scan.wgsl`, compiled: build once, use for any tile.
#[derive(Debug)]
pub struct GpuSlicer {
    layout: wgpu::BindGroupLayout,
    horizons: wgpu::ComputePipeline,
    slices: wgpu::ComputePipeline,
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
    a: Vec3,
    triangle: u32,
    b: Vec3,
    z_min: f32,
    c: Vec3,
    pad: u32,
}

impl GpuSlicer {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("slice_scan")?;
        let bindings = [UNIFORM, READ, READ, READ, READ, READ, WRITE];
        let layout = gpu.layout("slices", wgpu::ShaderStages::COMPUTE, &bindings)?;
        let pipeline = |hanging: bool| {
            gpu.compute_pipeline_with(&module, "scan", &[&layout], &[("HANGING", f64::from(u8::from(hanging)))])
        };
        Ok(Self { horizons: pipeline(false)?, slices: pipeline(true)?, layout })
    }

    /// Uploads a tile and its facets; `hanging`: what hangs above the horizons is to be told apart from what lies below.
    ///
    /// # Errors
    /// What the device refuses.
    pub fn slices(
        &self,
        gpu: &Gpu,
        grid: &PeriodicGrid,
        facets: &Facets,
        azimuths: usize,
        hanging: bool,
    ) -> Result<GpuHorizons, GpuError> {
        let words = if hanging { WORDS_A_SLICE } else { 1 };
        let pipeline = if hanging { &self.slices } else { &self.horizons };
        self.found_by(gpu, pipeline, words, (grid, facets, azimuths))
    }

    fn found_by(
        &self,
        gpu: &Gpu,
        pipeline: &wgpu::ComputePipeline,
        words: usize,
        (grid, facets, azimuths): (&PeriodicGrid, &Facets, usize),
    ) -> Result<GpuHorizons, GpuError> {
        use wgpu::BufferUsages as Usage;
        let cells = (grid.cells.x * grid.cells.y) as usize;
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
        };
        let (mut starts, mut discs, mut entries) = (vec![0_u32], Vec::new(), Vec::new());
        for cell in 0..cells {
            for &entry in grid.entries(cell) {
                let corners = grid.copy_corners(entry, IVec2::ZERO);
                discs.push(disc(&corners));
                let ([a, b, c], z_min) = (corners, corners.iter().fold(f32::INFINITY, |z, p| z.min(p.z)));
                entries.push(Entry { a, triangle: entry.triangle, b, z_min, c, pad: 0 });
            }
            starts.push(entries.len() as u32);
        }
        let origins = lifted_origins(facets, grid.tile_size);
        let places = (0..facets.len()).map(|s| Place {
            origin: origins[s],
            triangle: facets.triangles[s],
            normal: facets.normals[s],
            pad: 0,
        });
        let places: Vec<Place> = places.collect();
        // The CPU's own: see gpu_march.rs.
        let along = |azimuth: usize| from_angles(FRAC_PI_2, TAU * azimuth as f32 / azimuths as f32).truncate();
        let directions: Vec<Vec2> = (0..azimuths).map(along).collect();
        let bytes = (4 * words * facets.len() * azimuths) as u64;
        let found = gpu.buffer("slices", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        let bound = [
            &gpu.upload("tile", &[params], Usage::UNIFORM)?,
            &gpu.upload("cells", &starts, Usage::STORAGE)?,
            &gpu.upload("discs", &discs, Usage::STORAGE)?,
            &gpu.upload("triangles of cells", &entries, Usage::STORAGE)?,
            &gpu.upload("places of facets", &places, Usage::STORAGE)?,
            &gpu.upload("azimuths", &directions, Usage::STORAGE)?,
            &found,
        ];
        let group = gpu.group("slices", &self.layout, &bound.map(wgpu::Buffer::as_entire_binding))?;
        let workgroups = [params.facet_count.div_ceil(THREADS), params.azimuths];
        Ok(GpuHorizons { pipeline: pipeline.clone(), group, workgroups, elevations: found, azimuths })
    }
}

/// A circle around a triangle seen from above, a hair wider than it, and the triangle's highest point.
fn disc(corners: &[Vec3; 3]) -> [f32; 4] {
    let plane = corners.map(|corner| corner.truncate());
    let centre = 0.5 * (plane[0].min(plane[1]).min(plane[2]) + plane[0].max(plane[1]).max(plane[2]));
    let radius = plane.iter().fold(0.0_f32, |radius, corner| radius.max(corner.distance(centre)));
    let extent = plane.iter().fold(radius, |extent, corner| extent.max(corner.abs().max_element()));
    let top = corners.iter().fold(f32::NEG_INFINITY, |top, corner| top.max(corner.z));
    [centre.x, centre.y, radius + 1e-5 * extent, top]
}

#[cfg(test)]
#[path = "gpu_slices_tests.rs"]
pub(crate) mod tests;
