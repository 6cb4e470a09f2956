//! What every format asks of the effective BRDF: many directions in parallel, with progress, and a check of what a reader
//! of the finished table gets.

use std::io;

use glam::Vec3;
use rayon::prelude::*;

use crate::base::{Progress, progress};
use crate::effective::EffectiveBrdf;
use crate::metrics::{Errors, compare, mirror_biased_pairs};

/// Pairs of the reading error, and the seed that fixes them.
const CHECKED_PAIRS: usize = 400;
const CHECKED_SEED: u64 = 2011;

/// [`progress::in_parallel`] where a file is being written.
///
/// # Errors
/// [`crate::base::Error::Cancelled`], inside, when `progress` says so.
pub fn in_parallel<T: Send>(
    count: usize,
    progress: &Progress<'_>,
    work: impl Fn(usize) -> T + Sync,
) -> io::Result<Vec<T>> {
    progress::in_parallel(count, progress, work).map_err(io::Error::other)
}

/// How far what a reader gets is from the function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadingError {
    /// `‖read - eval‖ / ‖eval‖` and PSNR on `f̄`, all channels.
    pub errors: Errors,
    /// Mean of `|read - eval|` over the mean of `eval`.
    pub mean: f64,
}

/// Compares `read(i, o)`, an `f̄` as a program that loads the file gets it, with `eval`, over a fixed set of pairs up to 85°.
pub fn reading_error(brdf: &EffectiveBrdf, read: impl Fn(Vec3, Vec3) -> Vec3 + Sync) -> ReadingError {
    let pairs = mirror_biased_pairs(CHECKED_PAIRS, CHECKED_SEED);
    let values: Vec<(Vec3, Vec3)> =
        pairs.par_iter().map(|pair| (read(pair.i, pair.o), brdf.eval(pair.i, pair.o))).collect();
    let (found, exact): (Vec<Vec3>, Vec<Vec3>) = values.into_iter().unzip();
    let sum = |of: &dyn Fn(usize) -> Vec3| (0..exact.len()).map(|k| f64::from(of(k).element_sum())).sum::<f64>();
    let total = sum(&|k| exact[k]);
    let mean = if total > 0.0 { sum(&|k| (found[k] - exact[k]).abs()) / total } else { 0.0 };
    ReadingError { errors: compare(&found, &exact), mean }
}
