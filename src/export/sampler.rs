//! Parallel evaluation of the effective BRDF for all formats, with progress, and the error of reading a table back.

use std::io;

use glam::Vec3;
use rayon::prelude::*;

use crate::base::finite::Numbers;
use crate::base::{Progress, progress, require_finite};
use crate::effective::EffectiveBrdf;
use crate::metrics::{Errors, compare, mirror_biased_pairs};

/// Number of pairs over which the reading error is measured.
const CHECKED_PAIRS: usize = 400;
/// Seed of these pairs.
const CHECKED_SEED: u64 = 2011;

/// Calls [`progress::in_parallel`], checks that the results are finite, and converts the error to [`io::Error`]. All
/// values of all formats come from here.
///
/// # Errors
/// An error that contains [`crate::base::Error::Cancelled`] if `progress` cancels, or the error of [`require_finite`].
pub fn in_parallel<T: Numbers + Send>(
    count: usize,
    progress: &Progress<'_>,
    work: impl Fn(usize) -> T + Sync,
) -> io::Result<Vec<T>> {
    let results = progress::in_parallel(count, progress, work).map_err(io::Error::other)?;
    require_finite(&results).map_err(io::Error::other)?;
    Ok(results)
}

/// The error of a table as a program reads it, against the effective BRDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadingError {
    /// `‖read - eval‖ / ‖eval‖` and PSNR of `f̄`, over all channels.
    pub errors: Errors,
    /// Mean of `|read - eval|` divided by the mean of `eval`.
    pub mean: f64,
}

/// Compares `read(i, o)` with `eval` over a fixed set of pairs up to 85° from the normal. `read` returns `f̄` as a
/// program that loads the file interpolates it.
pub fn reading_error(brdf: &EffectiveBrdf, read: impl Fn(Vec3, Vec3) -> Vec3 + Sync) -> ReadingError {
    let pairs = mirror_biased_pairs(CHECKED_PAIRS, CHECKED_SEED);
    let values: Vec<(Vec3, Vec3)> =
        pairs.par_iter().map(|pair| (read(pair.i, pair.o), brdf.eval(pair.i, pair.o))).collect();
    let (tabulated, exact): (Vec<Vec3>, Vec<Vec3>) = values.into_iter().unzip();
    let sum = |value: &dyn Fn(usize) -> Vec3| (0..exact.len()).map(|k| f64::from(value(k).element_sum())).sum::<f64>();
    let total = sum(&|k| exact[k]);
    let mean = if total > 0.0 { sum(&|k| (tabulated[k] - exact[k]).abs()) / total } else { 0.0 };
    ReadingError { errors: compare(&tabulated, &exact), mean }
}
