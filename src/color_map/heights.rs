//! Heights that are seen and lit on a surface with Gaussian heights and slopes (Heitz et al. 2013, Sec. 5.1).

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::{Distribution, Normal, normal};

/// The largest Λ. At grazing angles Λ grows without bound; heights change only with its logarithm.
pub const MAX_LAMBDA: f64 = 1e7;

/// Λ of Smith's masking (Eq. 3) at `nu`, the cotangent of the polar angle in deviations of the slopes towards the
/// direction. 0 from above; at most [`MAX_LAMBDA`], also for a direction that the mean plane faces away from.
pub fn lambda(nu: f64) -> f64 {
    if nu.is_nan() || nu <= 0.0 {
        return MAX_LAMBDA;
    }
    if nu > 38.0 {
        return 0.0;
    }
    // φ(ν)/ν - Φ(-ν) without the cancellation.
    (normal::ramp(-nu) / nu).min(MAX_LAMBDA)
}

/// The exponent a of `P(H ≤ h | seen and lit) = Φ(h)^(a+1)` for Λ of view and light whose azimuths differ by `apart`
/// radians: `max + k min`, where k goes from 0 at one azimuth to 1 (van Ginneken et al. 1998). The paper adds both Λ,
/// which darkens a surface that is seen along the light although it shows no shadow there.
pub fn pair_exponent(lambda_o: f64, lambda_i: f64, apart: f64) -> f64 {
    let turn = 2.0 * PI;
    let apart = (apart - (apart / turn).round() * turn).abs();
    let independence = 4.41 * apart / (4.41 * apart + 1.0);
    lambda_o.max(lambda_i) + independence * lambda_o.min(lambda_i)
}

/// The lit part of what is seen, of facets that face the light (Eq. 13 with [`pair_exponent`]).
pub fn lit_part(lambda_o: f64, exponent: f64) -> f64 {
    ((1.0 + lambda_o) / (1.0 + exponent)).min(1.0)
}

/// Mean and deviation of D_h [height deviations] by the paper's fits (Eqs. 17 and 18). They hold for large exponents: the
/// mean is 79 % too large at 0.1.
pub fn paper_moments(exponent: f64) -> Normal {
    Normal { mean: 0.39 * (4.75 * exponent + 1.0).ln(), deviation: 1.0 / (1.0 + 0.26 * (1.13 * exponent + 1.0).ln()) }
}

/// D_h, the distribution of visible heights in height deviations (Eq. 16): that of the largest of `a + 1` independent
/// standard normals, for any real a ≥ 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Largest {
    pub exponent: f64,
}

/// Nodes and weights of the Gauss-Legendre rule of 8 points on [-1, 1], positive half.
const GAUSS: [[f64; 2]; 4] = [
    [0.183_434_642_495_649_8, 0.362_683_783_378_362],
    [0.525_532_409_916_329, 0.313_706_645_877_887_3],
    [0.796_666_477_413_626_7, 0.222_381_034_453_374_5],
    [0.960_289_856_497_536_3, 0.101_228_536_290_376_3],
];
/// The heights between which D_h has mass, for all exponents up to [`MAX_LAMBDA`] [deviations].
const LOWEST: f64 = -9.0;
const HIGHEST: f64 = 10.0;
/// Length of a panel of the quadrature: D_h is never narrower than 0.16 deviations.
const PANEL: f64 = 0.4;

/// The integral of a smooth function.
fn integrate(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    let panels = ((to - from) / PANEL).ceil().max(1.0);
    let half = (to - from) / panels / 2.0;
    let panel = |k: usize| {
        let centre = from + half * (2.0 * k as f64 + 1.0);
        GAUSS.iter().map(|[x, weight]| weight * (f(centre - half * x) + f(centre + half * x))).sum::<f64>() * half
    };
    (0..panels as usize).map(panel).sum()
}

impl Largest {
    /// Mean and deviation by quadrature.
    pub fn exact_moments(&self) -> Normal {
        let a = self.exponent;
        let density = |z: f64| (a + 1.0) * (a * normal::log_cdf(z) - 0.5 * z * z).exp() / (2.0 * PI).sqrt();
        let mean = integrate(LOWEST, HIGHEST, |z| z * density(z));
        let variance = integrate(LOWEST, HIGHEST, |z| (z - mean).powi(2) * density(z));
        Normal { mean, deviation: variance.max(0.0).sqrt() }
    }

    /// Mean and deviation from a table over log(1 + a), within 3e-4.
    pub fn moments(&self) -> Normal {
        static TABLE: LazyLock<MomentTable> = LazyLock::new(MomentTable::new);
        TABLE.at(self.exponent)
    }
}

impl Distribution for Largest {
    fn tail(&self, v: f64) -> f64 {
        -((self.exponent + 1.0) * normal::log_cdf(v)).exp_m1()
    }

    fn ramp(&self, v: f64) -> f64 {
        if v >= HIGHEST {
            return 0.0;
        }
        let inside = v.max(LOWEST);
        integrate(inside, HIGHEST, |z| self.tail(z)) + (inside - v)
    }

    fn deviation(&self) -> f64 {
        // Exact to a factor of 1.4 and far from where it matters.
        paper_moments(self.exponent).deviation
    }
}

/// Entries of each of the two parts of the table of moments, and the exponent at which the parts meet.
const ENTRIES: usize = 64;
const MIDDLE: f64 = 100.0;

/// Mean and deviation of D_h over log(1 + a), in two parts: to [`MIDDLE`] and to [`MAX_LAMBDA`].
struct MomentTable {
    parts: [Vec<Normal>; 2],
}

impl MomentTable {
    fn range(part: usize) -> (f64, f64) {
        let middle = MIDDLE.ln_1p();
        if part == 0 { (0.0, middle) } else { (middle, (2.0 * MAX_LAMBDA).ln_1p()) }
    }

    fn new() -> Self {
        let part = |part: usize| {
            let (low, high) = Self::range(part);
            let at = |k: usize| (low + (high - low) * k as f64 / (ENTRIES - 1) as f64).exp_m1();
            (0..ENTRIES).map(|k| Largest { exponent: at(k) }.exact_moments()).collect()
        };
        Self { parts: [part(0), part(1)] }
    }

    fn at(&self, exponent: f64) -> Normal {
        let part = usize::from(exponent > MIDDLE);
        let (low, high) = Self::range(part);
        let x = ((exponent.max(0.0).ln_1p() - low) / (high - low)).clamp(0.0, 1.0) * (ENTRIES - 1) as f64;
        let k = (x as usize).min(ENTRIES - 2);
        let (f, a, b) = (x - k as f64, self.parts[part][k], self.parts[part][k + 1]);
        Normal { mean: a.mean + f * (b.mean - a.mean), deviation: a.deviation + f * (b.deviation - a.deviation) }
    }
}

#[cfg(test)]
mod tests {
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
        assert!(
            (excess(0.1) - 0.79).abs() < 0.02 && (excess(1.0) - 0.21).abs() < 0.01,
            "{} {}",
            excess(0.1),
            excess(1.0)
        );
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
}
