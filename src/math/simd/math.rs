//! Branch-free f32 functions that vectorise.

/// `e^x` for `x <= 0`, relative error below 3e-7. It is 0 below -60, so that products of it are never denormal, which
/// would be slow.
#[inline(always)]
pub(crate) fn exp_negative(x: f32) -> f32 {
    let x = x.max(-70.0);
    // Adding 1.5 * 2^23 rounds to the nearest integer, which is then in the low bits.
    const MAGIC: f32 = 12_582_912.0;
    // ln 2 in two parts; the first is so short that its product with k is exact (Cody and Waite).
    const LN_2_HIGH: f32 = 355.0 / 512.0;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let shifted = x * std::f32::consts::LOG2_E + MAGIC;
    let k = shifted - MAGIC;
    let f = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let power =
        1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f * (1.0 / 720.0))))));
    let exponent = (shifted.to_bits() as i32).wrapping_sub(MAGIC.to_bits() as i32).wrapping_add(127);
    let scale = f32::from_bits((exponent as u32) << 23);
    if x < -60.0 { 0.0 } else { power * scale }
}

/// `ln(1 - s)` for `0 <= s < 1`. Its error is relative to `s`, not to 1, because large exponents multiply the result.
#[inline(always)]
pub(crate) fn ln_one_minus(s: f32) -> f32 {
    let y = (1.0 - s).max(1e-30);
    // Rounding error of the subtraction.
    let lost = ((1.0 - y) - s) / y;
    ln_positive(y) + lost
}

/// `ln y` for normal `y > 0`, to 2e-7 absolute beside the logarithm's own rounding.
#[inline(always)]
pub(crate) fn ln_positive(y: f32) -> f32 {
    // y = m 2^k with m in [2/3, 4/3).
    const TWO_THIRDS_BITS: i32 = 0x3f2a_aaab;
    let k = (y.to_bits() as i32).wrapping_sub(TWO_THIRDS_BITS) >> 23;
    let m = f32::from_bits((y.to_bits() as i32).wrapping_sub(k << 23) as u32);
    let r = (m - 1.0) / (m + 1.0);
    let r2 = r * r;
    let series =
        2.0 * r * (1.0 + r2 * (1.0 / 3.0 + r2 * (1.0 / 5.0 + r2 * (1.0 / 7.0 + r2 * (1.0 / 9.0 + r2 * (1.0 / 11.0))))));
    series + k as f32 * std::f32::consts::LN_2
}

/// Weights of four evenly spaced samples at the fraction `t` between the second and the third (Catmull and Rom 1974).
#[inline(always)]
pub(crate) fn cubic_weights(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (2.0 * t2 - t - t3), 0.5 * (2.0 - 5.0 * t2 + 3.0 * t3), 0.5 * (t + 4.0 * t2 - 3.0 * t3), 0.5 * (t3 - t2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_matches_the_library_to_single_precision() {
        for k in 0..20_000 {
            let x = -(k as f32) * 0.004;
            let exact = f64::from(x).exp();
            let error = (f64::from(exp_negative(x)) - exact).abs();
            assert!(error <= 3e-7 * exact + 1e-26, "{x}: {} against {exact}", exp_negative(x));
        }
        assert_eq!(exp_negative(0.0), 1.0);
        assert!(exp_negative(f32::NEG_INFINITY) < 1e-37);
    }

    #[test]
    fn logarithm_of_positive_numbers_matches_the_library() {
        for k in -90..90 {
            let y = (k as f32 * 0.7 + 0.3).exp();
            assert!((ln_positive(y) - y.ln()).abs() < 2e-7 + 2e-7 * y.ln().abs(), "{y}: {}", ln_positive(y));
        }
    }

    #[test]
    fn logarithm_is_accurate_relative_to_its_small_argument() {
        for k in 1..4000 {
            let s = (k as f32 / 4000.0).powi(6);
            let exact = (-f64::from(s)).ln_1p();
            let error = (f64::from(ln_one_minus(s)) - exact).abs() / exact.abs();
            assert!(error < 5e-7, "{s}: {error}");
        }
        assert_eq!(ln_one_minus(0.0), 0.0);
    }
}
