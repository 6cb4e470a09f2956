use super::*;
use crate::geometry::closure::signed_projected_area;

#[test]
fn an_upright_cylinder_has_its_closed_form_area() {
    let spec = Rods {
        count: 1,
        radius: 0.1,
        length: 0.5,
        taper: 0.0,
        spread_deg: 0.0,
        length_variation: 0.0,
        ..Rods::default()
    };
    let mesh = build(&spec, Vec2::ONE);
    let area: f64 = (2..mesh.triangles.len()).map(|t| mesh.triangle_area(t)).sum();
    // A prism of 12 sides has the perimeter 12 · 2 r sin(π/12) and the base 6 r² sin(π/6).
    let expected = 24.0 * 0.1 * (TAU / 24.0).sin() * 0.5 + 6.0 * 0.01 * 0.5;
    assert!((area - expected).abs() < 1e-5, "{area} {expected}");
}

#[test]
fn axes_are_uniform_over_the_disc_of_angles() {
    let spec = Rods { spread_deg: 40.0, ..Rods::default() };
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut counts = vec![0.0; 10 * 20];
    for _ in 0..200_000 {
        let axis = random_axis(&spec, &mut rng);
        let ring = (axis.z.acos().to_degrees() / 40.0).powi(2) * 10.0;
        let azimuth = (axis.y.atan2(axis.x) / TAU + 1.0).fract() * 20.0;
        counts[(ring as usize).min(9) * 20 + (azimuth as usize).min(19)] += 1.0;
    }
    let p = crate::testing::chi_square::p_value(&counts, &[1.0; 200]);
    assert!(p > 0.01, "{p}");
}

#[test]
fn sides_face_outwards_and_tips_upwards() {
    let spec = Rods { count: 9, lean_deg: 30.0, lean_azimuth_deg: 70.0, ..Rods::default() };
    let mesh = build(&spec, Vec2::ONE);
    // The floor has the projected area 1, and each rod that of its foot's outline.
    let foot = 6.0 * f64::from(spec.radius).powi(2) * 0.5 / 30f64.to_radians().cos();
    let expected = 1.0 + 9.0 * foot;
    assert!((signed_projected_area(&mesh) - expected).abs() < 0.1 * 9.0 * foot);
}

#[test]
fn the_same_seed_gives_the_same_rods_and_another_seed_gives_others() {
    let spec = Rods::default();
    assert_eq!(build(&spec, Vec2::ONE).positions, build(&spec, Vec2::ONE).positions);
    assert_ne!(build(&spec, Vec2::ONE).positions, build(&Rods { seed: 2, ..spec }, Vec2::ONE).positions);
}

#[test]
fn density_times_area_is_the_count_and_no_spread_makes_parallel_rods() {
    let spec = Rods { density: Some(50.0), spread_deg: 0.0, lean_deg: 40.0, ..Rods::default() };
    let mesh = build(&spec, Vec2::new(2.0, 1.0));
    // A rod of 12 segments has 24 triangles of side and 10 of tip.
    assert_eq!(mesh.triangles.len(), 2 + 100 * 34);
    let axis = from_angles(40f64.to_radians(), 0.0).as_vec3();
    let tips = (0..100).map(|rod| mesh.geometric_normal(2 + rod * 34 + 30));
    tips.for_each(|normal| assert!(normal.dot(axis) > 0.9999, "{normal}"));
}
