//! Tests of mirror planes on tiles with known planes, and of the fast exclusion of candidates.

use std::f32::consts::TAU;

use glam::UVec2;

use super::*;
use crate::geometry::build;
use crate::geometry::families::heightfield;

fn mesh_of(toml: &str) -> TileMesh {
    let scene = crate::scene::parse(&format!("[tile]\ngeometry = {toml}\n")).unwrap();
    build(&scene.tile, std::path::Path::new("")).unwrap()
}

#[test]
fn grooves_and_waves_have_the_expected_mirror_planes() {
    let v = r#"{ kind = "grooves", profile = "v", count = 3, depth = 0.1, side_angle_deg = 40, rotation_deg = 0 }"#;
    assert_eq!(mirror_planes(&mesh_of(v)), [true, true]);
    let size = Vec2::ONE;
    let crooked = |at: Vec2| 0.1 * (TAU * (at.x + at.y)).cos() + 0.03 * (2.0 * TAU * at.x + 0.7).sin();
    let mesh = heightfield::from_function(UVec2::splat(32), size, crooked);
    assert_eq!(mirror_planes(&mesh), [false, false]);
    // A sawtooth along x that is constant along y.
    let mesh = heightfield::from_function(UVec2::splat(32), size, |at| 0.1 * at.x);
    assert_eq!(mirror_planes(&mesh), [false, true]);
}

#[test]
fn a_plain_weave_has_both_mirror_planes_and_a_twill_has_not() {
    assert_eq!(mirror_planes(&mesh_of(r#"{ kind = "weave", pattern = "plain" }"#)), [true, true]);
    assert_ne!(mirror_planes(&mesh_of(r#"{ kind = "weave", pattern = "twill" }"#)), [true, true]);
}

#[test]
fn slots_that_differ_break_the_mirror() {
    let mut mesh = mesh_of(
        r#"{ kind = "grooves", profile = "trapezoid", count = 2, depth = 0.1, side_angle_deg = 45, rotation_deg = 0 }"#,
    );
    assert_eq!(mirror_planes(&mesh), [true, true]);
    let marked = mesh.slots.len() as u16;
    mesh.slots.push("marked".to_owned());
    // The walls on one side of the grooves get another slot.
    let wall = (0..mesh.triangles.len()).find(|t| mesh.geometric_normal(*t).x.abs() > 0.5).unwrap();
    let normal = mesh.geometric_normal(wall);
    for triangle in 0..mesh.triangles.len() {
        if (mesh.geometric_normal(triangle) - normal).length() < 1e-3 {
            mesh.triangle_slot[triangle] = marked;
        }
    }
    assert!(!mirror_planes(&mesh)[0]);
}

fn bits(hits: &[ColumnHit]) -> Vec<[u32; 8]> {
    let words = |s: &ColumnHit| {
        let [x, y, z] = s.normal.to_array().map(f32::to_bits);
        let [r, g, b] = s.color.to_array().map(f32::to_bits);
        [s.height.to_bits(), x, y, z, r, g, b, u32::from(s.slot)]
    };
    hits.iter().map(words).collect()
}

/// Height fields with and without mirror planes, of few and of many samples, on tiles of many sizes.
fn height_fields() -> Vec<TileMesh> {
    let mut meshes = Vec::new();
    for samples in [UVec2::new(1, 1), UVec2::new(2, 7), UVec2::new(300, 1), UVec2::new(64, 48), UVec2::new(16, 200)] {
        for size in [Vec2::ONE, Vec2::new(0.7, 3.0), Vec2::splat(1e-4), Vec2::splat(3e5)] {
            let (s, part) = (size.x, move |at: Vec2| TAU * at / size);
            let waves = move |at: Vec2| 0.1 * s * (part(at).x.cos() + (2.0 * part(at).y).cos());
            let crooked = move |at: Vec2| waves(at) + 0.03 * s * (2.0 * part(at).x + part(at).y + 0.7).sin();
            let hole = move |at: Vec2| if part(at).x < 0.2 { f32::NAN } else { crooked(at) };
            let steep = move |at: Vec2| 3e3 * crooked(at);
            let heights: [&dyn Fn(Vec2) -> f32; 6] = [&waves, &crooked, &hole, &steep, &|at| 0.1 * at.x, &|_| -0.0];
            meshes.extend(heights.map(|height| heightfield::from_function(samples, size, height)));
        }
    }
    let mut moved = meshes[20].clone();
    moved.positions[3].x += 0.2;
    let mut reordered = meshes[20].clone();
    reordered.triangles.reverse();
    meshes.extend([moved, reordered]);
    meshes
}

#[test]
fn a_part_of_a_height_field_has_the_same_hits_as_the_whole() {
    let mut compared = 0;
    for mesh in height_fields() {
        let points = || (0..POINTS).step_by(5).map(|k| sample_point(k, mesh.size)).chain([Vec2::ZERO, mesh.size]);
        let Some((part, grid)) = part_below(&mesh, points()) else { continue };
        let part = ColumnSampler { mesh: &part, grid: &grid, bottom: mesh.z_range().0 };
        let grid = PeriodicGrid::new(&mesh);
        let all = ColumnSampler { mesh: &mesh, grid: &grid, bottom: mesh.z_range().0 };
        for point in points() {
            assert_eq!(bits(&part.hits_below(point)), bits(&all.hits_below(point)), "{point} of {}", mesh.size);
            compared += 1;
        }
    }
    assert!(compared > 3000, "{compared}");
}

#[test]
fn few_points_exclude_only_candidates_that_all_points_exclude() {
    let mut excluded = 0;
    for mesh in height_fields() {
        let sums = [0, 1].map(|axis| candidates(&mesh, axis));
        let all = any_mirror_plane(&mesh, &PeriodicGrid::new(&mesh), &sums);
        assert_eq!(mirror_planes(&mesh), all, "{} of {} triangles", mesh.size, mesh.triangles.len());
        excluded += usize::from(are_excluded(&mesh, &sums));
    }
    assert!(excluded > 10, "{excluded}");
}
