//! Shadow maps, on both routes, against exact ray casting.

use glam::{Vec2, Vec3};

use super::{PackedVisibility, visibility_maps_cpu};
use crate::base::Cancel;
use crate::geometry::{Facets, TileMesh};
use crate::gpu::Gpu;
use crate::gpu::{GpuShadowMaps, visibility_maps_gpu};

mod meshes;
mod rays;
mod tables;

use rays::RayCaster;

/// n samples of the mesh: systematic over the area, an R2 point in each triangle.
fn sample(mesh: &TileMesh, n: usize) -> Facets {
    let areas: Vec<f64> = (0..mesh.triangles.len()).map(|k| mesh.triangle_area(k)).collect();
    let total: f64 = areas.iter().sum();
    let (mut facets, mut triangle, mut before) = (Facets::default(), 0, 0.0);
    for k in 0..n {
        let target = (k as f64 + 0.5) / n as f64 * total;
        while before + areas[triangle] < target {
            before += areas[triangle];
            triangle += 1;
        }
        let (u, v) = ((0.5 + 0.754_877_67 * k as f64).fract(), (0.5 + 0.569_840_29 * k as f64).fract());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let [a, b, c] = mesh.corners(triangle);
        let p = a + u as f32 * (b - a) + v as f32 * (c - a);
        facets.positions.push(Vec3::new(p.x.rem_euclid(mesh.size.x), p.y.rem_euclid(mesh.size.y), p.z));
        let normal = mesh.geometric_normal(triangle);
        facets.normals.push(normal);
        facets.geometric_normals.push(normal);
        facets.areas.push((total / n as f64) as f32);
        facets.triangles.push(triangle as u32);
    }
    facets
}

/// Directions of a polar grid, `θ = (a + ½) 90° / rings`, up to a zenith angle.
fn polar_directions(rings: usize, azimuths: usize, up_to_deg: f32) -> Vec<Vec3> {
    let thetas = (0..rings).map(|a| (a as f32 + 0.5) * 90.0 / rings as f32).filter(|&theta| theta <= up_to_deg);
    thetas
        .flat_map(|theta| (0..azimuths).map(move |b| direction(theta, 360.0 * (b as f32 + 0.37) / azimuths as f32)))
        .collect()
}

fn direction(theta_deg: f32, phi_deg: f32) -> Vec3 {
    let (theta, phi) = (theta_deg.to_radians(), phi_deg.to_radians());
    Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

/// Cosine-weighted share of the facet-direction pairs that face each other in which two routes disagree.
fn disagreement(facets: &Facets, directions: &[Vec3], a: &PackedVisibility, b: &PackedVisibility) -> f64 {
    let (mut differ, mut all) = (0.0, 0.0);
    for (d, &w) in directions.iter().enumerate() {
        for s in 0..facets.len() {
            let weight = f64::from(facets.geometric_normals[s].dot(w).max(0.0) * facets.areas[s]);
            all += weight;
            differ += weight * f64::from(a.is_visible(d, s) != b.is_visible(d, s));
        }
    }
    differ / all
}

/// `a_v(ω) / (A cos θ)` of one direction.
fn projected_area_ratio(mesh: &TileMesh, facets: &Facets, w: Vec3, d: usize, v: &PackedVisibility) -> f64 {
    let seen = (0..facets.len()).filter(|&s| v.is_visible(d, s));
    let area: f64 = seen.map(|s| f64::from(facets.geometric_normals[s].dot(w).max(0.0) * facets.areas[s])).sum();
    area / f64::from(mesh.base_area() * w.z)
}

#[test]
fn maps_agree_with_exact_rays_within_three_in_a_thousand_up_to_85_degrees() {
    let directions = polar_directions(9, 5, 85.0);
    for (name, mesh, resolution) in all_meshes() {
        let facets = sample(&mesh, 1200);
        let exact = RayCaster::new(&mesh, 32).visibility(&facets, &directions);
        let maps = visibility_maps_cpu(&mesh, &facets, &directions, resolution);
        let error = disagreement(&facets, &directions, &maps, &exact);
        assert!(error < 3e-3, "{name}: {:.3} %", 100.0 * error);
    }
}

#[test]
fn the_gpu_answers_as_the_cpu_does() {
    let Some(gpu) = open_gpu() else { return };
    let pipelines = GpuShadowMaps::new(&gpu).unwrap();
    let mut directions = polar_directions(9, 5, 85.0);
    directions.extend([direction(89.9, 40.0), Vec3::X, Vec3::NEG_Z, Vec3::NAN, Vec3::Z]);
    for (name, mesh, _) in all_meshes() {
        let facets = sample(&mesh, 1201);
        let cpu = visibility_maps_cpu(&mesh, &facets, &directions, 128);
        let gpu = pipelines.visibility(&gpu, &mesh, &facets, &directions, 128, &Cancel::default()).unwrap();
        let differ = disagreement(&facets, &directions[..45], &gpu, &cpu);
        // Texels whose centre lies on an edge up to rounding, and ties in height.
        assert!(differ < 3e-4, "{name}: {:.4} %", 100.0 * differ);
        assert!(gpu.row(46).iter().chain(gpu.row(47)).chain(gpu.row(48)).all(|&word| word == 0), "{name}");
    }
}

#[test]
fn projected_area_is_base_area_times_cosine_up_to_grazing() {
    let mesh = meshes::egg_crate(64);
    let facets = sample(&mesh, 40_000);
    for (theta, tolerance) in [(0.0, 0.002), (45.0, 0.003), (75.0, 0.005), (85.0, 0.01), (89.0, 0.05)] {
        let directions: Vec<Vec3> = (0..4).map(|k| direction(theta, 13.0 + 90.0 * k as f32 / 4.0)).collect();
        let maps = visibility_maps_cpu(&mesh, &facets, &directions, 512);
        for (d, &w) in directions.iter().enumerate() {
            let ratio = projected_area_ratio(&mesh, &facets, w, d, &maps);
            assert!((ratio - 1.0).abs() < tolerance, "{theta}°, {d}: {ratio}");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mesh = meshes::rods();
    let (facets, directions) = (sample(&mesh, 500), polar_directions(5, 6, 90.0));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| visibility_maps_cpu(&mesh, &facets, &directions, 100))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn broken_meshes_and_no_facets_do_not_panic() {
    let directions = polar_directions(3, 3, 90.0);
    let whole = meshes::pillar();
    let facets = sample(&whole, 10);
    let mut broken = whole.clone();
    broken.positions[3] = Vec3::new(f32::NAN, 0.0, f32::INFINITY);
    broken.positions[9] = Vec3::new(-3.0, 5.0, -2.0);
    assert_eq!(visibility_maps_cpu(&broken, &facets, &directions, 50).direction_count, 9);
    let empty = TileMesh { size: Vec2::ONE, ..TileMesh::default() };
    assert_eq!(visibility_maps_cpu(&empty, &Facets::default(), &directions, 50).facet_count, 0);
    assert!(visibility_maps_cpu(&empty, &facets, &[Vec3::Z], 50).is_visible(0, 0));
    let Some(gpu) = open_gpu() else { return };
    visibility_maps_gpu(&gpu, &broken, &facets, &directions, 50, &Cancel::default()).unwrap();
    assert!(visibility_maps_gpu(&gpu, &empty, &facets, &[Vec3::Z], 50, &Cancel::default()).unwrap().is_visible(0, 0));
}

/// The device, or a loud word that its tests are skipped.
fn open_gpu() -> Option<Gpu> {
    Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok()
}

fn all_meshes() -> [(&'static str, TileMesh, u32); 5] {
    [
        ("egg-crate", meshes::egg_crate(64), 256),
        ("dunes", meshes::dunes(64), 256),
        ("V-grooves", meshes::v_grooves(), 256),
        ("rods", meshes::rods(), 512),
        ("pillar", meshes::pillar(), 256),
    ]
}
