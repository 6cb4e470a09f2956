//! True errors of f̄ beside the errors that the program states.

use biscale::metrics::{Errors, Pair, compare};
use biscale::pipeline::{Outcome, Pipeline};
use biscale::scene::LoadedScene;
use glam::Vec3;
use rayon::prelude::*;

use super::TrueValues;

/// Presets with the largest relative L2 and the least PSNR [dB] that they promise.
pub const BOUNDS: [(&str, f64, f64); 3] = [("draft", 0.35, 0.0), ("standard", 0.10, 35.0), ("fine", 0.04, 43.0)];

/// Seed of the pairs, which `biscale report` uses as well.
pub const PAIRS_SEED: u64 = 20_110_801;

/// Errors of one scene at one preset and seed.
#[derive(Debug, Clone)]
pub struct Measured {
    pub preset: &'static str,
    pub seed: u64,
    /// Without the standard error of the true values, which is subtracted in squares.
    pub errors: Errors,
    /// Relative L2 and PSNR [dB] that the program states.
    pub stated: Option<(f64, f64)>,
    /// True if the true values resolve the error: it exceeds twice their standard error.
    pub is_resolved: bool,
    pub has_warnings: bool,
}

/// Returns the relative L2 and the PSNR [dB] that the program states for a result.
pub fn stated(_: &Outcome) -> Option<(f64, f64)> {
    None
}

/// Computes f̄ at a preset and compares it with the true values.
pub fn measure(loaded: &LoadedScene, preset: &'static str, seed: u64, pairs: &[Pair], truth: &TrueValues) -> Measured {
    let mut loaded = loaded.clone();
    loaded.scene.quality.preset = preset.to_owned();
    loaded.scene.quality.seed = seed;
    let outcome = Pipeline::new().effective(&loaded).unwrap_or_else(|error| panic!("{}: {error}", loaded.name));
    let values: Vec<Vec3> = pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
    let found = compare(&values, &truth.values);
    // True values do not resolve errors below a third of their standard error.
    let least = (truth.std_error / 3.0).powi(2);
    let rel_l2 = (found.rel_l2.powi(2) - truth.std_error.powi(2)).max(least).sqrt().min(found.rel_l2);
    let psnr_db = found.psnr_db + 20.0 * (found.rel_l2.max(1e-12) / rel_l2.max(1e-12)).log10();
    Measured {
        preset,
        seed,
        errors: Errors { rel_l2, psnr_db },
        stated: stated(&outcome),
        is_resolved: found.rel_l2 > 2.0 * truth.std_error,
        has_warnings: !outcome.health().warnings.is_empty(),
    }
}

impl Measured {
    /// Returns true if the error is within the bounds of the preset.
    pub fn is_within_bounds(&self) -> bool {
        let (rel_l2, psnr_db) = self.bounds();
        self.errors.rel_l2 <= rel_l2 && self.errors.psnr_db >= psnr_db
    }

    /// Returns what is wrong if the error exceeds its bound without a warning that states it within a factor of three.
    pub fn broken_promise(&self) -> Option<String> {
        if self.is_within_bounds() {
            return None;
        }
        let Measured { preset, seed, errors, .. } = self;
        let found = format!("{preset}, seed {seed}: {:.1} %, {:.1} dB", 100.0 * errors.rel_l2, errors.psnr_db);
        let Some((rel_l2, psnr_db)) = self.stated else { return Some(format!("{found}, and nothing is stated")) };
        let (most, least_db) = self.bounds();
        let is_near = (errors.rel_l2 / 3.0..=errors.rel_l2 * 3.0).contains(&rel_l2);
        let admits = self.has_warnings && (rel_l2 > most || psnr_db < least_db);
        let says = if admits { "states" } else { "does not warn but states" };
        (!is_near || !admits).then(|| format!("{found}, {says} {:.1} %, {psnr_db:.1} dB", 100.0 * rel_l2))
    }

    /// Returns the stated over the true relative L2, if both are known.
    pub fn calibration(&self) -> Option<f64> {
        let (rel_l2, _) = self.stated.filter(|_| self.is_resolved)?;
        Some(rel_l2 / self.errors.rel_l2)
    }

    fn bounds(&self) -> (f64, f64) {
        let (_, rel_l2, psnr_db) = BOUNDS.into_iter().find(|(preset, ..)| *preset == self.preset).unwrap();
        (rel_l2, psnr_db)
    }
}
