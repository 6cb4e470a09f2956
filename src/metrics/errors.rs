//! Error measures, defined once for all reports.

use glam::Vec3;

/// Difference of `f̄` from a reference, over all channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// `‖x-ref‖ / ‖ref‖`; 0 if there is no difference.
    pub rel_l2: f64,
    /// `20 log10(max ref / rms(x-ref))` [dB]; infinite if there is no difference.
    pub psnr_db: f64,
}

/// Compares values of `f̄` with a reference of the same pairs.
pub fn compare(values: &[Vec3], reference: &[Vec3]) -> Errors {
    let (mut difference, mut norm, mut peak) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (x, r) in values.iter().zip(reference) {
        let (x, r) = (x.as_dvec3(), r.as_dvec3());
        difference += (x - r).length_squared();
        norm += r.length_squared();
        peak = peak.max(r.max_element());
    }
    let rms = (difference / (3 * reference.len().max(1)) as f64).sqrt();
    Errors {
        rel_l2: if difference == 0.0 { 0.0 } else { (difference / norm).sqrt() },
        psnr_db: if rms == 0.0 { f64::INFINITY } else { 20.0 * (peak / rms).log10() },
    }
}

/// An upper bound of the errors of similar pairs: the mean squared difference plus twice its standard error.
///
/// The errors of interpolated tables have a long tail. A few hundred pairs may contain none of the large errors.
/// Without the standard error, such a check would accept a representation with twice the error on other pairs.
pub fn upper_errors(values: &[Vec3], reference: &[Vec3]) -> Errors {
    let plain = compare(values, reference);
    let squares: Vec<f64> =
        values.iter().zip(reference).map(|(x, r)| (x.as_dvec3() - r.as_dvec3()).length_squared()).collect();
    let n = squares.len().max(1) as f64;
    let mean = squares.iter().sum::<f64>() / n;
    if mean == 0.0 {
        return plain;
    }
    let variance = squares.iter().map(|square| (square - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let factor = (1.0 + 2.0 * (variance / n).sqrt() / mean).sqrt();
    Errors { rel_l2: plain.rel_l2 * factor, psnr_db: plain.psnr_db - 20.0 * factor.log10() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_of_a_constant_is_ten_percent_and_20_db() {
        let errors = compare(&[Vec3::splat(1.1); 7], &[Vec3::ONE; 7]);
        assert!((errors.rel_l2 - 0.1).abs() < 1e-6 && (errors.psnr_db - 20.0).abs() < 1e-4);
        assert_eq!(compare(&[Vec3::ONE], &[Vec3::ONE]).psnr_db, f64::INFINITY);
    }

    #[test]
    fn equal_differences_have_no_standard_error_and_a_single_one_has_a_large_one() {
        let reference = [Vec3::ONE; 100];
        let even = [Vec3::splat(1.1); 100];
        assert_eq!(upper_errors(&even, &reference).psnr_db.round(), compare(&even, &reference).psnr_db.round());
        assert!((upper_errors(&even, &reference).rel_l2 - 0.1).abs() < 1e-6);
        // One of a hundred squares is 1: the mean and its standard error are both 1/100, so the factor is √3.
        let mut one = reference;
        one[7] = Vec3::splat(2.0);
        let ratio = upper_errors(&one, &reference).rel_l2 / compare(&one, &reference).rel_l2;
        assert!((ratio - 3.0_f64.sqrt()).abs() < 1e-6, "{ratio}");
    }
}
