//! The comparison of a substitute for an effective BRDF with the BRDF itself, at pairs of directions as in images.

use glam::Vec3;
use rayon::prelude::*;

use crate::effective::EffectiveBrdf;
use crate::metrics::{Errors, Pair, compare, image_pairs, upper_errors};
use crate::plan::IMAGE_CHECK_PAIRS;

/// Pairs of directions distributed as in images, and the BRDF there.
pub(super) struct Check {
    seed: u64,
    pub pairs: Vec<Pair>,
    exact: Vec<Vec3>,
}

/// Errors that a check found, and their upper bound for similar pairs.
#[derive(Debug, Clone, Copy)]
pub(super) struct CheckedErrors {
    pub found: Errors,
    pub upper: Errors,
}

impl Check {
    pub fn new(exact: &EffectiveBrdf, seed: u64) -> Self {
        let mut check = Self { seed: seed ^ 0x7ab1e, pairs: Vec::new(), exact: Vec::new() };
        check.grow(exact, IMAGE_CHECK_PAIRS);
        check
    }

    /// Adds pairs until there are `count`. Those before stay the first ones.
    pub fn grow(&mut self, exact: &EffectiveBrdf, count: usize) {
        let before = self.pairs.len();
        self.pairs = image_pairs(count, self.seed);
        self.exact.extend(values(exact, &self.pairs[before..]));
    }

    pub fn errors(&self, brdf: &EffectiveBrdf) -> CheckedErrors {
        let values = values(brdf, &self.pairs);
        CheckedErrors { found: compare(&values, &self.exact), upper: upper_errors(&values, &self.exact) }
    }
}

fn values(brdf: &EffectiveBrdf, pairs: &[Pair]) -> Vec<Vec3> {
    pairs.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect()
}
