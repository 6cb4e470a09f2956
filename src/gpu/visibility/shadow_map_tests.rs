//! Tests of the GPU shadow maps against their CPU twin.

use std::time::Instant;

use glam::{Vec2, Vec3};

use super::{GpuShadowMaps, visibility_maps_gpu};
use crate::base::Cancel;
use crate::geometry::{Facets, TileMesh};
use crate::gpu::Gpu;
use crate::visibility::shadow_map_tests::{all_meshes, direction, disagreement, meshes, polar_directions, sample};
use crate::visibility::{PackedVisibility, visibility_maps_cpu};

#[test]
fn the_gpu_computes_the_same_visibility_as_the_cpu() {
    let Some(gpu) = open_gpu() else { return };
    let pipelines = GpuShadowMaps::new(&gpu).unwrap();
    let mut directions = polar_directions(9, 5, 85.0);
    directions.extend([direction(89.9, 40.0), Vec3::X, Vec3::NEG_Z, Vec3::NAN, Vec3::Z]);
    for (name, mesh, _) in all_meshes() {
        let facets = sample(&mesh, 1201);
        let cpu = visibility_maps_cpu(&mesh, &facets, &directions, 128);
        let gpu = pipelines.visibility(&gpu, &mesh, &facets, &directions, 128, &Cancel::default()).unwrap();
        let differ = disagreement(&facets, &directions[..45], &gpu, &cpu);
        // Texels with their centre on an edge up to rounding, and ties in height.
        assert!(differ < 3e-4, "{name}: {:.4} %", 100.0 * differ);
        assert!(gpu.row(46).iter().chain(gpu.row(47)).chain(gpu.row(48)).all(|&word| word == 0), "{name}");
    }
}

#[test]
fn broken_meshes_and_no_facets_do_not_panic_on_the_gpu() {
    let directions = polar_directions(3, 3, 90.0);
    let facets = sample(&meshes::pillar(), 10);
    let broken = meshes::broken_pillar();
    let empty = TileMesh { size: Vec2::ONE, ..TileMesh::default() };
    let Some(gpu) = open_gpu() else { return };
    let maps = |mesh: &TileMesh, facets: &Facets, directions: &[Vec3]| {
        visibility_maps_gpu(&gpu, mesh, facets, directions, 50, &Cancel::default()).unwrap()
    };
    maps(&broken, &facets, &directions);
    assert!(maps(&empty, &facets, &[Vec3::Z]).is_visible(0, 0));
}

/// Prints the speed of the CPU and of the GPU.
#[test]
#[ignore = "a measurement: cargo bench --bench measure -- map-speed"]
fn speed_of_the_cpu_and_of_the_gpu() {
    if std::env::var_os("BISCALE_TABLE").is_none() {
        eprintln!("SKIPPED: several minutes without BISCALE_TABLE=1");
        return;
    }
    let Some(gpu) = open_gpu() else { return };
    println!("{}, tier {:?}", gpu.description(), gpu.tier);
    let pipelines = GpuShadowMaps::new(&gpu).unwrap();
    let directions = polar_directions(9, 32, 85.0);
    for (name, mesh) in
        [("egg-crate 128", meshes::egg_crate(128)), ("rods", meshes::rods()), ("V-grooves", meshes::v_grooves())]
    {
        let facets = sample(&mesh, 8000);
        for resolution in [256, 512, 1024] {
            let cpu = median_seconds(&|| visibility_maps_cpu(&mesh, &facets, &directions, resolution));
            let on_gpu = median_seconds(&|| {
                pipelines.visibility(&gpu, &mesh, &facets, &directions, resolution, &Cancel::default()).unwrap()
            });
            let triangles = 1e-6 * (mesh.triangles.len() * directions.len()) as f64;
            let pairs = 1e-6 * (facets.len() * directions.len()) as f64;
            for (processor, seconds) in [("cpu", cpu), ("gpu", on_gpu)] {
                println!(
                    "{name:<14} {resolution:>5} {processor}: {:>8.2} ms/direction, {:>8.3} Mtriangles/s, {:>7.2} M facet-direction pairs/s",
                    1e3 * seconds / directions.len() as f64,
                    triangles / seconds,
                    pairs / seconds
                );
            }
        }
    }
}

/// Median time of three runs, after one that is not timed.
fn median_seconds(run: &dyn Fn() -> PackedVisibility) -> f64 {
    run();
    let mut times: Vec<f64> = (0..3)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[1]
}

/// Opens the GPU, or prints that the tests are skipped.
fn open_gpu() -> Option<Gpu> {
    Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok()
}
