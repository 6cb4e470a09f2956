use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::stops::tests::{MAPS, map};
use super::*;

#[test]
fn the_mean_of_the_map_under_visible_heights_is_that_of_the_largest_of_several_normals() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for a in [0_u32, 1, 4] {
        let count = 200_000;
        let (mut sums, mut squares) = ([glam::DVec3::ZERO; 3], [glam::DVec3::ZERO; 3]);
        for _ in 0..count {
            let draw = |_| normal::quantile(random.random::<f64>().max(1e-300));
            let largest = (0..=a).map(draw).fold(f64::MIN, f64::max);
            for (k, name) in MAPS.iter().enumerate() {
                let color = map(name).color(largest);
                sums[k] += color / f64::from(count);
                squares[k] += color * color / f64::from(count);
            }
        }
        for (k, name) in MAPS.iter().enumerate() {
            let error = ((squares[k] - sums[k] * sums[k]) / f64::from(count)).max_element().sqrt();
            let ours = map(name).mean(&Largest { exponent: f64::from(a) });
            assert!((ours - sums[k]).abs().max_element() < 5.0 * error, "{name} {a}: {ours} {}", sums[k]);
        }
    }
}

#[test]
fn visible_heights_agree_with_quadrature_of_equation_16_for_real_exponents() {
    for exponent in [0.0, 0.1, 1.0, 5.5, 30.0, 1e3, 1e7] {
        let density = |z: f64| (exponent + 1.0) * (exponent * normal::log_cdf(z)).exp() * normal::pdf(z);
        let nodes: Vec<f64> = (0..40_000).map(|k| -9.0 + 19.0 * (f64::from(k) + 0.5) / 40_000.0).collect();
        for name in MAPS {
            let exact: glam::DVec3 =
                nodes.iter().map(|z| map(name).color(*z) * density(*z)).sum::<glam::DVec3>() * (19.0 / 40_000.0);
            let ours = map(name).mean(&Largest { exponent });
            assert!((ours - exact).abs().max_element() < 1e-3, "{name} {exponent}: {ours} {exact}");
            if name == "ramp" {
                assert!((ours - exact).abs().max_element() < 1e-5, "{exponent}: {ours} {exact}");
            }
        }
    }
}

#[test]
fn the_table_of_moments_is_within_3e_4_and_the_papers_fit_is_not() {
    let mut worst = 0.0_f64;
    for k in 0..300 {
        let exponent = (0.001 + 16.0 * f64::from(k) / 300.0).exp_m1();
        let (ours, exact) = (Largest { exponent }.moments(), Largest { exponent }.exact_moments());
        worst = worst.max((ours.mean - exact.mean).abs()).max((ours.deviation - exact.deviation).abs());
    }
    println!("moments of visible heights: worst {worst:.1e}");
    assert!(worst < 3e-4, "{worst}");
    // The constants of Eq. 17 are those of the paper, with the paper's error.
    let excess = |a: f64| paper_moments(a).mean / Largest { exponent: a }.exact_moments().mean - 1.0;
    assert!((excess(0.1) - 0.79).abs() < 0.02 && (excess(1.0) - 0.21).abs() < 0.01, "{} {}", excess(0.1), excess(1.0));
    assert!((excess(30.0) + 0.06).abs() < 0.01);
}

#[test]
fn the_lit_part_is_one_along_the_light_and_swapping_light_and_view_keeps_it_over_what_is_seen() {
    for nu in [0.1, 0.25, 1.0, 3.0] {
        let l = lambda(nu);
        assert!((lit_part(l, pair_exponent(l, l, 0.0)) - 1.0).abs() < 1e-12);
        let other = lambda(2.0 * nu);
        let a = pair_exponent(l, other, 0.7);
        let b = pair_exponent(other, l, -0.7);
        let (seen, swapped) = (lit_part(l, a) / (1.0 + l), lit_part(other, b) / (1.0 + other));
        assert!((seen - swapped).abs() < 1e-12);
    }
    assert_eq!(pair_exponent(1.0, 2.0, std::f64::consts::TAU), 2.0);
}

#[test]
fn lambda_is_finite_from_the_zenith_to_the_horizon_and_beyond() {
    assert_eq!(lambda(f64::INFINITY), 0.0);
    assert_eq!(lambda(0.0), MAX_LAMBDA);
    assert_eq!(lambda(-1.0), MAX_LAMBDA);
    // Eq. 3 where it does not cancel.
    let nu = 0.7_f64;
    assert!((lambda(nu) - (normal::pdf(nu) / nu - normal::cdf(-nu))).abs() < 1e-14);
    for nu in [1e-300, 1e-8, 1e-3, 1.0, 8.0, 37.0, 39.0] {
        assert!(lambda(nu).is_finite() && lambda(nu) >= 0.0);
    }
    for exponent in [0.0, 1e7, 2e7] {
        let at = Largest { exponent };
        for v in [-1e300, -20.0, 0.0, 5.3, 20.0, 1e300] {
            assert!((0.0..=1.0).contains(&at.tail(v)) && at.ramp(v) >= 0.0, "{exponent} {v}");
        }
    }
}
