use super::*;
use crate::geometry::closure::assert_closes_plane;

fn area(mesh: &TileMesh) -> f64 {
    (0..mesh.triangles.len()).map(|triangle| mesh.triangle_area(triangle)).sum()
}

#[test]
fn full_v_grooves_have_the_area_of_their_slopes() {
    let spec = Grooves { profile: GrooveProfile::V, depth: 0.5, side_angle_deg: 45.0, count: 1, ..Grooves::default() };
    let mesh = build(&spec, Vec2::ONE);
    assert!((area(&mesh) - 2f64.sqrt()).abs() < 1e-6, "{}", area(&mesh));
    assert!(mesh.is_height_field());
    assert_closes_plane(&mesh);
}

#[test]
fn rectangular_grooves_add_two_walls_each() {
    let spec = Grooves { profile: GrooveProfile::Rectangular, depth: 0.3, count: 5, ..Grooves::default() };
    let mesh = build(&spec, Vec2::new(1.0, 2.0));
    assert!((area(&mesh) - (2.0 + 5.0 * 2.0 * 0.3 * 2.0)).abs() < 1e-5);
    assert_closes_plane(&mesh);
}

#[test]
fn rotated_grooves_are_periodic_and_preserve_the_base_area() {
    for (count, rotation_deg, size) in
        [(4, 30.0, Vec2::ONE), (7, -61.0, Vec2::new(1.0, 0.6)), (3, 90.0, Vec2::new(2.0, 1.0)), (5, 180.0, Vec2::ONE)]
    {
        for profile in [GrooveProfile::V, GrooveProfile::U, GrooveProfile::Trapezoid, GrooveProfile::Rectangular] {
            let mesh = build(&Grooves { count, rotation_deg, profile, ..Grooves::default() }, size);
            assert_closes_plane(&mesh);
            assert!(mesh.is_height_field(), "{profile:?} {rotation_deg}");
            let is_as_asked = rotation_deg == 180.0;
            let is_about_rotation = |note: &String| note.starts_with("grooves run at");
            assert_eq!(mesh.notes.iter().any(is_about_rotation), !is_as_asked, "{:?}", mesh.notes);
        }
    }
}

#[test]
fn the_area_of_a_u_groove_is_close_to_that_of_a_half_cylinder() {
    // The opening of 0.8 and the depth of 0.4 give a half circle of radius 0.4: an arc of 0.4 π, and land of 0.2.
    let spec = Grooves { profile: GrooveProfile::U, depth: 0.4, bottom_width: 0.8, count: 1, ..Grooves::default() };
    let expected = 0.4 * PI + 0.2;
    assert!((area(&build(&spec, Vec2::ONE)) - expected).abs() < 2e-3 * expected);
}

#[test]
fn bezout_solves_its_equation() {
    for (m, n) in [(4, 0), (0, -3), (12, 18), (-5, 7), (1, 1)] {
        let (g, a, b) = bezout(m, n);
        assert_eq!(a * m + b * n, g);
        assert!(g > 0 && m % g == 0 && n % g == 0);
    }
}

#[test]
fn sides_that_would_overlap_are_steeper_and_a_note_says_so() {
    let spec = Grooves { depth: 0.2, side_angle_deg: 60.0, bottom_width: 0.4, ..Grooves::default() };
    let mesh = build(&spec, Vec2::ONE);
    // The distance of the grooves is 0.25, of which the bottom leaves 0.3 for each side.
    assert!(mesh.notes.len() == 1 && mesh.notes[0].contains("69.4 degrees"), "{:?}", mesh.notes);
    assert!(build(&Grooves { side_angle_deg: 69.5, ..spec.clone() }, Vec2::ONE).notes.is_empty());
    let ignored = Grooves { profile: GrooveProfile::Rectangular, ..spec };
    assert!(build(&ignored, Vec2::ONE).notes.is_empty());
}
