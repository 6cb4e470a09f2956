//! The standard normal distribution: density, distribution function, its logarithm and its inverse.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Density φ(z).
pub fn pdf(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

/// Distribution function Φ(z).
pub fn cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// `E (Z + z)+ = z Φ(z) + φ(z)` of a standard normal Z. It is not negative and does not cancel for negative z.
pub fn ramp(z: f64) -> f64 {
    if z < -8.0 {
        // φ(z)/z² (1 - 3/z² + 15/z⁴): the terms of the exact form cancel.
        let inverse = 1.0 / (z * z);
        return pdf(z) * inverse * (1.0 - inverse * (3.0 - 15.0 * inverse));
    }
    (z * cdf(z) + pdf(z)).max(0.0)
}

/// log Φ(z), which stays finite where Φ underflows.
pub fn log_cdf(z: f64) -> f64 {
    if z > 0.0 {
        (-cdf(-z)).ln_1p()
    } else if z > -20.0 {
        cdf(z).ln()
    } else {
        -0.5 * z * z - 0.5 * (2.0 * PI).ln() - mills_from_above(z).ln()
    }
}

/// φ(z)/Φ(z) for z below -5: the continued fraction of Laplace.
fn mills_from_above(z: f64) -> f64 {
    let x = -z;
    let mut tail = x;
    for k in (1..=40).rev() {
        tail = x + f64::from(k) / tail;
    }
    tail
}

/// φ(z)/Φ(z): the mean of a standard normal below z, negated.
pub fn mills(z: f64) -> f64 {
    if z > -5.0 { pdf(z) / cdf(z) } else { mills_from_above(z) }
}

/// The inverse of Φ for `p` in (0, 1): the approximation of Acklam (2003) and two steps of Halley's method. The ends
/// of the interval give ±38, where Φ is 0 or 1 within the range of f64.
pub fn quantile(p: f64) -> f64 {
    if p > 0.5 {
        return -quantile(1.0 - p);
    }
    if p <= f64::MIN_POSITIVE {
        return -38.0;
    }
    let mut z = if p < 0.02425 {
        let q = (-2.0 * p.ln()).sqrt();
        let top = [
            -7.784894002430293e-3,
            -0.3223964580411365,
            -2.400758277161838,
            -2.549732539343734,
            4.374664141464968,
            2.938163982698783,
        ];
        let bottom = [7.784695709041462e-3, 0.3224671290700398, 2.445134137142996, 3.754408661907416, 1.0];
        polynomial(&top, q) / polynomial(&bottom, q)
    } else {
        let q = p - 0.5;
        let r = q * q;
        let top = [
            -39.69683028665376,
            220.9460984245205,
            -275.9285104469687,
            138.357_751_867_269,
            -30.66479806614716,
            2.506628277459239,
        ];
        let bottom =
            [-54.47609879822406, 161.5858368580409, -155.6989798598866, 66.80131188771972, -13.28068155288572, 1.0];
        q * polynomial(&top, r) / polynomial(&bottom, r)
    };
    for _ in 0..2 {
        let error = (cdf(z) - p) / pdf(z);
        z -= error / (1.0 + 0.5 * z * error);
    }
    z
}

/// A polynomial by Horner's rule, highest coefficient first.
fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distribution_function_is_the_integral_of_the_density_and_the_ramp_that_of_the_distribution_function() {
        let (mut cdf_sum, mut ramp_sum) = (cdf(-12.0), ramp(-12.0));
        let steps = 24_000;
        let h = 24.0 / f64::from(steps);
        for k in 0..steps {
            let z = -12.0 + h * f64::from(k);
            // Simpson's rule on each step.
            cdf_sum += h / 6.0 * (pdf(z) + 4.0 * pdf(z + 0.5 * h) + pdf(z + h));
            ramp_sum += h / 6.0 * (cdf(z) + 4.0 * cdf(z + 0.5 * h) + cdf(z + h));
            assert!((cdf_sum - cdf(z + h)).abs() < 1e-12);
            assert!((ramp_sum - ramp(z + h)).abs() < 1e-11);
        }
    }

    #[test]
    fn the_quantile_inverts_the_distribution_function_and_the_logarithm_is_smooth_where_it_changes_form() {
        for p in [1e-300, 1e-20, 1e-5, 0.02, 0.3, 0.5, 0.7, 0.999] {
            assert!((cdf(quantile(p)) / p - 1.0).abs() < 1e-9, "{p}");
        }
        for z in [-20.0, -5.0, 0.0] {
            assert!((log_cdf(z - 1e-9) - log_cdf(z + 1e-9)).abs() < 1e-6);
            assert!((mills(z - 1e-9) - mills(z + 1e-9)).abs() < 1e-6);
        }
        assert!(log_cdf(-1e6).is_finite() && quantile(0.0).is_finite() && quantile(1.0).is_finite());
        assert!((log_cdf(-10.0) - cdf(-10.0).ln()).abs() < 1e-12);
    }
}
