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
#[path = "heights_tests.rs"]
mod tests;
