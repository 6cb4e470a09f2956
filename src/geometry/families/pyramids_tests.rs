use super::*;
use crate::geometry::closure::assert_closes_plane;

fn slot_area(mesh: &TileMesh, slot: u16) -> f64 {
    (0..mesh.triangles.len()).filter(|&t| mesh.triangle_slot[t] == slot).map(|t| mesh.triangle_area(t)).sum()
}

#[test]
fn every_number_of_sides_and_arrangement_closes_the_plane_without_overhangs() {
    for sides in 3..=8 {
        for arrangement in [Arrangement::Square, Arrangement::Hex, Arrangement::Staggered] {
            for (rotation_deg, truncation, face_ratio) in [(0.0, 0.0, 1.0), (17.0, 0.4, 3.0), (45.0, 0.0, 0.2)] {
                let spec = Pyramids {
                    sides,
                    arrangement,
                    rotation_deg,
                    truncation,
                    face_ratio,
                    base_size: 0.9,
                    ..Pyramids::default()
                };
                let mesh = build(&spec, Vec2::new(1.0, 1.3));
                assert_closes_plane(&mesh);
                assert!(mesh.is_height_field(), "{spec:?}");
            }
        }
    }
}

#[test]
fn square_pyramids_fill_the_plane_and_have_the_closed_form_area() {
    let spec = Pyramids { height: 0.2, ..Pyramids::default() };
    let mesh = build(&spec, Vec2::ONE);
    // The mesh has no floor and no triangles without area.
    assert_eq!(mesh.triangles.len(), 4 * 16);
    // Each of 16 cells has four faces with base 1/4 and slant height √(h² + (1/8)²).
    let slant = (0.2f64 * 0.2 + 0.125 * 0.125).sqrt();
    assert!((slot_area(&mesh, FACES) - 16.0 * 2.0 * 0.25 * slant).abs() < 1e-5);
    assert!(slot_area(&mesh, FLOOR) < 1e-6);
    assert_closes_plane(&mesh);
}

#[test]
fn hexagons_fill_a_tile_of_matching_size() {
    let spec = Pyramids { sides: 6, arrangement: Arrangement::Hex, spacing: 0.5, ..Pyramids::default() };
    let mesh = build(&spec, Vec2::new(1.0, 3f32.sqrt()));
    assert!(slot_area(&mesh, FLOOR) < 1e-4, "{}", slot_area(&mesh, FLOOR));
    assert!(mesh.notes.is_empty(), "{:?}", mesh.notes);
}

#[test]
fn face_ratio_sets_the_ratio_of_the_projected_faces() {
    let mesh = build(&Pyramids { face_ratio: 3.0, spacing: 1.0, ..Pyramids::default() }, Vec2::ONE);
    let projected = |sign: f32| -> f64 {
        let towards = |t: &usize| mesh.triangle_slot[*t] == FACES && mesh.geometric_normal(*t).x * sign > 0.1;
        (0..mesh.triangles.len())
            .filter(towards)
            .map(|t| mesh.triangle_area(t) * f64::from(mesh.geometric_normal(t).z))
            .sum()
    };
    assert!((projected(1.0) / projected(-1.0) - 3.0).abs() < 1e-4);
}
