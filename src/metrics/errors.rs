//! Numbers that mean the same everywhere (DESIGN.md, Sec. 7).

use glam::Vec3;

/// How far `f̄` is from a reference, all channels together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// `‖x-ref‖ / ‖ref‖`; 0 where both vanish.
    pub rel_l2: f64,
    /// `20 log10(max ref / rms(x-ref))` [dB]; infinite where there is no difference.
    pub psnr_db: f64,
}

/// Compares `f̄` with a reference, pair by pair.
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

/// The errors that pairs like these are likely to stay below: the mean squared difference and twice its standard error.
///
/// Differences of interpolated tables have a long tail. A check on a few hundred pairs that misses it would pass a form
/// whose error is twice as large on the next ones.
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
    fn a_tenth_of_a_constant_is_ten_percent_and_twenty_decibels() {
        let errors = compare(&[Vec3::splat(1.1); 7], &[Vec3::ONE; 7]);
        assert!((errors.rel_l2 - 0.1).abs() < 1e-6 && (errors.psnr_db - 20.0).abs() < 1e-4);
        assert_eq!(compare(&[Vec3::ONE], &[Vec3::ONE]).psnr_db, f64::INFINITY);
    }

    #[test]
    fn equal_differences_leave_nothing_to_doubt_and_a_single_one_much() {
        let reference = [Vec3::ONE; 100];
        let even = [Vec3::splat(1.1); 100];
        assert_eq!(upper_errors(&even, &reference).psnr_db.round(), compare(&even, &reference).psnr_db.round());
        assert!((upper_errors(&even, &reference).rel_l2 - 0.1).abs() < 1e-6);
        // One of a hundred: mean 1/100, standard error 1/100 of its square; √3 in all.
        let mut one = reference;
        one[7] = Vec3::splat(2.0);
        let ratio = upper_errors(&one, &reference).rel_l2 / compare(&one, &reference).rel_l2;
        assert!((ratio - 3.0_f64.sqrt()).abs() < 1e-6, "{ratio}");
    }
}
