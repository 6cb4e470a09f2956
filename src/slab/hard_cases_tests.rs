//! Hard cases: no value is NaN, negative or infinite, and limits are met.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::*;
use crate::base::Cancel;

fn direction(degrees: f64, azimuth: f64, is_up: bool) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (y, x) = f64::to_radians(azimuth).sin_cos();
    let z = if degrees == 90.0 { 0.0 } else { cos };
    DVec3::new(sin * x, sin * y, if is_up { z } else { -z })
}

fn faces() -> Vec<(&'static str, Ndf)> {
    let analytic = |profile, x, y| Ndf::analytic(profile, DVec2::new(x, y), 0.3);
    let of = |slopes: &[(DVec2, f64)]| Ndf::of_facets(slopes, 64).unwrap();
    let holes: Vec<_> =
        (0..400).map(|k| (DVec2::new(f64::from(k % 20) * 0.05, f64::from(k / 20 % 2) * 0.6), 1.0)).collect();
    let one_cell: Vec<_> =
        (0..100).map(|k| (DVec2::new(0.2 + 1e-7 * f64::from(k), 1e-7 * f64::from(k * k % 100)), 1.0)).collect();
    let steep: Vec<_> = (0..300).map(|k| (DVec2::from_angle(f64::from(k)) * f64::from(k * k) * 0.01, 1.0)).collect();
    let line: Vec<_> = (0..200).map(|k| (DVec2::new(f64::from(k) * 0.01 - 1.0, 0.0), 1.0)).collect();
    vec![
        ("smooth", Ndf::smooth()),
        ("roughness 0", analytic(Profile::Ggx, 0.0, 0.0)),
        ("roughness 1e-4", analytic(Profile::Beckmann, 1e-4, 1e-4)),
        ("roughness 1", analytic(Profile::Ggx, 1.0, 1.0)),
        ("roughness 1e-3 and 1", analytic(Profile::Beckmann, 1e-3, 1.0)),
        ("one point", of(&[(DVec2::new(0.3, 0.1), 1.0)])),
        ("a line", of(&line)),
        ("holes, mean not 0", of(&holes)),
        ("one cell", of(&one_cell)),
        ("steep", of(&steep)),
    ]
}

#[test]
fn no_value_of_any_pair_of_hard_faces_is_negative_or_not_finite() {
    let faces = faces();
    let angles = [0.0, 1e-6, 45.0, 80.0, 89.99, 90.0];
    for (a, (top_name, top)) in faces.iter().enumerate() {
        for (bottom_name, bottom) in faces.iter().skip(a % 2).step_by(2) {
            for (eta, thickness, absorption) in [
                (DVec3::splat(1.5), 0.0, 0.0),
                (DVec3::splat(1.0), 1e6, 1e6),
                (DVec3::splat(1.0 + 1e-6), 1.0, 0.0),
                (DVec3::new(4.0, 1.5, 1.0), 1e6, 1.0),
            ] {
                let optics =
                    Optics { eta, thickness, absorption: DVec3::splat(absorption), diffuse: DVec3::splat(0.1) };
                let slab = Slab::new(Arc::new(top.clone()), Arc::new(bottom.clone()), optics, 64);
                for slab in
                    [Slab { alpha: 0.0, ..slab.clone() }, Slab { alpha: 1e-9, ..slab.clone() }, slab.by_faces(8)]
                {
                    for theta_i in angles {
                        for theta_o in angles {
                            for azimuth in [0.0, 180.0, 77.0] {
                                for (up_i, up_o) in [(true, false), (true, true), (false, false)] {
                                    let (i, o) = (direction(theta_i, 0.0, up_i), direction(theta_o, azimuth, up_o));
                                    let value = slab.eval(i, o);
                                    let is_sound = value.is_finite() && value.min_element() >= 0.0;
                                    assert!(is_sound, "{top_name}/{bottom_name}, eta {eta}, {i} {o}: {value}");
                                }
                            }
                        }
                        for part in slab.straight(direction(theta_i, 10.0, true)) {
                            assert!(
                                part.is_finite() && part.min_element() >= 0.0 && part.max_element() <= 1.0 + 1e-9,
                                "{part}"
                            );
                        }
                    }
                    // Exactly opposite directions.
                    let i = direction(30.0, 20.0, true);
                    let value = slab.eval(i, -i);
                    assert!(value.is_finite() && value.min_element() >= 0.0, "{value}");
                }
            }
        }
    }
}

#[test]
fn inner_reflections_of_hard_faces_are_sound() {
    for (name, face) in faces() {
        for eta in [1.0 + 1e-6, 1.5, 4.0] {
            let optics = Optics { eta: DVec3::splat(eta), ..Optics::default() };
            let inner = Inner::new(&face, &face, &optics, 64, 1, &Cancel::default()).unwrap();
            for theta in [0.0, 45.0, 89.99, 90.0] {
                let (i, o) = (direction(theta, 0.0, true), direction(60.0, 130.0, false));
                for value in [inner.btdf(i, o), inner.brdf(i, -o)] {
                    assert!(value.is_finite() && value.min_element() >= 0.0, "{name}, {eta}: {value}");
                }
            }
        }
    }
}

#[test]
fn a_narrowing_roughness_gives_the_window() {
    let i = direction(50.0, 0.0, true);
    let window = {
        let smooth = Arc::new(Ndf::smooth());
        Slab::new(smooth.clone(), smooth, Optics::default(), 64).straight(i)[0].x
    };
    for (roughness, bound) in [(1e-2, 2e-3), (1e-3, 1e-3), (1e-4, 1e-3)] {
        let face = Arc::new(Ndf::analytic(Profile::Beckmann, DVec2::splat(roughness), 0.0));
        let slab = Slab::new(face.clone(), face, Optics::default(), 64);
        for slab in [slab.clone(), slab.by_faces(256)] {
            let lobe = DiscLobe::transmitted(&slab, i, 96);
            let (mean, deviation) = lobe.moments();
            println!("{roughness}, {:?}: T {:.5} for {window:.5}", slab.method, lobe.total().x);
            assert!(
                (lobe.total().x / window - 1.0).abs() < bound + if slab.method == Method::Faces { 0.02 } else { 0.0 }
            );
            // The moments are those of cells of 1/48.
            assert!((mean + i.truncate()).length() < 0.011 && deviation.max_element() < 0.012, "{mean} {deviation}");
        }
    }
}

#[test]
fn the_lobe_narrows_with_the_index_until_it_is_straight() {
    let face = Arc::new(Ndf::analytic(Profile::Beckmann, DVec2::splat(0.3), 0.0));
    let i = direction(30.0, 0.0, true);
    let mut ratios = Vec::new();
    for eta in [1.5, 1.1, 1.02, 1.005] {
        let optics = Optics { eta: DVec3::splat(eta), ..Optics::default() };
        let slab = Slab {
            alpha: 0.5,
            virtual_face: Arc::new(face.only_spread().unwrap().clone()),
            ..Slab::new(face.clone(), face.clone(), optics, 64)
        };
        let half = 6.0 * (eta - 1.0) * 0.3;
        let (mut sum, mut square, side) = (0.0, 0.0, 301);
        for k in 0..side * side {
            let at = |k: i32| (f64::from(k) / f64::from(side - 1) - 0.5) * 2.0 * half;
            let p = DVec2::new(at(k % side) - i.x, at(k / side));
            let value = slab.single_pass(i, p.extend(-(1.0 - p.length_squared()).max(1e-6).sqrt())).x;
            sum += value;
            square += value * p.y * p.y;
        }
        ratios.push((square / sum).sqrt() / ((eta - 1.0) * 0.3 / 2f64.sqrt()));
    }
    println!("width over (eta - 1) and the deviation of slopes: {ratios:.3?}");
    for (ratio, expected) in ratios.iter().zip([1.080, 1.119, 1.131, 1.133]) {
        assert!((ratio - expected).abs() < 0.02, "{ratios:?}");
    }
}

#[test]
fn totals_without_fresnel_and_masking_are_the_facets_that_let_light_out() {
    let face = Ndf::analytic(Profile::Beckmann, DVec2::splat(0.2), 0.0);
    for (degrees, of_top, of_bottom) in [(0.0, 1.0, 1.0), (45.0, 1.0, 0.9565), (75.0, 0.3879, 0.6014)] {
        let i = direction(degrees, 0.0, true);
        let side = 900;
        let mut sums = [0.0; 2];
        for k in 0..side * side {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(side) * 2.0 - 1.0;
            let p = DVec2::new(at(k % side), at(k / side));
            if p.length_squared() >= 1.0 {
                continue;
            }
            let o = p.extend(-(1.0 - p.length_squared()).sqrt());
            let area = (2.0 / f64::from(side)).powi(2);
            let inside = |at: &Configuration| fresnel::reflectance(at.inner.z.abs(), 1.0 / 1.5);
            let outside = |h: DVec2| normal(h);
            if let Some(at) = rough_top(i, o, 1.5) {
                let fresnel = (1.0 - fresnel::reflectance(i.dot(outside(at.slope)), 1.5)) * (1.0 - inside(&at));
                sums[0] += at.factor / fresnel * face.density(at.slope) * area;
            }
            if let Some(at) = rough_bottom(i, o, 1.5) {
                let cosine = -at.inner.dot(outside(at.slope));
                let fresnel = (1.0 - fresnel::reflectance(cosine, 1.0 / 1.5)) * (1.0 - fresnel::reflectance(i.z, 1.5));
                sums[1] += at.factor / fresnel * face.density(at.slope) * area;
            }
        }
        println!("F = G = 1 at {degrees}: top {:.4} for {of_top}, bottom {:.4} for {of_bottom}", sums[0], sums[1]);
        assert!((sums[0] - of_top).abs() < 2e-3 && (sums[1] - of_bottom).abs() < 3e-3, "{degrees}: {sums:?}");
    }
}
