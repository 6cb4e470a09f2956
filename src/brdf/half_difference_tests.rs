use std::f32::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::math::directions::{from_angles, half_vector};

/// A small table of random values, of which a few percent are invalid.
fn random_table(rng: &mut ChaCha8Rng) -> HalfDifferenceTable {
    let shape = [7, 6, 5];
    let samples = (0..shape.iter().product::<usize>())
        .map(|_| {
            if rng.random_bool(0.05) {
                Vec4::ZERO
            } else {
                Vec4::new(rng.random(), rng.random(), rng.random::<f32>() * 100.0, 1.0)
            }
        })
        .collect();
    HalfDifferenceTable::new("random".to_owned(), shape, samples, MeasuredReport::default())
}

/// Half and difference angles in f64, by rotating the light direction; `φ_d` in (-π, π].
fn rotated_angles(i: Vec3, o: Vec3) -> [f64; 3] {
    let (i, o) = (i.as_dvec3(), o.as_dvec3());
    let h = (i + o) / (i + o).length();
    let (theta_h, phi_h) = (h.x.hypot(h.y).atan2(h.z), h.y.atan2(h.x));
    let rotated = glam::DQuat::from_rotation_y(-theta_h) * (glam::DQuat::from_rotation_z(-phi_h) * i);
    [theta_h, rotated.x.hypot(rotated.y).atan2(rotated.z), rotated.y.atan2(rotated.x)]
}

#[test]
fn lookup_equals_trilinear_interpolation_over_valid_neighbours_from_rotated_angles() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let table = random_table(&mut rng);
    let [bins_h, bins_d, bins_phi] = table.shape.map(i64::from);
    for _ in 0..20_000 {
        let i = from_angles(rng.random_range(0.0..1.5), rng.random_range(0.0..TAU));
        let o = from_angles(rng.random_range(0.0..1.5), rng.random_range(0.0..TAU));
        let [theta_h, theta_d, phi_d] = rotated_angles(i, o);
        // Fold the swap of i and o (+π) and the mirror image (negation).
        let folded = phi_d.abs().min(std::f64::consts::PI - phi_d.abs());
        let x = bins_h as f64 * (theta_h / FRAC_PI_2).sqrt() - 0.5;
        let y = bins_d as f64 * theta_d / FRAC_PI_2 - 0.5;
        let z = bins_phi as f64 * folded / FRAC_PI_2 - 0.5;
        let (mut sum, mut weights) = (glam::DVec3::ZERO, 0.0);
        for corner in 0..8_i64 {
            let bins = [x, y, z].map(f64::floor);
            let upper = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
            let weight: f64 = (0..3)
                .map(|k| {
                    let t = [x, y, z][k] - bins[k];
                    if upper[k] == 1 { t } else { 1.0 - t }
                })
                .product();
            let at = |k: usize, n: i64| (bins[k] as i64 + upper[k]).clamp(0, n - 1);
            let sample =
                table.samples[((at(1, bins_d) * bins_h + at(0, bins_h)) * bins_phi + at(2, bins_phi)) as usize];
            if sample.w > 0.0 {
                sum += weight * sample.truncate().as_dvec3();
                weights += weight;
            }
        }
        if weights < 1e-3 || theta_d < 0.05 || theta_h < 0.01 {
            continue;
        }
        let expected = sum / weights;
        let found = table.f_r(&LobeAngles::new(Vec3::Z, i, o, half_vector(i, o))).as_dvec3();
        assert!((found - expected).abs().max_element() < 2e-3 * expected.max_element(), "{i} {o}: {found} {expected}");
    }
}

#[test]
fn cosines_agree_with_vectors() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..1000 {
        let i = from_angles(rng.random_range(0.0..1.5), rng.random_range(0.0..TAU));
        let o = from_angles(rng.random_range(0.0..1.5), rng.random_range(0.0..TAU));
        let (n_dot_i, n_dot_o) = cosines(rotated_angles(i, o));
        assert!((n_dot_i - f64::from(i.z)).abs() < 1e-6 && (n_dot_o - f64::from(o.z)).abs() < 1e-6);
    }
}

#[test]
fn lookups_are_reciprocal_to_the_bit_and_bounded_at_degenerate_angles() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let table = random_table(&mut rng);
    let edge = [f32::MIN_POSITIVE, 1e-20, 1e-7, 1e-3, 0.5, 0.999_999_9, 1.0, 1.000_000_2];
    for n_dot_i in edge {
        for n_dot_o in edge {
            for n_dot_h in edge {
                for sin2_theta_h in edge.iter().copied().chain([0.0]) {
                    for i_dot_h in edge.iter().copied().chain([0.0, -1e-7]) {
                        let there = LobeAngles { n_dot_i, n_dot_o, n_dot_h, sin2_theta_h, i_dot_h };
                        let back = LobeAngles { n_dot_i: n_dot_o, n_dot_o: n_dot_i, ..there };
                        let value = table.f_r(&there);
                        assert_eq!(value, table.f_r(&back));
                        assert!(value.min_element() >= 0.0 && value.max_element() <= 100.1, "{there:?}: {value}");
                    }
                }
            }
        }
    }
}

#[test]
fn many_lookups_are_the_same_bits_as_one_at_a_time() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let table = random_table(&mut rng);
    let angles: Vec<LobeAngles> = (0..1001)
        .map(|_| {
            let i = from_angles(rng.random_range(0.0..1.7), rng.random_range(0.0..TAU));
            let o = from_angles(rng.random_range(0.0..1.7), rng.random_range(0.0..TAU));
            LobeAngles::new(Vec3::Z, i, o, half_vector(i, o))
        })
        .collect();
    let mut many = vec![Vec3::NAN; angles.len()];
    table.f_r_many(&angles, &mut many);
    for (angles, found) in angles.iter().zip(many) {
        assert_eq!(found, table.f_r(angles));
    }
}

#[test]
fn content_depends_on_shape_and_samples_and_not_on_the_name() {
    let samples = vec![Vec4::splat(0.5); 24];
    let table = |name: &str, shape, samples: &[Vec4]| {
        HalfDifferenceTable::new(name.to_owned(), shape, samples.to_vec(), MeasuredReport::default()).content()
    };
    let content = table("a", [2, 3, 4], &samples);
    assert_eq!(content, table("b", [2, 3, 4], &samples));
    assert_ne!(content, table("a", [4, 3, 2], &samples));
    let mut others = samples.clone();
    others[17].y += 1e-6;
    assert_ne!(content, table("a", [2, 3, 4], &others));
}

#[test]
fn no_valid_neighbour_gives_zero() {
    let table = HalfDifferenceTable::new("none".to_owned(), [2, 2, 2], vec![Vec4::ZERO; 8], MeasuredReport::default());
    let angles = LobeAngles::new(Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Z);
    assert_eq!(table.f_r(&angles), Vec3::ZERO);
}
