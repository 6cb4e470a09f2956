//! Table of errors by resolution. The command to print it.

use std::time::Instant;

use super::*;

#[test]
#[ignore = "a measurement: cargo bench --bench measure -- map-resolution"]
fn resolution_against_error() {
    if std::env::var_os("BISCALE_TABLE").is_none() {
        eprintln!("SKIPPED: several minutes without BISCALE_TABLE=1");
        return;
    }
    let directions = polar_directions(18, 24, 85.0);
    let bands = [(0.0, 60.0), (60.0, 80.0), (80.0, 85.0)];
    println!(
        "{:<10} {:>9} {:>5} | {:>7} | {:>7} {:>7} {:>7} | {:>8} {:>8}",
        "tile", "triangles", "res", "all %", "<60", "60-80", "80-85", "ms/dir", "Mtri/s"
    );
    for (name, mesh) in [
        ("egg-crate", meshes::egg_crate(128)),
        ("dunes", meshes::dunes(128)),
        ("V-grooves", meshes::v_grooves()),
        ("rods", meshes::rods()),
        ("pillar", meshes::pillar()),
    ] {
        let facets = sample(&mesh, 4000);
        let exact = RayCaster::new(&mesh, if mesh.triangles.len() > 10_000 { 128 } else { 32 })
            .visibility(&facets, &directions);
        for resolution in [128, 256, 512, 1024, 2048] {
            let start = Instant::now();
            let maps = visibility_maps_cpu(&mesh, &facets, &directions, resolution);
            let seconds = start.elapsed().as_secs_f64();
            let error_percent = |is_in_band: &dyn Fn(f32) -> bool| {
                let (mut differ, mut all) = (0.0, 0.0);
                for (d, &w) in directions.iter().enumerate().filter(|(_, w)| is_in_band(w.z.acos().to_degrees())) {
                    for s in 0..facets.len() {
                        let weight = f64::from(facets.geometric_normals[s].dot(w).max(0.0));
                        all += weight;
                        differ += weight * f64::from(maps.is_visible(d, s) != exact.is_visible(d, s));
                    }
                }
                100.0 * differ / all
            };
            let [a, b, c] = bands.map(|(lo, hi)| error_percent(&|theta| theta >= lo && theta < hi));
            let all = 100.0 * disagreement(&facets, &directions, &maps, &exact);
            let per_direction = seconds / directions.len() as f64;
            println!(
                "{name:<10} {:>9} {resolution:>5} | {all:>7.3} | {a:>7.3} {b:>7.3} {c:>7.3} | {:>8.3} {:>8.2}",
                mesh.triangles.len(),
                1e3 * per_direction,
                1e-6 * mesh.triangles.len() as f64 / per_direction
            );
        }
        let worst =
            (0..directions.len()).map(|d| (projected_area_ratio(&mesh, &facets, directions[d], d, &exact) - 1.0).abs());
        println!(
            "{name}: exact a_v / (A cos θ) is off by at most {:.2} % with these facets",
            100.0 * worst.fold(0.0, f64::max)
        );
    }
}
