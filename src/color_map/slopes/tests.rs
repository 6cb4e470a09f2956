use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::super::normal;
use super::weighted::tests::{GENERAL, sample};
use super::*;

#[test]
fn visible_slopes_have_the_mean_and_covariance_of_samples_weighted_by_projected_area() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for (theta, phi) in [(50.0_f64, 40.0_f64), (80.0, 200.0), (20.0, 0.0)] {
        let o = direction(theta.to_radians(), phi.to_radians());
        let mut sums = [0.0; 6];
        for _ in 0..600_000 {
            let s = sample(&GENERAL, &mut random);
            let w = (o.z - s.dot(o.truncate())).max(0.0);
            for (sum, value) in sums.iter_mut().zip([1.0, s.x, s.y, s.x * s.x, s.x * s.y, s.y * s.y]) {
                *sum += w * value;
            }
        }
        let [mass, x, y, xx, xy, yy] = sums.map(|sum| sum / sums[0]);
        assert_eq!(mass, 1.0);
        let ours = GENERAL.visible(o);
        assert!((ours.mean - DVec2::new(x, y)).length() < 1.5e-3, "{theta}: {} {x} {y}", ours.mean);
        for (ours, exact) in ours.covariance.iter().zip([xx - x * x, xy - x * y, yy - y * y]) {
            assert!((ours - exact).abs() < 1e-3, "{theta}");
        }
        let quadrature = GENERAL.weighted_moments(None, &|s| (o.z - s.dot(o.truncate())).max(0.0)).unwrap();
        assert!((ours.mean - quadrature.mean).length() < 1e-3);
    }
}

#[test]
fn visible_slopes_keep_the_projected_area_of_the_mean_plane() {
    // Facets together cover, along the view, what the mean plane covers: ∫ p(s) (cot θ - s·t) = cot θ - s̄·t, of
    // which the visible part is what masking leaves: M τ / (1 + Λ) = cot θ - s̄·t.
    for theta in [10.0_f64, 45.0, 70.0, 80.0] {
        let o = direction(theta.to_radians(), 0.7);
        let (cot, t) = cotangent(o);
        let nu = GENERAL.nu(o);
        let seen = normal::ramp(nu) * GENERAL.variance_along(t).sqrt() / (1.0 + GENERAL.lambda(o));
        assert!((seen / (cot - GENERAL.mean.dot(t)) - 1.0).abs() < 1e-9, "{theta}");
    }
}

#[test]
fn visible_moments_are_smooth_and_finite_from_above_to_far_behind_the_plane() {
    for nu in [-30.0, -5.0, 38.0] {
        let (a, b) = (visible_moments(nu - 1e-6), visible_moments(nu + 1e-6));
        assert!((a.0 / b.0 - 1.0).abs() < 1e-3 && (a.1 - b.1).abs() < 2e-3, "{nu}: {a:?} {b:?}");
    }
    for nu in [-1e6, -40.0, -1.0, 0.0, 3.0, 1e8, f64::INFINITY] {
        let (mean, variance) = visible_moments(nu);
        assert!(mean.is_finite() && (0.0..=1.0).contains(&variance), "{nu}: {mean} {variance}");
    }
    let (mean, variance) = visible_moments(0.0);
    assert!((mean - 1.2533).abs() < 1e-4 && (variance - 0.4292).abs() < 1e-4);
    let singular = Slopes { mean: DVec2::ZERO, covariance: [0.1, 0.0, 0.0] };
    for theta in [0.0, 0.7, 1.57, FRAC_PI_2] {
        for phi in [0.0, FRAC_PI_2] {
            let seen = singular.visible(direction(theta, phi));
            assert!(seen.mean.is_finite() && seen.covariance.iter().all(|c| c.is_finite()));
        }
    }
}
