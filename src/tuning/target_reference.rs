//! A small ray-cast reference that checks whether settings reach a target.

use glam::Vec3;
use rayon::prelude::*;

use crate::base::{Cancel, Result};
use crate::effective::SAFETY_FACTOR;
use crate::metrics::{Pair, compare, mirror_biased_pairs, upper_errors};
use crate::pipeline::{Outcome, Pipeline};
use crate::reference::ReferenceSettings;
use crate::scene::LoadedScene;

/// Number of direction pairs.
const PAIRS: usize = 64;
/// Seed of the pairs, which `biscale report` uses as well.
const PAIRS_SEED: u64 = 20_110_801;
/// Facets per pass of the reference.
const REFERENCE_FACETS: usize = 4096;
/// Bounds the time of the reference. Its standard error is subtracted in squares from what is measured.
const MAX_PASSES: usize = 48;
const MIN_PASSES: usize = 4;
/// Margin by which the PSNR of the reference exceeds the target [dB].
const REFERENCE_LEAD_DB: f64 = 4.0;
/// Largest factor between the stated errors of all pairs and of the pairs of the reference that is applied to a measured
/// error.
const MAX_CORRECTION: f64 = 8.0;
/// Standard error of the PSNR of a typical error [dB]. The RMS of stated over true errors is 3.5 dB (`cargo bench --bench measure --
/// errors`), and is taken larger for the few facets from which the search starts.
const STATED_STD_ERROR_DB: f64 = 5.8;
/// Smallest standard error of a PSNR from the pairs of the reference [dB] (`cargo bench --bench measure -- choosing`).
const MIN_STD_ERROR_DB: f64 = 2.5;

/// Reference values of a scene at few pairs, with their standard error.
#[derive(Debug, Clone)]
pub struct TargetReference {
    pairs: Vec<Pair>,
    f_bar: Vec<Vec3>,
    /// Relative L2 of the standard errors.
    std_error: f64,
    peak: Peak,
}

/// Error of a result by its statement and by the reference together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckedError {
    /// PSNR on other pairs [dB]; infinite if there is no error.
    pub psnr_db: f64,
    /// Standard error of the PSNR [dB].
    pub psnr_std_error_db: f64,
    pub rel_l2: f64,
}

impl TargetReference {
    /// Adds passes until the standard error is well below that of a PSNR of `db`.
    ///
    /// # Errors
    /// Returns the errors of [`Pipeline::effective`].
    pub fn new(
        pipeline: &Pipeline,
        loaded: &LoadedScene,
        (peak, db): (Peak, f64),
        cancel: &Cancel,
        progress: &mut impl FnMut(&str),
    ) -> Result<Self> {
        let pairs = mirror_biased_pairs(PAIRS, PAIRS_SEED);
        let settings =
            ReferenceSettings { facets: REFERENCE_FACETS, max_passes: MAX_PASSES, target: 1e-5, seed: 20_110_807 };
        let mut std_error = 0.0;
        let enough = peak.rel_l2(db + REFERENCE_LEAD_DB);
        let estimates = pipeline.with_reference(loaded, |reference| {
            reference.estimate_few_pairs(&pairs, &settings, |passes, error| {
                std_error = error;
                progress(&format!("reference, {passes} passes, standard error {:.2} %", error * 100.0));
                !cancel.is_set() && (passes < MIN_PASSES || error > enough)
            })
        })?;
        cancel.check()?;
        Ok(Self { pairs, f_bar: estimates.iter().map(|estimate| estimate.f_bar).collect(), std_error, peak })
    }

    /// The error of an outcome: the mean of the stated and of the measured PSNR, weighted by their variances.
    pub fn errors(&self, outcome: &Outcome) -> CheckedError {
        let stated = self.peak.stated_db(outcome);
        let values: Vec<Vec3> = self.pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
        let errors = compare(&values, &self.f_bar);
        if errors.rel_l2 == 0.0 {
            return CheckedError { psnr_db: f64::INFINITY, psnr_std_error_db: 0.0, rel_l2: 0.0 };
        }
        // The reference does not resolve errors below a third of its standard error.
        let noise = self.std_error / errors.rel_l2;
        let rel_l2 = errors.rel_l2 * (1.0 - noise * noise).max(noise * noise / 9.0).min(1.0).sqrt();
        let correction = self.correction(outcome);
        let measured = self.peak.psnr_db(rel_l2 * correction);
        // Upper errors lie two standard errors of the mean square above the errors.
        let upper = upper_errors(&values, &self.f_bar).rel_l2 / errors.rel_l2;
        let of_pairs = 10.0 * (0.5 * (1.0 + upper * upper)).log10();
        let of_noise = 10.0 * (1.0 + (self.std_error / rel_l2).powi(2)).log10();
        // A correction extrapolates to errors that the pairs of the reference may lack.
        let of_correction = 10.0 * correction.log10();
        let std_error = of_pairs.hypot(of_noise).hypot(of_correction).max(MIN_STD_ERROR_DB);
        let (psnr_db, psnr_std_error_db) = if stated.is_finite() {
            weighted_mean([(measured, std_error), (stated, STATED_STD_ERROR_DB)])
        } else {
            (measured, std_error)
        };
        CheckedError { psnr_db, psnr_std_error_db, rel_l2: self.peak.rel_l2(psnr_db) }
    }

    /// The stated error of all pairs relative to that of the pairs of the reference, because few of these may lack those
    /// with the largest errors.
    fn correction(&self, outcome: &Outcome) -> f64 {
        let Some(estimator) = outcome.errors() else { return 1.0 };
        let squares = |values: &[Vec3]| values.iter().map(|value| value.as_dvec3().length_squared()).sum::<f64>();
        let Ok(errors) = estimator.standard_errors(&self.pairs, &Cancel::default()) else { return 1.0 };
        let here = (squares(&errors) / squares(&self.f_bar)).sqrt();
        let ratio = estimator.estimate().rel_l2 / SAFETY_FACTOR / here;
        if ratio.is_finite() { ratio.clamp(1.0 / MAX_CORRECTION, MAX_CORRECTION) } else { 1.0 }
    }
}

/// The mean of two values weighted by their variances, and its standard error. If the values differ by more than their
/// standard errors explain, the standard error grows by that factor.
fn weighted_mean(values: [(f64, f64); 2]) -> (f64, f64) {
    let [(a, s), (b, t)] = values;
    let weights = [1.0 / (s * s), 1.0 / (t * t)];
    let total = weights[0] + weights[1];
    let factor = ((a - b) / s.hypot(t)).abs().max(1.0);
    ((a * weights[0] + b * weights[1]) / total, factor / total.sqrt())
}

/// Mean peak of several sets of pairs over the root mean square of all [dB], which relates PSNR and relative L2. The peak
/// of one set alone is noisy. A set is as large as those of `biscale report`.
#[derive(Debug, Clone, Copy)]
pub struct Peak(f64);

impl Peak {
    /// The peak of a result, which should have enough facets that single ones do not sparkle.
    pub fn of(outcome: &Outcome) -> Self {
        let pairs = mirror_biased_pairs(PEAK_SETS * PEAK_SET_SIZE, PAIRS_SEED);
        let values: Vec<Vec3> = pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
        let squares = values.iter().map(|value| value.as_dvec3().length_squared()).sum::<f64>();
        let power = squares / (3 * values.len()) as f64;
        let peak = |set: &[Vec3]| set.iter().map(|value| f64::from(value.max_element())).fold(0.0, f64::max);
        let peaks = values.chunks(PEAK_SET_SIZE).map(peak).sum::<f64>() / PEAK_SETS as f64;
        Self(if power > 0.0 { 20.0 * (peaks / power.sqrt()).log10() } else { 0.0 })
    }

    /// The PSNR of the typical error for what a result states [dB]; infinite if it states no error.
    pub fn stated_db(self, outcome: &Outcome) -> f64 {
        let stated = outcome.errors().map_or(0.0, |errors| errors.estimate().typical_rel_l2());
        if stated > 0.0 { self.psnr_db(stated) } else { f64::INFINITY }
    }

    fn psnr_db(self, rel_l2: f64) -> f64 {
        self.0 - 20.0 * rel_l2.max(1e-12).log10()
    }

    fn rel_l2(self, psnr_db: f64) -> f64 {
        10_f64.powf((self.0 - psnr_db) / 20.0)
    }
}

/// Number of sets of pairs whose peaks are averaged.
const PEAK_SETS: usize = 4;
/// Pairs per set, as many as `biscale report` uses by default.
const PEAK_SET_SIZE: usize = 500;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_leans_to_the_surer_value_and_is_unsure_where_the_values_disagree() {
        let (mean, error) = weighted_mean([(40.0, 1.0), (41.0, 2.0)]);
        assert!((mean - 40.2).abs() < 1e-9 && (error - 0.8_f64.sqrt()).abs() < 1e-9, "{mean} {error}");
        let (mean, error) = weighted_mean([(48.0, 1.0), (30.0, 2.0)]);
        assert!((mean - 44.4).abs() < 1e-9 && error > 7.0, "{mean} {error}");
    }
}
