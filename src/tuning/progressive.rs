//! A reference that is refined in the background. Batches of passes are averaged, and errors have error bars.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::base::Result;
use crate::effective::{EffectiveBrdf, ErrorEstimator};
use crate::metrics::{Pair, mirror_biased_pairs};
use crate::pipeline::{Outcome, Pipeline};
use crate::reference::ReferenceSettings;
use crate::scene::LoadedScene;

/// Mean of the batches that were added.
#[derive(Debug, Clone)]
pub struct ProgressiveReference {
    pairs: Vec<Pair>,
    sums: Vec<DVec3>,
    variances: Vec<DVec3>,
    pub batches: usize,
}

/// Errors of `f̄` against the reference, and the standard error of each.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ReferenceErrors {
    /// Relative L2 without the part that the standard error of the reference explains.
    pub rel_l2: f64,
    pub rel_l2_std_error: f64,
    pub psnr_db: f64,
    pub psnr_std_error_db: f64,
    /// Relative L2 of the standard errors of the reference.
    pub std_error: f64,
    pub batches: usize,
}

impl ReferenceErrors {
    /// Errors that a result states without a reference, or none if it states none. The standard error is half of the stated
    /// error.
    pub fn stated(outcome: &Outcome) -> Self {
        let estimate = outcome.errors().map(ErrorEstimator::estimate).unwrap_or_default();
        Self {
            rel_l2: estimate.rel_l2,
            rel_l2_std_error: 0.5 * estimate.rel_l2,
            psnr_db: estimate.psnr_db.unwrap_or(f64::INFINITY),
            psnr_std_error_db: 3.0,
            std_error: 0.0,
            batches: 0,
        }
    }

    /// Errors of values against a reference: its values and their variances. `batches` is at least 1.
    pub fn measured(values: &[Vec3], reference: impl Iterator<Item = (DVec3, DVec3)>, batches: usize) -> Self {
        let (mut squares, mut noise, mut spread, mut norm, mut peak) = (0.0, 0.0, 0.0, 0.0, 0.0_f64);
        for (value, (exact, variance)) in values.iter().zip(reference) {
            let difference = value.as_dvec3() - exact;
            squares += difference.length_squared();
            noise += variance.element_sum();
            // Var (x - r)² = 4 (x - r)² σ² + 2 σ⁴.
            spread += (4.0 * difference * difference * variance + 2.0 * variance * variance).element_sum();
            norm += exact.length_squared();
            peak = peak.max(exact.max_element());
        }
        if norm == 0.0 {
            return Self { batches, ..Self::default() };
        }
        let std_error = (noise / norm).sqrt();
        let rel_l2 = ((squares - noise).max(0.1 * noise).min(squares) / norm).sqrt().max(1e-9);
        let rel_l2_std_error = spread.sqrt() / norm / (2.0 * rel_l2);
        let peak_db = 20.0 * (peak / (norm / (3 * values.len()) as f64).sqrt()).log10();
        let db = |x: f64| 20.0 * x.log10();
        Self {
            rel_l2,
            rel_l2_std_error,
            psnr_db: peak_db - db(rel_l2),
            psnr_std_error_db: db(1.0 + rel_l2_std_error / rel_l2),
            std_error,
            batches,
        }
    }

    /// Returns true if no reference was used.
    pub fn is_stated(&self) -> bool {
        self.batches == 0
    }
}

/// Facets per pass.
const FACETS: usize = 4096;
/// Passes per batch.
const PASSES: usize = 4;

impl ProgressiveReference {
    pub fn new(pairs: usize) -> Self {
        let pairs = mirror_biased_pairs(pairs, 20_110_801);
        let zeros = vec![DVec3::ZERO; pairs.len()];
        Self { sums: zeros.clone(), variances: zeros, pairs, batches: 0 }
    }

    /// Adds a batch of passes.
    ///
    /// # Errors
    /// Returns the errors of [`Pipeline::with_reference`].
    pub fn refine(&mut self, pipeline: &mut Pipeline, loaded: &LoadedScene) -> Result<()> {
        let seed = 20_110_807 + self.batches as u64;
        let settings = ReferenceSettings { facets: FACETS, max_passes: PASSES, target: 0.0, seed };
        let batch =
            pipeline.with_reference(loaded, |reference| reference.estimate(&self.pairs, &settings, |_, _| true))?;
        for (estimate, (sum, variance)) in batch.iter().zip(self.sums.iter_mut().zip(&mut self.variances)) {
            let error = estimate.standard_error.as_dvec3();
            *sum += estimate.f_bar.as_dvec3();
            *variance += error * error;
        }
        self.batches += 1;
        Ok(())
    }

    /// Compares `f̄` of a BRDF with the mean of the batches.
    pub fn compare(&self, brdf: &EffectiveBrdf) -> ReferenceErrors {
        let values: Vec<Vec3> = self.pairs.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect();
        let n = self.batches.max(1) as f64;
        let reference = self.sums.iter().zip(&self.variances).map(|(sum, variance)| (*sum / n, *variance / (n * n)));
        ReferenceErrors::measured(&values, reference, self.batches)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_batches_narrow_the_error_bars_and_agree_with_fewer() {
        let loaded = crate::scene::open("fig4b_bicolor_cup", &["quality.facets=512".to_owned()]).unwrap();
        let mut pipeline = Pipeline::new();
        let brdf = pipeline.effective(&loaded).unwrap().brdf;
        let mut reference = ProgressiveReference::new(40);
        reference.refine(&mut pipeline, &loaded).unwrap();
        let first = reference.compare(&brdf);
        for _ in 0..3 {
            reference.refine(&mut pipeline, &loaded).unwrap();
        }
        let last = reference.compare(&brdf);
        assert!(
            last.std_error < 0.8 * first.std_error && last.rel_l2_std_error <= first.rel_l2_std_error,
            "{first:?} {last:?}"
        );
        assert!(
            (last.rel_l2 - first.rel_l2).abs() < 4.0 * first.rel_l2_std_error + 0.3 * last.rel_l2,
            "{first:?} {last:?}"
        );
        assert_eq!(last.batches, 4);
    }
}
