//! Numbers of direction pairs of an estimate.

use glam::DVec3;
use rayon::prelude::*;

use crate::metrics::{Pair, mirror_biased_pairs};

/// Numbers of direction pairs that an estimate for a whole BRDF examines.
pub(crate) const PAIRS: PairCount = PairCount { min: 200, min_effective: 16.0, max_for_errors: 800 };
/// Those of an estimate on which refinement decides, which is quick.
pub(crate) const FEW_PAIRS: PairCount = PairCount { max_for_errors: 0, ..PAIRS };
/// Most pairs of an estimate.
const MAX_PAIRS: usize = 6400;
/// Seed of these pairs.
pub(super) const PAIRS_SEED: u64 = 20_261_123;

/// Errors of visibility above this relative L2 are examined at more pairs until their effective number is this large: few grazing
/// pairs may hold most of the error of a surface.
const LEAST_ERROR: f64 = 0.01;
const MIN_EFFECTIVE_ERRORS: f64 = 16.0;

/// The sum of squares and the effective number of values, `(Σ|x|²)² / Σ|x|⁴`.
fn spread(values: impl Iterator<Item = DVec3>) -> (f64, f64) {
    let (mut norm, mut squares) = (0.0, 0.0);
    for value in values.map(DVec3::length_squared) {
        norm += value;
        squares += value * value;
    }
    (norm, if squares > 0.0 { norm * norm / squares } else { 0.0 })
}

/// Number of direction pairs of an estimate. It is doubled while few pairs hold most of the sum of squares, such as those
/// that see the bottom of deep grooves.
pub(crate) struct PairCount {
    pub min: usize,
    /// Smallest effective number of the values of `f̄`.
    pub min_effective: f64,
    /// Most pairs that are examined because few hold most of the error.
    pub max_for_errors: usize,
}

impl PairCount {
    /// Evaluates `of` at enough pairs. `f_bar` and `error` return `f̄` of an evaluation and its error.
    pub fn evaluate<T: Send>(
        &self,
        of: impl Fn(Pair) -> T + Sync,
        f_bar: impl Fn(&T) -> DVec3,
        error: impl Fn(&T) -> DVec3,
    ) -> Vec<T> {
        let mut all: Vec<T> = Vec::new();
        let mut count = self.min;
        loop {
            let pairs = mirror_biased_pairs(count, PAIRS_SEED);
            all.par_extend(pairs[all.len()..].par_iter().map(|&pair| of(pair)));
            let (norm, effective) = spread(all.iter().map(&f_bar));
            let (squared_error, effective_errors) = spread(all.iter().map(&error));
            let is_small = squared_error <= LEAST_ERROR * LEAST_ERROR * norm;
            let is_known = is_small || effective_errors >= MIN_EFFECTIVE_ERRORS || count >= self.max_for_errors;
            if is_known && effective >= self.min_effective || count >= MAX_PAIRS {
                return all;
            }
            count *= 2;
        }
    }
}
