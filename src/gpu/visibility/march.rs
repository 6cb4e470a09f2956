//! HorizonMap of a height-field on wgpu: the twin of [`HorizonMap::march`](crate::visibility::HorizonMap::march), left on the device for
//! whatever reads horizons there (`shaders/visibility_horizons.wgsl`).

use std::f32::consts::{FRAC_PI_2, TAU};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::geometry::{Facets, HeightGrid};
use crate::gpu::device::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};
use crate::math::directions::from_angles;
use crate::visibility::scan::FACING_MARGIN;

pub(super) const THREADS: u32 = 64;

/// `height_march.wgsl`, compiled: build once, use for any tile.
#[derive(Debug)]
pub struct GpuHeightMarch {
    layout: wgpu::BindGroupLayout,
    march: wgpu::ComputePipeline,
}

/// A dispatch and its workgroups.
pub(super) type Placing = (wgpu::ComputePipeline, wgpu::BindGroup, [u32; 2]);

/// HorizonMap, or slices, that a submission is to make.
#[derive(Debug)]
pub struct GpuHorizonMap {
    /// What the runs read and is made before the first.
    pub(super) first: Option<Placing>,
    pub(super) pipeline: wgpu::ComputePipeline,
    /// With facets' workgroups and azimuths of each.
    pub(super) runs: Vec<(wgpu::BindGroup, [u32; 2])>,
    /// Elevations [rad], the azimuths of a facet side by side, or what `visibility_hanging.wgsl` reads; zeros until it is made.
    pub elevations: wgpu::Buffer,
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
struct Place {
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

    /// Uploads the height-field and its facets.
    ///
    /// # Errors
    /// What the device refuses.
    pub fn horizons(
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
        let places = facets.positions.iter().zip(&facets.normals);
        let places: Vec<Place> =
            places.map(|(&position, &normal)| Place { position, pad_p: 0, normal, pad_n: 0 }).collect();
        let elevations =
            gpu.buffer("horizons", (4 * facets.len() * azimuths) as u64, Usage::STORAGE | Usage::COPY_SRC)?;
        let bound = [
            &gpu.upload("heights", &heights.heights, Usage::STORAGE)?,
            &gpu.upload("places of facets", &places, Usage::STORAGE)?,
            &elevations,
            &gpu.upload("azimuths", &directions(azimuths), Usage::STORAGE)?,
        ];
        let runs = runs(facets.len(), azimuths, |first_azimuth| {
            let params = gpu.upload("height-field", &[Params { first_azimuth, ..params }], Usage::UNIFORM)?;
            let bound: Vec<_> = std::iter::once(&params).chain(bound).map(wgpu::Buffer::as_entire_binding).collect();
            gpu.group("height-field", &self.layout, &bound)
        })?;
        Ok(GpuHorizonMap { first: None, pipeline: self.march.clone(), runs, elevations, azimuths })
    }
}

/// Unit vectors of the plane along so many azimuths, the CPU's own: built-in sines and cosines may be off by 2⁻¹¹, and an axis
/// would be missed.
pub(super) fn directions(azimuths: usize) -> Vec<glam::Vec2> {
    let along = |azimuth: usize| from_angles(FRAC_PI_2, TAU * azimuth as f32 / azimuths as f32).truncate();
    (0..azimuths).map(along).collect()
}

/// Walks of one dispatch; few in tests, so that all take several.
const WALKS: usize = if cfg!(test) { 1 << 10 } else { 1 << 21 };

/// What a walk counts for beside lobes: as many edges, or cells and triangles, where a tile is dense.
const LOBES_A_WALK: u64 = 512;

/// Runs of azimuths for one dispatch each: the group that begins with an azimuth, its workgroups and how many azimuths.
pub(super) fn runs(
    facets: usize,
    azimuths: usize,
    group: impl Fn(u32) -> Result<wgpu::BindGroup, GpuError>,
) -> Result<Vec<(wgpu::BindGroup, [u32; 2])>, GpuError> {
    let together = (WALKS / facets.max(1)).max(1);
    let run = |first: usize| {
        let count = together.min(azimuths - first) as u32;
        Ok((group(first as u32)?, [(facets as u32).div_ceil(THREADS), count]))
    };
    (0..azimuths).step_by(together).map(run).collect()
}

impl GpuHorizonMap {
    /// Dispatches that make it.
    pub fn runs(&self) -> usize {
        self.runs.len()
    }

    /// What one of them takes, in lobes.
    pub fn work(&self, run: usize) -> u64 {
        let [groups, azimuths] = self.runs[run].1.map(u64::from);
        groups * u64::from(THREADS) * azimuths * LOBES_A_WALK
    }

    /// Encodes one of them, in order.
    pub fn dispatch(&self, pass: &mut wgpu::ComputePass, run: usize) {
        if let (0, Some((pipeline, group, [columns, rows]))) = (run, &self.first) {
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

/// Edges that a walk of `height_march.wgsl` crosses on average.
#[cfg(test)]
pub(crate) fn crossings(
    gpu: &Gpu,
    (heights, tile_size, facets): (&HeightGrid, glam::Vec2, &Facets),
    azimuths: usize,
) -> f64 {
    let mut march = GpuHeightMarch::new(gpu).unwrap();
    let module = gpu.module("height_march").unwrap();
    march.march = gpu.compute_pipeline_with(&module, "march", &[&march.layout], &[("COUNTING", 1.0)]).unwrap();
    let made = march.horizons(gpu, heights, tile_size, facets, azimuths).unwrap();
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    for run in 0..made.runs() {
        made.dispatch(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), run);
    }
    gpu.queue.submit([encoder.finish()]);
    let counts: Vec<f32> = gpu.read(&made.elevations).unwrap();
    counts.iter().map(|&count| f64::from(count)).sum::<f64>() / counts.len() as f64
}

#[cfg(test)]
mod tests {
    use glam::{UVec2, Vec2};

    use super::*;
    use crate::visibility::HorizonMap;

    /// Heights of some waves and a little noise, and facets at odd places on them.
    fn field(size: UVec2, relief: f32) -> (HeightGrid, Facets) {
        let noise = |k: u32| (k.wrapping_mul(2_654_435_761) >> 8) as f32 / 16_777_216.0;
        let heights = (0..size.x * size.y).map(|k| {
            let (x, y) = ((k % size.x) as f32 / size.x as f32, (k / size.x) as f32 / size.y as f32);
            relief * ((6.3 * x).sin() * (12.6 * y).cos() + 0.3 * noise(k))
        });
        let grid = HeightGrid { size, heights: heights.collect() };
        let mut facets = Facets::default();
        for k in 0..200 {
            let (x, y) = (noise(3 * k), noise(7 * k + 1));
            let column = (x * size.x as f32) as usize % size.x as usize;
            let row = (y * size.y as f32) as usize % size.y as usize;
            let z = grid.heights[row * size.x as usize + column];
            facets.positions.push(Vec3::new(x, y, z + 0.01 * noise(k + 5)));
            facets.normals.push(Vec3::new(noise(k) - 0.5, noise(k + 9) - 0.5, 1.0).normalize());
            facets.geometric_normals.push(Vec3::Z);
            facets.areas.push(1.0);
            facets.colors.push(Vec3::ONE);
            facets.slots.push(0);
        }
        (grid, facets)
    }

    #[test]
    fn both_routes_see_the_same_horizons() {
        let gpu = match Gpu::open() {
            Ok(gpu) => gpu,
            Err(error) => return eprintln!("SKIPPED: {error}"),
        };
        let march = GpuHeightMarch::new(&gpu).unwrap();
        for (size, relief, azimuths) in
            [(UVec2::new(64, 64), 0.1, 48), (UVec2::new(37, 90), 0.3, 24), (UVec2::new(1, 200), 0.2, 10)]
        {
            let (grid, facets) = field(size, relief);
            let cpu = HorizonMap::march(&grid, Vec2::ONE, &facets, azimuths, 0.02);
            let made = march.horizons(&gpu, &grid, Vec2::ONE, &facets, azimuths).unwrap();
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            assert!(made.runs() > 1);
            for run in 0..made.runs() {
                made.dispatch(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), run);
            }
            gpu.queue.submit([encoder.finish()]);
            let device: Vec<f32> = gpu.read(&made.elevations).unwrap();
            let mut off: Vec<f32> = (0..facets.len() * azimuths)
                .map(|k| (device[k] - cpu.elevation(k % azimuths, k / azimuths)).abs())
                .collect();
            off.sort_by(f32::total_cmp);
            let [most, worst] = [off[off.len() * 995 / 1000], off[off.len() - 1]];
            let free = device.iter().filter(|&&elevation| elevation < 0.0).count();
            eprintln!("{size}: 99.5 % within {most:.1e}, largest {worst:.1e} rad; {free} of {} free", device.len());
            assert!(free < device.len() / 2, "something blocks");
            // Slopes come from the same crossings. One that lies within rounding of the facet is a quotient of two small
            // numbers, or counts on one route only.
            assert!(most < 1e-5 && worst < 0.1, "{size}: 99.5 % within {most}, largest {worst}");
        }
    }
}
