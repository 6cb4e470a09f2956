use super::*;

fn polar(degrees: f64, azimuth: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (y, x) = azimuth.to_radians().sin_cos();
    DVec3::new(sin * x, sin * y, cos)
}

/// The solid angle that `h` covers per solid angle of `o`, by central differences.
fn differences(o: DVec3, h: impl Fn(DVec3) -> DVec3) -> f64 {
    let step = 1e-5;
    let u = o.cross(DVec3::new(0.3, 0.5, 0.8)).normalize();
    let v = o.cross(u);
    let slope = |along: DVec3| (h((o + step * along).normalize()) - h((o - step * along).normalize())) / (2.0 * step);
    slope(u).cross(slope(v)).length()
}

#[test]
fn both_jacobians_are_the_finite_differences_at_0_to_85_degrees() {
    for degrees in [0.0, 30.0, 45.0, 60.0, 75.0, 85.0] {
        let i = polar(degrees, 0.0);
        let o = polar((degrees + 2.0_f64).min(88.0), 187.0) * DVec3::new(1.0, 1.0, -1.0);
        let top = jacobian_top(i, o, &of_top(i, o, 1.5).unwrap());
        let truth = differences(o, |o| of_top(i, o, 1.5).unwrap().h);
        assert!((top / truth - 1.0).abs() < 1e-6, "top, {degrees}: {top} {truth}");
        let bottom = jacobian_bottom(o, &of_bottom(i, o, 1.5).unwrap());
        let truth = differences(o, |o| of_bottom(i, o, 1.5).unwrap().h);
        assert!((bottom / truth - 1.0).abs() < 1e-6, "bottom, {degrees}: {bottom} {truth}");
    }
}

#[test]
fn the_printed_jacobian_of_eq_5_is_too_large_by_1_07_at_30_and_6_2_at_85_degrees() {
    for (degrees, expected) in [(0.0, 1.0), (30.0, 1.070), (60.0, 1.483), (75.0, 2.424), (85.0, 6.234)] {
        let i = polar(degrees, 0.0);
        let o = -i;
        let half = of_top(i, o, 1.5).unwrap();
        let printed = o.dot(half.inner).abs() * half.inner_cosine / (1.5 * 1.5 * (i + half.inner).length_squared());
        let ratio = printed / jacobian_top(i, o, &half);
        assert!((ratio - expected).abs() < 2e-3, "{degrees}: {ratio}");
    }
}

#[test]
fn the_half_vectors_of_one_ray_have_nearly_opposite_slopes() {
    let (i, o) = (DVec3::Z, polar(5.0, 20.0) * DVec3::new(-1.0, -1.0, -1.0));
    let (top, bottom) = (of_top(i, o, 1.5).unwrap().slope(), of_bottom(i, o, 1.5).unwrap().slope());
    assert!((top + bottom).length() < 0.02 * top.length(), "{top} {bottom}");
}

#[test]
fn each_facet_refracts_its_ray_by_snell() {
    let (i, o) = (polar(40.0, 10.0), polar(33.0, 200.0) * DVec3::new(1.0, 1.0, -1.0));
    let half = of_top(i, o, 1.5).unwrap();
    let inner = super::super::fresnel::refract(-i, half.h, 1.5).unwrap();
    assert!((inner - half.inner / 1.5).length() < 1e-14);
    let half = of_bottom(i, o, 1.5).unwrap();
    let out = super::super::fresnel::refract(-half.inner / 1.5, half.h, 1.0 / 1.5).unwrap();
    assert!((out - o).length() < 1e-14);
}

#[test]
fn no_facet_exists_without_a_change_of_index_on_the_straight_ray() {
    let i = polar(30.0, 0.0);
    assert!(of_top(i, -i, 1.0).is_none() && of_bottom(i, -i, 1.0).is_none());
}
