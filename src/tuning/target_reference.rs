//! A small ray-cast reference that checks whether settings reach a target.

use glam::Vec3;
use rayon::prelude::*;

use crate::base::Result;
use crate::metrics::{Pair, compare, mirror_biased_pairs, upper_errors};
use crate::pipeline::{Outcome, Pipeline};
use crate::reference::ReferenceSettings;
use crate::scene::LoadedScene;

/// Number of direction pairs.
const PAIRS: usize = 64;
/// Seed of the pairs, which `biscale report` uses as well.
const PAIRS_SEED: u64 = 20_110_801;
const REFERENCE_FACETS: usize = 1024;
/// Bounds the time of the reference. Its standard error is subtracted in squares from what is measured.
const MAX_PASSES: usize = 32;
const MIN_PASSES: usize = 4;
/// Margin by which the PSNR of the reference exceeds the target [dB]. The error of the reference is subtracted in squares.
const REFERENCE_LEAD_DB: f64 = 5.0;
/// Largest factor between the stated errors of all pairs and of the pairs of the reference that is applied to a measured
/// error.
const MAX_CORRECTION: f64 = 2.0;

/// Reference values of a scene at 64 direction pairs, with their standard error.
#[derive(Debug, Clone)]
pub struct TargetReference {
    pairs: Vec<Pair>,
    f_bar: Vec<Vec3>,
    /// Relative L2 of the standard errors.
    std_error: f64,
    /// Mean peak of several sets of pairs over the root mean square of all [dB]. The peak of one set alone is noisy.
    peak_db: f64,
}

impl TargetReference {
    /// Adds passes until the standard error is well below that of a PSNR of `db`. A coarse `outcome` gives peak and
    /// mean square.
    ///
    /// # Errors
    /// Returns the errors of [`Pipeline::effective`].
    pub fn new(
        pipeline: &Pipeline,
        loaded: &LoadedScene,
        outcome: &Outcome,
        db: f64,
        progress: &mut impl FnMut(&str),
    ) -> Result<Self> {
        let pairs = mirror_biased_pairs(PAIRS, PAIRS_SEED);
        let settings =
            ReferenceSettings { facets: REFERENCE_FACETS, max_passes: MAX_PASSES, target: 1e-5, seed: 20_110_807 };
        let mut std_error = 0.0;
        // PSNR is relative to the peak, the standard error to the root mean square.
        let peak_db = typical_peak_db(outcome);
        let enough = 10_f64.powf((peak_db - db - REFERENCE_LEAD_DB) / 20.0);
        let estimates = pipeline.with_reference(loaded, |reference| {
            reference.estimate(&pairs, &settings, |passes, error| {
                std_error = error;
                progress(&format!("reference, {passes} passes, standard error {:.2} %", error * 100.0));
                passes < MIN_PASSES || error > enough
            })
        })?;
        Ok(Self { pairs, f_bar: estimates.iter().map(|estimate| estimate.f_bar).collect(), std_error, peak_db })
    }

    /// Errors of an outcome without the error of the reference: PSNR [dB], its standard error [dB], relative L2. Stated errors
    /// correct for the choice of the pairs, because few of them may lack those with the largest errors.
    pub fn errors(&self, outcome: &Outcome) -> (f64, f64, f64) {
        let values: Vec<Vec3> = self.pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
        let errors = compare(&values, &self.f_bar);
        if errors.rel_l2 == 0.0 {
            return (f64::INFINITY, 0.0, 0.0);
        }
        // The reference does not resolve errors below a third of its standard error.
        let smallest = (self.std_error / 3.0).powi(2);
        let rel_l2 = (errors.rel_l2.powi(2) - self.std_error.powi(2)).max(smallest).sqrt().min(errors.rel_l2);
        let rel_l2 = rel_l2 * self.correction(outcome);
        // Upper errors lie two standard errors of the mean square above the errors.
        let upper = upper_errors(&values, &self.f_bar).rel_l2 / errors.rel_l2;
        let psnr_std_error_db = 10.0 * (0.5 * (1.0 + upper * upper)).log10();
        (self.peak_db - 20.0 * rel_l2.max(1e-12).log10(), psnr_std_error_db, rel_l2)
    }

    /// The stated error of all pairs relative to that of the pairs of the reference.
    fn correction(&self, outcome: &Outcome) -> f64 {
        let Some(estimator) = outcome.errors() else { return 1.0 };
        let squares = |values: &[Vec3]| values.iter().map(|value| value.as_dvec3().length_squared()).sum::<f64>();
        let here = (squares(&estimator.standard_errors(&self.pairs)) / squares(&self.f_bar)).sqrt();
        let ratio = estimator.estimate().rel_l2 / here;
        if ratio.is_finite() { ratio.clamp(1.0 / MAX_CORRECTION, MAX_CORRECTION) } else { 1.0 }
    }
}

/// Mean peak of sets of pairs over the root mean square of all pairs [dB]. A set is as large as those of `biscale
/// report`.
fn typical_peak_db(outcome: &Outcome) -> f64 {
    let pairs = mirror_biased_pairs(PEAK_SETS * PEAK_SET_SIZE, PAIRS_SEED);
    let values: Vec<Vec3> = pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
    let power = values.iter().map(|value| value.as_dvec3().length_squared()).sum::<f64>() / (3 * values.len()) as f64;
    let peak = |set: &[Vec3]| set.iter().map(|value| f64::from(value.max_element())).fold(0.0, f64::max);
    let peaks = values.chunks(PEAK_SET_SIZE).map(peak).sum::<f64>() / PEAK_SETS as f64;
    if power > 0.0 { 20.0 * (peaks / power.sqrt()).log10() } else { 0.0 }
}

/// Number of sets of pairs whose peaks are averaged.
const PEAK_SETS: usize = 8;
/// Pairs per set, as many as `biscale report` uses by default.
const PEAK_SET_SIZE: usize = 500;
