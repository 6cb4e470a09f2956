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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_of_a_constant_is_ten_percent_and_twenty_decibels() {
        let errors = compare(&[Vec3::splat(1.1); 7], &[Vec3::ONE; 7]);
        assert!((errors.rel_l2 - 0.1).abs() < 1e-6 && (errors.psnr_db - 20.0).abs() < 1e-4);
        assert_eq!(compare(&[Vec3::ONE], &[Vec3::ONE]).psnr_db, f64::INFINITY);
    }
}
