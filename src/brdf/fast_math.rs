//! Elementary functions without branches or library calls, so that loops over lobes vectorise.
//! Each function documents its range and its error, and a test measures the error.

/// `e^x` for `x <= 0`; 0 below -87. Relative error `2e-7 + 1e-7 |x|` (the rounding of `x / ln 2`).
#[inline]
pub(super) fn exp_nonpositive(x: f32) -> f32 {
    /// 1.5·2²³: adding and subtracting it rounds to an integer.
    const ROUND: f32 = 12_582_912.0;
    let t = x.max(-88.0) * std::f32::consts::LOG2_E;
    let shifted = t + ROUND;
    let k = shifted - ROUND;
    // 2^f on [-½, ½]: Taylor in f ln 2 to the seventh power, error 4e-9.
    let y = (t - k) * std::f32::consts::LN_2;
    let p = 1.0
        + y * (1.0
            + y * (1.0 / 2.0
                + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0 + y * (1.0 / 720.0 + y * (1.0 / 5040.0)))))));
    // The low bits of the shifted number are k, within [-127, 0]. For k = -127 the exponent bits are 0, which is the
    // number 0.
    let biased = shifted.to_bits().wrapping_sub(ROUND.to_bits() - 127);
    let scale = f32::from_bits(biased << 23);
    if x < -87.0 { 0.0 } else { p * scale }
}

/// `ln cos²θ` from both `sin²θ` and `cosθ > 0`; the more exact of the two is used. Relative error 3e-7.
#[inline]
pub(super) fn ln_cos_squared(sin2: f32, cos: f32) -> f32 {
    // ln x = k ln 2 + 2 atanh z with z = (m-1)/(m+1), m = x 2^-k in [1/√2, √2); near the pole 1 - sin² is m itself.
    let x = (cos * cos).max(f32::MIN_POSITIVE);
    let biased = x.to_bits().wrapping_sub(std::f32::consts::FRAC_1_SQRT_2.to_bits());
    let exponent = (biased as i32) >> 23;
    let mantissa = f32::from_bits(x.to_bits().wrapping_sub((exponent << 23) as u32));
    let near_pole = sin2 < 0.5;
    let k = select(near_pole, 0.0, exponent as f32);
    let numerator = select(near_pole, -sin2, mantissa - 1.0);
    let denominator = select(near_pole, 2.0 - sin2, mantissa + 1.0);
    let z = numerator / denominator;
    let w = z * z;
    let series = 1.0
        + w * (1.0 / 3.0 + w * (1.0 / 5.0 + w * (1.0 / 7.0 + w * (1.0 / 9.0 + w * (1.0 / 11.0 + w * (1.0 / 13.0))))));
    k * std::f32::consts::LN_2 + 2.0 * z * series
}

/// `acos x / √(1-x)` for `0 <= x <= 1`: a minimax polynomial, relative error 1e-6 with rounding. The terms are grouped
/// for a short dependency chain, because its length limits the speed of table lookups.
#[inline]
pub(super) fn acos_over_sqrt_one_minus(x: f32) -> f32 {
    let x2 = x * x;
    let low = x * -0.214_509_43 + 1.570_795_2;
    let middle = x * -0.044_892_136 + 0.087_852_61;
    let high = x * -0.004_307_06 + 0.019_273_368;
    low + x2 * (middle + x2 * high)
}

/// Branch-free `if condition { a } else { b }`: both sides are computed, so loops vectorise.
#[inline]
fn select(condition: bool, a: f32, b: f32) -> f32 {
    let mask = u32::from(condition).wrapping_neg();
    f32::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_is_within_its_stated_error_and_zero_far_below() {
        for k in 0..200_000 {
            let x = -(k as f32) * 87.0 / 200_000.0;
            let exact = f64::from(x).exp();
            let error = (f64::from(exp_nonpositive(x)) - exact).abs() / exact;
            assert!(error < 2e-7 + 1e-7 * f64::from(x.abs()), "{x}: {error}");
        }
        assert_eq!(exp_nonpositive(0.0), 1.0);
        assert_eq!(exp_nonpositive(-1e30), 0.0);
        assert_eq!(exp_nonpositive(f32::NEG_INFINITY), 0.0);
    }

    #[test]
    fn ln_cos_squared_is_within_its_stated_error_from_pole_to_horizon() {
        for k in 1..100_000 {
            let theta = (f64::from(k) / 100_000.0).powi(4) * std::f64::consts::FRAC_PI_2;
            let (sin2, cos) = ((theta.sin().powi(2)) as f32, theta.cos() as f32);
            // The exact result for the arguments rounded to f32.
            let exact = if sin2 < 0.5 { (-f64::from(sin2)).ln_1p() } else { 2.0 * f64::from(cos).ln() };
            let error = (f64::from(ln_cos_squared(sin2, cos)) - exact).abs();
            assert!(error <= 3e-7 * exact.abs(), "{theta}: {error} of {exact}");
        }
        assert!(ln_cos_squared(1.0, 0.0).is_finite());
    }

    #[test]
    fn acos_is_within_its_stated_error() {
        for k in 0..=100_000 {
            let x = k as f32 / 100_000.0;
            let found = (1.0 - x).sqrt() * acos_over_sqrt_one_minus(x);
            let exact = f64::from(x).acos();
            assert!((f64::from(found) - exact).abs() <= 1e-6 * exact + 1e-7, "{x}");
        }
    }
}
