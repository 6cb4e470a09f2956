//! A reference of a scene on a few hundred pairs: seconds of work that tell how good a setting is.

use glam::Vec3;
use rayon::prelude::*;

use crate::base::Result;
use crate::metrics::{Pair, compare, mirror_biased_pairs, upper_errors};
use crate::pipeline::{Outcome, Pipeline};
use crate::reference::ReferenceSettings;
use crate::scene::LoadedScene;

/// Direction pairs of the small reference.
const PAIRS: usize = 512;
/// As in `biscale report`.
pub const PAIRS_SEED: u64 = 20_110_801;
const REFERENCE_FACETS: usize = 2048;
const MAX_PASSES: usize = 128;
const MIN_PASSES: usize = 4;
/// The reference must be this much better than what is asked for [dB].
const REFERENCE_LEAD_DB: f64 = 8.0;
/// A small reference of a scene, and how good it is itself.
#[derive(Debug, Clone)]
pub struct SmallReference {
    pairs: Vec<Pair>,
    f_bar: Vec<Vec3>,
    /// Relative L2 of its standard errors.
    own: f64,
    /// The peak of some hundred pairs over the root mean square of all [dB]: the peak of one set is a matter of luck.
    peak_db: f64,
}

impl SmallReference {
    /// Passes until its own error is well below `db`, whose peak and mean a coarse `outcome` tells.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn new(
        pipeline: &mut Pipeline,
        loaded: &LoadedScene,
        outcome: &Outcome,
        db: f64,
        pairs_seed: u64,
        progress: &mut impl FnMut(&str),
    ) -> Result<Self> {
        let pairs = mirror_biased_pairs(PAIRS, pairs_seed);
        let settings =
            ReferenceSettings { facets: REFERENCE_FACETS, max_passes: MAX_PASSES, target: 1e-5, seed: 20_110_807 };
        let mut own = 0.0;
        // PSNR is about the peak, the standard error about the mean square.
        let peak_db = typical_peak_db(outcome);
        let enough = 10_f64.powf((peak_db - db - REFERENCE_LEAD_DB) / 20.0);
        let estimates = pipeline.with_reference(loaded, |reference| {
            reference.estimate(&pairs, &settings, |passes, error| {
                own = error;
                progress(&format!("reference, {passes} passes, standard error {:.2} %", error * 100.0));
                passes < MIN_PASSES || error > enough
            })
        })?;
        Ok(Self { pairs, f_bar: estimates.iter().map(|one| one.f_bar).collect(), own, peak_db })
    }

    /// Errors of an outcome with the reference's own taken out: PSNR [dB], its doubt [dB], relative L2.
    pub fn errors(&self, outcome: &Outcome) -> (f64, f64, f64) {
        let values: Vec<Vec3> = self.pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
        let errors = compare(&values, &self.f_bar);
        if errors.rel_l2 == 0.0 {
            return (f64::INFINITY, 0.0, 0.0);
        }
        // Below a third of its own error the reference can tell nothing.
        let ours = (errors.rel_l2.powi(2) - self.own.powi(2)).max((self.own / 3.0).powi(2)).sqrt().min(errors.rel_l2);
        // Upper errors are two standard errors of the mean square away.
        let upper = upper_errors(&values, &self.f_bar).rel_l2 / errors.rel_l2;
        let psnr_std_error_db = 10.0 * (0.5 * (1.0 + upper * upper)).log10();
        (self.peak_db - 20.0 * ours.max(1e-12).log10(), psnr_std_error_db, ours)
    }
}

/// Of sets of pairs as large as those that errors are reported over: the mean peak, over the root mean square of all [dB].
fn typical_peak_db(outcome: &Outcome) -> f64 {
    let pairs = mirror_biased_pairs(PEAK_SETS * PEAK_SET_SIZE, PAIRS_SEED);
    let values: Vec<Vec3> = pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
    let power = values.iter().map(|value| value.as_dvec3().length_squared()).sum::<f64>() / (3 * values.len()) as f64;
    let peak = |set: &[Vec3]| set.iter().map(|value| f64::from(value.max_element())).fold(0.0, f64::max);
    let peaks = values.chunks(PEAK_SET_SIZE).map(peak).sum::<f64>() / PEAK_SETS as f64;
    if power > 0.0 { 20.0 * (peaks / power.sqrt()).log10() } else { 0.0 }
}

/// Sets of pairs whose peaks are averaged, and pairs in each, as many as errors are reported over (DESIGN.md, Sec. 7).
const PEAK_SETS: usize = 8;
const PEAK_SET_SIZE: usize = 500;
