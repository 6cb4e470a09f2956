use glam::{UVec2, Vec2};

use super::*;
use crate::visibility::HorizonMap;

/// Returns heights of some waves with a little noise, and facets at irregular positions on them.
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
fn gpu_and_cpu_compute_the_same_horizons() {
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
        let map = march.horizon_map(&gpu, &grid, Vec2::ONE, &facets, azimuths).unwrap();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        assert!(map.runs() > 1);
        for run in 0..map.runs() {
            map.dispatch(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), run);
        }
        gpu.queue.submit([encoder.finish()]);
        let gpu_slopes: Vec<f32> = gpu.read(&map.slopes).unwrap();
        let mut off: Vec<f32> = (0..facets.len() * azimuths)
            .map(|k| [gpu_slopes[k], cpu.slope(k % azimuths, k / azimuths)].map(|slope| slope.max(0.0).atan()))
            .map(|[gpu, cpu]| (gpu - cpu).abs())
            .collect();
        off.sort_by(f32::total_cmp);
        let [most, worst] = [off[off.len() * 995 / 1000], off[off.len() - 1]];
        let free = gpu_slopes.iter().filter(|&&slope| slope < 0.0).count();
        eprintln!("{size}: 99.5 % within {most:.1e}, largest {worst:.1e} rad; {free} of {} free", gpu_slopes.len());
        assert!(free < gpu_slopes.len() / 2, "something blocks");
        // Slopes come from the same crossings. The slope of a crossing within rounding of the facet is a quotient
        // of two small numbers, or only one side counts it.
        assert!(most < 1e-5 && worst < 0.1, "{size}: 99.5 % within {most}, largest {worst}");
    }
}
