//! Tests that GPU and CPU compute the same slices of a tile.

use super::*;
use crate::geometry::TileMesh;
use crate::pipeline::Pipeline;
use crate::scene;
use crate::visibility::{HorizonMap, OcclusionIntervals};

fn open_gpu() -> Option<Gpu> {
    Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok()
}

fn tile(name: &str, facets: usize) -> (TileMesh, Facets) {
    let mesh = Pipeline::new().mesh(&scene::open(name, &[]).unwrap()).unwrap();
    let facets = Facets::sample(&mesh, facets, 1);
    (mesh, facets)
}

fn read(gpu: &Gpu, map: &GpuHorizonMap) -> Vec<u32> {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    assert!(map.runs() > 1);
    for run in 0..map.runs() {
        map.dispatch(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), run);
    }
    gpu.queue.submit([encoder.finish()]);
    gpu.read(&map.slopes).unwrap()
}

/// Returns the distance that 99 % of the values do not exceed.
fn percentile_99(mut off: Vec<f32>) -> f32 {
    off.sort_by(f32::total_cmp);
    off[off.len() * 99 / 100]
}

#[test]
fn gpu_and_cpu_compute_the_same_horizons_of_meshes_without_overhangs() {
    let Some(gpu) = open_gpu() else { return };
    let mut slicer = GpuSlicer::new(&gpu).unwrap();
    for (name, azimuths) in [("table4_teapot", 13), ("table4_cup", 8), ("fig5c_uneven", 11), ("fig8b_ripples", 10)] {
        let (mesh, facets) = tile(name, 300);
        let grid = PeriodicGrid::new(&mesh);
        let cpu = HorizonMap::scan(&grid, &facets, azimuths, 0.02);
        let map = slicer.prepare(&gpu, &grid, &facets, azimuths, false).unwrap();
        let gpu_slopes: Vec<f32> = read(&gpu, &map).into_iter().map(f32::from_bits).collect();
        let off = (0..gpu_slopes.len())
            .map(|k| [gpu_slopes[k], cpu.slope(k % azimuths, k / azimuths)].map(|slope| slope.max(0.0).atan()))
            .map(|[gpu, cpu]| (gpu - cpu).abs());
        let (within, blocked) = (percentile_99(off.collect()), gpu_slopes.iter().filter(|&&slope| slope > 0.0).count());
        eprintln!("{name}: 99 % within {within:.1e} rad; {blocked} of {} rise", gpu_slopes.len());
        assert!(blocked * 8 > gpu_slopes.len() && within < 1e-4, "{name}: {within}");
    }
}

#[test]
fn gpu_and_cpu_compute_the_same_intervals_of_meshes_with_overhangs() {
    let Some(gpu) = open_gpu() else { return };
    let mut slicer = GpuSlicer::new(&gpu).unwrap();
    let azimuths = 12;
    for name in ["table4_pillow", "table4_skirt", "fig6c_velvet_up"] {
        let (mesh, facets) = tile(name, 200);
        let grid = PeriodicGrid::new(&mesh);
        let cpu = OcclusionIntervals::scan(&grid, &facets, azimuths, 0.02);
        let (starts, intervals) = cpu.overhangs_by_facet();
        let map = slicer.prepare(&gpu, &grid, &facets, azimuths, true).unwrap();
        let words = read(&gpu, &map);
        let (mut off, mut differ, mut overhang_count) = (Vec::new(), 0, 0);
        for (slice, words) in words.chunks(WORDS_PER_SLICE).enumerate() {
            let expected_slope = cpu.horizon_map.slope(slice % azimuths, slice / azimuths);
            off.push((f32::from_bits(words[0]).atan() - expected_slope.atan()).abs());
            let expected = &intervals[starts[slice] as usize..starts[slice + 1] as usize];
            let found: Vec<(f32, f32)> = words[1..]
                .iter()
                .take_while(|&&word| word > 0)
                .map(|&word| [word & 0xffff, word >> 16].map(|end| (end as f32).atan2((65_535 - end) as f32)).into())
                .collect();
            overhang_count += expected.len();
            let is_same = expected.len() == found.len()
                && expected
                    .iter()
                    .zip(&found)
                    .all(|(a, b)| (a.0.atan() - b.0).abs() < 1e-3 && (a.1.atan() - b.1).abs() < 1e-3);
            differ += usize::from(!is_same);
        }
        let (within, slices) = (percentile_99(off), facets.len() * azimuths);
        eprintln!(
            "{name}: horizons within {within:.1e}; {overhang_count} intervals, {differ} of {slices} slices differ"
        );
        assert!(overhang_count * 25 > slices, "{name}: no overhangs");
        // Gaps of rounding size, and slices that graze an edge.
        assert!(within < 1e-4 && differ * 100 < slices, "{name}: {within}, {differ} of {slices}");
    }
}
