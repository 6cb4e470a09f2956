//! Both routes cut a tile alike.

use super::*;
use crate::geometry::TileMesh;
use crate::pipeline::Pipeline;
use crate::plan::{Preset, Settings};
use crate::scene;
use crate::visibility::shadow_view::{ShadowView, affordable, extent};
use crate::visibility::{HorizonMap, OcclusionIntervals};

fn open_gpu() -> Option<Gpu> {
    Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok()
}

fn tile(name: &str, facets: usize) -> (TileMesh, Facets) {
    let mesh = Pipeline::new().mesh(&scene::open(name, &[]).unwrap()).unwrap();
    let facets = Facets::sample(&mesh, facets, 1);
    (mesh, facets)
}

fn read(gpu: &Gpu, made: &GpuHorizonMap) -> Vec<u32> {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    assert!(made.runs() > 1);
    for run in 0..made.runs() {
        made.dispatch(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), run);
    }
    gpu.queue.submit([encoder.finish()]);
    gpu.read(&made.elevations).unwrap()
}

/// The distance that 99 % of the numbers stay within.
fn most(mut off: Vec<f32>) -> f32 {
    off.sort_by(f32::total_cmp);
    off[off.len() * 99 / 100]
}

#[test]
fn both_routes_find_the_same_horizons_of_meshes_without_overhangs() {
    let Some(gpu) = open_gpu() else { return };
    let mut slicer = GpuSlicer::new(&gpu).unwrap();
    for (name, azimuths) in [("table4_teapot", 13), ("table4_cup", 8), ("fig5c_uneven", 11), ("fig8b_ripples", 10)] {
        let (mesh, facets) = tile(name, 300);
        let grid = PeriodicGrid::new(&mesh);
        let cpu = HorizonMap::scan(&grid, &facets, azimuths, 0.02);
        let made = slicer.slices(&gpu, &grid, &facets, azimuths, false).unwrap();
        let device: Vec<f32> = read(&gpu, &made).into_iter().map(f32::from_bits).collect();
        let off = (0..device.len()).map(|k| (device[k] - cpu.elevation(k % azimuths, k / azimuths)).abs());
        let (within, blocked) = (most(off.collect()), device.iter().filter(|&&elevation| elevation > 0.0).count());
        eprintln!("{name}: 99 % within {within:.1e} rad; {blocked} of {} rise", device.len());
        assert!(blocked * 8 > device.len() && within < 1e-4, "{name}: {within}");
    }
}

#[test]
fn both_routes_find_the_same_intervals_under_overhangs() {
    let Some(gpu) = open_gpu() else { return };
    let mut slicer = GpuSlicer::new(&gpu).unwrap();
    let azimuths = 12;
    for name in ["table4_pillow", "table4_skirt", "fig6c_velvet_up"] {
        let (mesh, facets) = tile(name, 200);
        let grid = PeriodicGrid::new(&mesh);
        let cpu = OcclusionIntervals::scan(&grid, &facets, azimuths, 0.02);
        let (starts, intervals) = cpu.hanging_by_facet();
        let made = slicer.slices(&gpu, &grid, &facets, azimuths, true).unwrap();
        let words = read(&gpu, &made);
        let (mut off, mut differ, mut hanging) = (Vec::new(), 0, 0);
        for (slice, words) in words.chunks(WORDS_A_SLICE).enumerate() {
            off.push((f32::from_bits(words[0]) - cpu.horizons.elevation(slice % azimuths, slice / azimuths)).abs());
            let expected = &intervals[starts[slice] as usize..starts[slice + 1] as usize];
            let found: Vec<(f32, f32)> = words[1..]
                .iter()
                .take_while(|&&word| word > 0)
                .map(|&word| [word & 0xffff, word >> 16].map(|end| end as f32 * 1.590_796_3 / 65_535.0).into())
                .collect();
            hanging += expected.len();
            let is_same = expected.len() == found.len()
                && expected.iter().zip(&found).all(|(a, b)| (a.0 - b.0).abs() < 1e-3 && (a.1 - b.1).abs() < 1e-3);
            differ += usize::from(!is_same);
        }
        let (within, slices) = (most(off), facets.len() * azimuths);
        eprintln!("{name}: horizons within {within:.1e}; {hanging} intervals, {differ} of {slices} slices differ");
        assert!(hanging * 10 > slices, "{name}: something hangs");
        // Gaps of rounding size, and slices that graze an edge.
        assert!(within < 1e-4 && differ * 100 < slices, "{name}: {within}, {differ} of {slices}");
    }
}

/// Cells and triangles that a slice looks at on average, and triangles that it cuts.
pub(crate) fn looks(gpu: &Gpu, grid: &PeriodicGrid, facets: &Facets, azimuths: usize, overhangs: bool) -> [f64; 2] {
    let slicer = GpuSlicer::new(gpu).unwrap();
    let constants = [("COUNTING", 1.0), ("HANGING", f64::from(u8::from(overhangs)))];
    let counting = gpu.compute_pipeline_with(&slicer.module, "scan", &[&slicer.layout], &constants).unwrap();
    let made = slicer.found_by(gpu, counting, 1, (grid, facets, azimuths)).unwrap();
    let found = read(gpu, &made);
    let mean = |of: fn(u32) -> u32| found.iter().map(|&both| f64::from(of(both))).sum::<f64>() / found.len() as f64;
    [mean(|both| both & 0xf_ffff), mean(|both| both >> 20)]
}

/// Texels of all maps of `fine` that a tile's triangles cover together.
fn covered(mesh: &TileMesh) -> f64 {
    let settings = Settings::of_preset(Preset::Fine);
    let (extent, resolution) = (extent(mesh), affordable(mesh, settings.map_resolution));
    let of_view = |direction: &Vec3| {
        let view = ShadowView::new(mesh.size, extent, *direction, resolution).unwrap();
        let twice = |triangle: usize| {
            let [a, b, c] = mesh.corners(triangle).map(|corner| view.texel(corner));
            f64::from((b - a).perp_dot(c - a).abs())
        };
        0.5 * (0..mesh.triangles.len()).map(twice).sum::<f64>()
    };
    settings.map_grid.directions().par_iter().map(of_view).sum()
}

/// Figures of docs/speed.md.
#[test]
#[ignore = "a table to be printed: cargo test --release --lib looks_of_slices -- --ignored --nocapture"]
fn looks_of_slices() {
    let Some(gpu) = open_gpu() else { return };
    println!("scene                 cells  looks a slice  cuts  more than four hang  texels of maps at fine");
    for name in
        ["table4_pillow", "table4_skirt", "fig6a_velvet_spread", "fig6c_velvet_up", "table4_teapot", "table4_cup"]
    {
        let (mesh, facets) = tile(name, 1024);
        let of = OcclusionIntervals::scan(&PeriodicGrid::for_slices(&mesh), &facets, 24, 0.02);
        let (starts, _) = of.hanging_by_facet();
        let many = starts.windows(2).filter(|ends| ends[1] - ends[0] > 4).count();
        let many = 100.0 * many as f64 / (starts.len() - 1) as f64;
        for grid in [PeriodicGrid::new(&mesh), PeriodicGrid::for_slices(&mesh)] {
            let [looks, cuts] = looks(&gpu, &grid, &facets, 24, true);
            let cells = grid.cells.x * grid.cells.y;
            println!("{name:<20} {cells:>6} {looks:>14.1} {cuts:>5.1} {many:>18.2} % {:>23.1e}", covered(&mesh));
        }
    }
}
