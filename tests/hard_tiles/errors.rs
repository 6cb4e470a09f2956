//! True errors of f̄ beside the errors that the program states.

use biscale::metrics::{Errors, Pair, compare};
use biscale::pipeline::Pipeline;
use biscale::scene::LoadedScene;
use glam::Vec3;
use rayon::prelude::*;

use super::TrueValues;

/// Seed of the pairs, which `biscale report` uses as well.
pub const PAIRS_SEED: u64 = 20_110_801;

/// Errors of one scene at one preset and seed.
#[derive(Debug, Clone)]
pub struct Measured {
    /// Without the standard error of the true values, which is subtracted in squares.
    pub errors: Errors,
    /// Relative L2 that the program states.
    pub stated: f64,
    /// True if the program warns of its error.
    pub warns: bool,
    /// True if the true values resolve the error: it exceeds twice their standard error.
    pub is_resolved: bool,
}

/// Computes f̄ at a preset and compares it with the true values.
pub fn measure(loaded: &LoadedScene, preset: &str, seed: u64, pairs: &[Pair], truth: &TrueValues) -> Measured {
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
    let stated = outcome.errors().unwrap().estimate().rel_l2;
    let warns = outcome.health().warnings.iter().any(|warning| warning.contains("the stated error is"));
    let is_resolved = found.rel_l2 > 2.0 * truth.std_error;
    Measured { errors: Errors { rel_l2, psnr_db }, stated, warns, is_resolved }
}
