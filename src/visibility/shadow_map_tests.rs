//! Tests of the CPU shadow maps against exact ray casting, and inputs for the tests of the GPU shadow maps.

use glam::{Vec2, Vec3};

use super::{PackedVisibility, visibility_maps_cpu};
use crate::geometry::{Facets, TileMesh};

pub(crate) mod meshes;
mod rays;
mod tables;

use rays::RayCaster;

/// Samples `n` facets of the mesh, systematically over the area, at R2 points in the triangles.
pub(crate) fn sample(mesh: &TileMesh, n: usize) -> Facets {
    let areas: Vec<f64> = (0..mesh.triangles.len()).map(|k| mesh.triangle_area(k)).collect();
    let total: f64 = areas.iter().sum();
    let (mut facets, mut triangle, mut area_before) = (Facets::default(), 0, 0.0);
    for k in 0..n {
        let target = (k as f64 + 0.5) / n as f64 * total;
        while area_before + areas[triangle] < target {
            area_before += areas[triangle];
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
pub(crate) fn polar_directions(rings: usize, azimuths: usize, up_to_deg: f32) -> Vec<Vec3> {
    let thetas = (0..rings).map(|a| (a as f32 + 0.5) * 90.0 / rings as f32).filter(|&theta| theta <= up_to_deg);
    thetas
        .flat_map(|theta| (0..azimuths).map(move |b| direction(theta, 360.0 * (b as f32 + 0.37) / azimuths as f32)))
        .collect()
}

pub(crate) fn direction(theta_deg: f32, phi_deg: f32) -> Vec3 {
    let (theta, phi) = (theta_deg.to_radians(), phi_deg.to_radians());
    Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

/// Cosine-weighted fraction of the facing facet-direction pairs in which two visibilities differ.
pub(crate) fn disagreement(facets: &Facets, directions: &[Vec3], a: &PackedVisibility, b: &PackedVisibility) -> f64 {
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
    let visible = (0..facets.len()).filter(|&s| v.is_visible(d, s));
    let area: f64 = visible.map(|s| f64::from(facets.geometric_normals[s].dot(w).max(0.0) * facets.areas[s])).sum();
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
    let maps_with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| visibility_maps_cpu(&mesh, &facets, &directions, 100))
    };
    assert_eq!(maps_with(1), maps_with(3));
}

#[test]
fn broken_meshes_and_no_facets_do_not_panic() {
    let directions = polar_directions(3, 3, 90.0);
    let facets = sample(&meshes::pillar(), 10);
    let broken = meshes::broken_pillar();
    assert_eq!(visibility_maps_cpu(&broken, &facets, &directions, 50).direction_count, 9);
    let empty = TileMesh { size: Vec2::ONE, ..TileMesh::default() };
    assert_eq!(visibility_maps_cpu(&empty, &Facets::default(), &directions, 50).facet_count, 0);
    assert!(visibility_maps_cpu(&empty, &facets, &[Vec3::Z], 50).is_visible(0, 0));
}

/// Name, mesh and shadow map resolution of each tile of the tests.
pub(crate) fn all_meshes() -> [(&'static str, TileMesh, u32); 5] {
    [
        ("egg-crate", meshes::egg_crate(64), 256),
        ("dunes", meshes::dunes(64), 256),
        ("V-grooves", meshes::v_grooves(), 256),
        ("rods", meshes::rods(), 512),
        ("pillar", meshes::pillar(), 256),
    ]
}
