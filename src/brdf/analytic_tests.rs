//! Tests of the lobes against their textbook formulas in f64, and of their invariants.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::{Brdf, LobeAngles, Term};
use crate::math::directions::half_vector;

/// `f_r` without its colour, by the textbook formulas.
fn plain_f_r(term: &Term, ni: f64, no: f64, nh: f64, sin2: f64, ih: f64) -> f64 {
    let tan2 = sin2 / (nh * nh);
    match *term {
        Term::Lambertian { .. } => 1.0 / PI,
        Term::BlinnPhong { exponent, .. } => {
            let e = f64::from(exponent);
            // (n·h)^e, from the sine if the cosine rounds to 1.
            let ln_nh = if sin2 < 0.5 { 0.5 * (-sin2).ln_1p() } else { nh.ln() };
            (e + 8.0) / (8.0 * PI) * (e * ln_nh).exp()
        }
        Term::CookTorrance { roughness, .. } => {
            let m2 = f64::from(roughness).powi(2);
            let d = (-tan2 / m2).exp() / (PI * m2 * nh.powi(4));
            let g = 1f64.min(2.0 * nh * no / ih).min(2.0 * nh * ni / ih);
            d * g / (4.0 * ni * no)
        }
        Term::Ward { roughness, .. } => {
            let a2 = f64::from(roughness).powi(2);
            (-tan2 / a2).exp() / (4.0 * PI * a2 * (ni * no).sqrt())
        }
        Term::Ggx { roughness, .. } => {
            let a2 = f64::from(roughness).powi(2);
            let d = a2 / (PI * (sin2 + a2 * nh * nh).powi(2));
            let lambda = |c: f64| 0.5 * ((1.0 + a2 * (1.0 - c * c) / (c * c)).sqrt() - 1.0);
            d / (1.0 + lambda(ni) + lambda(no)) / (4.0 * ni * no)
        }
        Term::Measured(_) => f64::NAN,
    }
}

fn random_direction(rng: &mut ChaCha8Rng) -> Vec3 {
    let (z, phi): (f32, f32) = (rng.random_range(-1.0..1.0), rng.random_range(0.0..std::f32::consts::TAU));
    let s = (1.0 - z * z).sqrt();
    Vec3::new(s * phi.cos(), s * phi.sin(), z).normalize_or(Vec3::Z)
}

/// A random direction above the surface; half of them are concentrated at the horizon or the normal.
fn random_above(rng: &mut ChaCha8Rng, n: Vec3) -> Vec3 {
    let mut v = random_direction(rng);
    if v.dot(n) < 0.0 {
        v -= 2.0 * v.dot(n) * n;
    }
    match rng.random_range(0..4) {
        0 => v -= (1.0 - 10f32.powf(rng.random_range(-6.0..0.0))) * v.dot(n) * n,
        1 => v += n * 10f32.powf(rng.random_range(0.0..4.0)),
        _ => {}
    }
    v.normalize_or(n)
}

/// One term of every kind, with a parameter that is uniform on a logarithmic scale.
fn random_terms(rng: &mut ChaCha8Rng) -> [Term; 5] {
    let roughness = 10f32.powf(rng.random_range(-4.0..0.0));
    let exponent = 10f32.powf(rng.random_range(-1.0..6.0));
    let color = Vec3::new(rng.random(), rng.random(), rng.random());
    all_terms(roughness, exponent, color)
}

fn all_terms(roughness: f32, exponent: f32, color: Vec3) -> [Term; 5] {
    [
        Term::Lambertian { albedo: color },
        Term::BlinnPhong { exponent, specular: color },
        Term::CookTorrance { roughness, f0: color },
        Term::Ward { roughness, specular: color },
        Term::Ggx { roughness, f0: color },
    ]
}

#[test]
fn lobes_equal_the_formulas_in_f64_for_any_parameter_and_angle() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..60_000 {
        let n = random_direction(&mut rng);
        let (i, o) = (random_above(&mut rng, n), random_above(&mut rng, n));
        let mut angles = LobeAngles::new(n, i, o, half_vector(i, o));
        // Half of the samples lie within the lobe, where the values are large.
        if rng.random() {
            let theta = std::f32::consts::FRAC_PI_2 * 10f32.powf(rng.random_range(-6.0..0.0));
            (angles.sin2_theta_h, angles.n_dot_h) = (theta.sin().powi(2), theta.cos());
        }
        if angles.n_dot_h <= 0.0 {
            continue;
        }
        for term in random_terms(&mut rng) {
            let [ni, no, nh, sin2, ih] =
                [angles.n_dot_i, angles.n_dot_o, angles.n_dot_h, angles.sin2_theta_h, angles.i_dot_h].map(f64::from);
            let exact = if angles.above() { plain_f_r(&term, ni, no, nh, sin2, ih) * ni * no } else { 0.0 };
            let found = f64::from(term.lobe_cos(&angles));
            // The fast exponential returns 0 below 1e-30.
            assert!((found - exact).abs() <= 1e-4 * exact + 1e-30, "{term:?} {angles:?}: {found} for {exact}");
        }
    }
}

#[test]
fn f_of_three_vectors_equals_the_formula_with_the_colour() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..20_000 {
        let n = random_direction(&mut rng);
        let (i, o) = (random_above(&mut rng, n), random_above(&mut rng, n));
        let (roughness, exponent) = (rng.random_range(0.1..1.0), rng.random_range(1.0..100.0));
        let color = Vec3::new(rng.random(), rng.random(), rng.random());
        let [dn, di, dout] = [n, i, o].map(|v| v.as_dvec3().normalize_or(DVec3::Z));
        let h = (di + dout).normalize_or(DVec3::Z);
        if dn.dot(di) < 1e-3 || dn.dot(dout) < 1e-3 {
            continue;
        }
        for term in all_terms(roughness, exponent, color) {
            let f_r = plain_f_r(&term, dn.dot(di), dn.dot(dout), dn.dot(h), dn.cross(h).length_squared(), di.dot(h));
            let fresnel = (1.0 - di.dot(h)).powi(5);
            let c = color.as_dvec3();
            let tint = if term.has_fresnel() { c + (1.0 - c) * fresnel } else { c };
            let brdf = Brdf { terms: vec![term.clone()] };
            let (exact, exact_cos) = (tint * f_r, tint * f_r * dn.dot(di) * dn.dot(dout));
            let (found, found_cos) = (brdf.f_r(n, i, o).as_dvec3(), brdf.f(n, i, o).as_dvec3());
            // A cosine of 1e-3 has a relative error of 1e-4 in f32; the test above measures the error of the lobes.
            assert!(
                (found - exact).abs().max_element() <= 1e-3 * exact.max_element() + 1e-30,
                "{term:?} {found} {exact}"
            );
            assert!((found_cos - exact_cos).abs().max_element() <= 1e-3 * exact_cos.max_element() + 1e-30, "{term:?}");
        }
    }
}

#[test]
fn every_term_is_reciprocal_to_the_bit_finite_and_not_negative() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for k in 0..30_000 {
        let n = random_direction(&mut rng);
        let i = if k % 7 == 0 { random_direction(&mut rng) } else { random_above(&mut rng, n) };
        // The pairs include exactly opposite, equal and mirrored directions.
        let o = match k % 5 {
            0 => -i,
            1 => i,
            2 => 2.0 * i.dot(n) * n - i,
            _ => random_above(&mut rng, n),
        };
        for term in random_terms(&mut rng) {
            let brdf = Brdf { terms: vec![term] };
            for (there, back) in [(brdf.f(n, i, o), brdf.f(n, o, i)), (brdf.f_r(n, i, o), brdf.f_r(n, o, i))] {
                assert_eq!(
                    there.to_array().map(f32::to_bits),
                    back.to_array().map(f32::to_bits),
                    "{brdf:?} {n} {i} {o}"
                );
                assert!(there.is_finite() && there.min_element() >= 0.0, "{brdf:?} {n} {i} {o}: {there}");
            }
            if n.dot(i) <= 0.0 || n.dot(o) <= 0.0 {
                assert_eq!(brdf.f(n, i, o), Vec3::ZERO);
            }
        }
    }
}

#[test]
fn degenerate_cosines_give_finite_values() {
    let tiny = [0.0, f32::MIN_POSITIVE * 1e-6, 1e-38, 1e-20, 1e-7, 0.5, 1.0, 1.000_000_2];
    for term in [1e-4, 0.01, 1.0, 2.0].map(|r| all_terms(r, 1e6, Vec3::ONE)).as_flattened() {
        for n_dot_i in tiny {
            for n_dot_o in tiny {
                for n_dot_h in tiny.map(|c| [c, -c]).as_flattened() {
                    for sin2_theta_h in tiny {
                        for i_dot_h in tiny.map(|c| [c, -c]).as_flattened() {
                            let angles =
                                LobeAngles { n_dot_i, n_dot_o, n_dot_h: *n_dot_h, sin2_theta_h, i_dot_h: *i_dot_h };
                            let f = term.f_cos(&angles);
                            assert!(f.is_finite() && f.min_element() >= 0.0, "{term:?} {angles:?} {f}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn many_at_once_are_the_same_bits_as_one_at_a_time() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let angles: Vec<LobeAngles> = (0..1003)
        .map(|_| {
            let (n, i, o) = (random_direction(&mut rng), random_direction(&mut rng), random_direction(&mut rng));
            LobeAngles::new(n, i, o, half_vector(i, o))
        })
        .collect();
    for term in random_terms(&mut rng) {
        let mut many = vec![f32::NAN; angles.len()];
        term.lobe_cos_many(&angles, &mut many);
        for (angles, &found) in angles.iter().zip(&many) {
            assert_eq!(found.to_bits(), term.lobe_cos(angles).to_bits(), "{term:?} {angles:?}");
        }
    }
}

#[test]
fn near_mirror_ggx_has_its_closed_form_peak() {
    // At the mirror direction D = 1/(π α²) and, at 60°, G2 = 1 - O(α²).
    let n = Vec3::Z;
    let i = Vec3::new(3f32.sqrt() / 2.0, 0.0, 0.5);
    let o = Vec3::new(-i.x, 0.0, 0.5);
    let brdf = Brdf { terms: vec![Term::Ggx { roughness: 1e-4, f0: Vec3::ONE }] };
    let expected = 1.0 / (4.0 * std::f32::consts::PI * 1e-8);
    assert!((brdf.f(n, i, o).x / expected - 1.0).abs() < 1e-4);
}
