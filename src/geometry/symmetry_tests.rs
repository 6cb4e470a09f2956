//! Planes of tiles that are known, and the quick refusal against a look at all.

use std::f32::consts::TAU;

use glam::UVec2;

use super::*;
use crate::geometry::build;
use crate::geometry::families::heightfield;

fn of(toml: &str) -> TileMesh {
    let scene = crate::scene::parse(&format!("[tile]\ngeometry = {toml}\n")).unwrap();
    build(&scene.tile, std::path::Path::new("")).unwrap()
}

#[test]
fn grooves_and_waves_have_the_planes_that_they_were_made_with() {
    let v = r#"{ kind = "grooves", profile = "v", count = 3, depth = 0.1, side_angle_deg = 40, rotation_deg = 0 }"#;
    assert_eq!(mirror_planes(&of(v)), [true, true]);
    let size = Vec2::ONE;
    let crooked = |at: Vec2| 0.1 * (TAU * (at.x + at.y)).cos() + 0.03 * (2.0 * TAU * at.x + 0.7).sin();
    let mesh = heightfield::from_function(UVec2::splat(32), size, crooked);
    assert_eq!(mirror_planes(&mesh), [false, false]);
    // A saw along x, straight along y.
    let mesh = heightfield::from_function(UVec2::splat(32), size, |at| 0.1 * at.x);
    assert_eq!(mirror_planes(&mesh), [false, true]);
}

#[test]
fn a_plain_weave_has_both_planes_and_a_twill_has_not() {
    assert_eq!(mirror_planes(&of(r#"{ kind = "weave", pattern = "plain" }"#)), [true, true]);
    assert_ne!(mirror_planes(&of(r#"{ kind = "weave", pattern = "twill" }"#)), [true, true]);
}

#[test]
fn slots_that_differ_break_the_mirror() {
    let mut mesh = of(
        r#"{ kind = "grooves", profile = "trapezoid", count = 2, depth = 0.1, side_angle_deg = 45, rotation_deg = 0 }"#,
    );
    assert_eq!(mirror_planes(&mesh), [true, true]);
    let marked = mesh.slots.len() as u16;
    mesh.slots.push("marked".to_owned());
    // One wall of one groove is made of something else.
    let wall = (0..mesh.triangles.len()).find(|t| mesh.geometric_normal(*t).x.abs() > 0.5).unwrap();
    let normal = mesh.geometric_normal(wall);
    for triangle in 0..mesh.triangles.len() {
        if (mesh.geometric_normal(triangle) - normal).length() < 1e-3 {
            mesh.triangle_slot[triangle] = marked;
        }
    }
    assert!(!mirror_planes(&mesh)[0]);
}

fn bits(seen: &[SampledColumn]) -> Vec<[u32; 8]> {
    let of = |s: &SampledColumn| {
        let [x, y, z] = s.normal.to_array().map(f32::to_bits);
        let [r, g, b] = s.color.to_array().map(f32::to_bits);
        [s.height.to_bits(), x, y, z, r, g, b, u32::from(s.slot)]
    };
    seen.iter().map(of).collect()
}

/// Height-fields with and without planes, of few samples and of many, on tiles of many sizes.
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
    let mut turned = meshes[20].clone();
    turned.triangles.reverse();
    meshes.extend([moved, turned]);
    meshes
}

#[test]
fn part_of_a_height_field_shows_below_its_places_what_all_of_it_shows() {
    let mut shown = 0;
    for mesh in height_fields() {
        let places = || (0..PLACES).step_by(5).map(|k| place(k, mesh.size)).chain([Vec2::ZERO, mesh.size]);
        let Some((part, grid)) = below(&mesh, places()) else { continue };
        let part = ColumnSamples { mesh: &part, grid: &grid, bottom: mesh.z_range().0 };
        let grid = PeriodicGrid::new(&mesh);
        let all = ColumnSamples { mesh: &mesh, grid: &grid, bottom: mesh.z_range().0 };
        for place in places() {
            assert_eq!(bits(&part.down(place)), bits(&all.down(place)), "{place} of {}", mesh.size);
            shown += 1;
        }
    }
    assert!(shown > 3000, "{shown}");
}

#[test]
fn few_places_refuse_only_what_all_would_refuse() {
    let mut refused = 0;
    for mesh in height_fields() {
        let sums = [0, 1].map(|axis| candidates(&mesh, axis));
        let all = among(&mesh, &PeriodicGrid::new(&mesh), &sums);
        assert_eq!(mirror_planes(&mesh), all, "{} of {} triangles", mesh.size, mesh.triangles.len());
        refused += usize::from(is_refused(&mesh, &sums));
    }
    assert!(refused > 10, "{refused}");
}
