//! The low-rank representation: tried if the plan expects it to pay, taken if it is close to the direct sum.

use glam::Vec3;
use rayon::prelude::*;

use super::stage::{Keyed, Stage};
use super::stages::{Factorize, LookUpVisibility, TabulateFactors, TabulateForCheck};
use super::{Pipeline, StageTimes};
use crate::base::Result;
use crate::brdf::Material;
use crate::cache::Key;
use crate::effective::{Direct, EffectiveBrdf, Factors, LowRank, Representation, VisibilityRows};
use crate::geometry::Facets;
use crate::metrics::{Errors, Pair, mirror_biased_pairs, upper_errors};
use crate::plan::{ProductMethod, Settings};
use crate::visibility::Visibility;

/// Pairs on which the low-rank representation is compared with the direct sum.
const CHECK_PAIRS: usize = 256;

/// The inputs of the factors.
pub(super) struct FactorInputs<'a> {
    pub facets: &'a Keyed<Facets>,
    pub visibility: &'a Keyed<Visibility>,
    pub material_of_slot: &'a [usize],
    pub materials: &'a [Material],
    /// The key of the lobes of all materials and of their slots.
    pub lobes: Key,
    /// True if normals may point anywhere, as under overhangs.
    pub whole_sphere: bool,
    pub base_area: f64,
}

/// The direct sum at pairs that few highlights escape.
struct FactorCheck {
    direct: EffectiveBrdf,
    pairs: Vec<Pair>,
    exact: Vec<Vec3>,
}

impl FactorCheck {
    fn new(direct: Direct, base_area: f64, seed: u64) -> Self {
        let direct = EffectiveBrdf { representation: Representation::Direct(direct), base_area };
        let pairs = mirror_biased_pairs(CHECK_PAIRS, seed ^ 0x5eed);
        let exact = pairs.par_iter().map(|pair| direct.eval(pair.i, pair.o)).collect();
        Self { direct, pairs, exact }
    }

    fn errors(&self, low_rank: &EffectiveBrdf) -> Errors {
        let values: Vec<Vec3> = self.pairs.par_iter().map(|pair| low_rank.eval(pair.i, pair.o)).collect();
        upper_errors(&values, &self.exact)
    }

    /// The errors of interpolating visibility between the nodes of `rows` with exact lobes. Factors add to them.
    fn errors_of_visibility(&self, rows: &VisibilityRows) -> Errors {
        let Representation::Direct(direct) = &self.direct.representation else { return self.errors(&self.direct) };
        let value = |pair: &Pair| direct.eval_interpolated(rows, pair.i, pair.o);
        let values: Vec<Vec3> = self.pairs.par_iter().map(value).collect();
        upper_errors(&values, &self.exact)
    }
}

impl Pipeline {
    /// Frees the factors and their tables.
    pub(super) fn forget_low_rank(&self) {
        for name in [LookUpVisibility::NAME, Factorize::NAME, TabulateForCheck::NAME, TabulateFactors::NAME] {
            self.memo.forget(name);
        }
    }

    /// The low-rank representation if it is close to the direct sum or asked for, else the direct sum; and the errors
    /// of the last step of the low-rank representation that was computed.
    pub(super) fn low_rank(
        &self,
        direct: Direct,
        inputs: &FactorInputs<'_>,
        settings: &Settings,
    ) -> Result<(EffectiveBrdf, Errors)> {
        let low_rank_settings = settings.low_rank(inputs.whole_sphere);
        let check = FactorCheck::new(direct, inputs.base_area, settings.seed);
        let forced = settings.method == ProductMethod::LowRank;
        let is_close = |errors: Errors| errors.rel_l2 <= settings.tolerance && errors.psnr_db >= settings.tolerance_db;
        let with_tables = |tables: &LowRank| EffectiveBrdf {
            representation: Representation::LowRank(tables.recolored(inputs.materials)),
            base_area: inputs.base_area,
        };
        // The caller times all of this as one stage.
        let times = &mut StageTimes::new();
        let FactorInputs { facets, visibility, material_of_slot, materials, lobes, .. } = *inputs;
        let directions = low_rank_settings.directions;
        let rows = self.get(LookUpVisibility { facets, visibility, directions }, times)?;
        if !forced {
            // Skip the factorization if interpolating visibility alone exceeds the tolerance.
            let errors = check.errors_of_visibility(&rows);
            if !is_close(errors) {
                return Ok((check.direct, errors));
            }
        }
        let settings = &low_rank_settings;
        let factors: Keyed<Factors> =
            self.get(Factorize { facets, rows: &rows, lobes, material_of_slot, materials, settings }, times)?;
        let known = self.memo.known(&TabulateFactors { factors: &factors });
        if !forced && known.is_none() {
            // Skip the tables over all pairs if the tables at the pairs of the check exceed the tolerance.
            let tables = self.get(TabulateForCheck { factors: &factors, pairs: &check.pairs }, times)?;
            let errors = check.errors(&with_tables(&tables));
            if !is_close(errors) {
                return Ok((check.direct, errors));
            }
        }
        let tables = self.get(TabulateFactors { factors: &factors }, times)?;
        // These tables are as large as the full ones.
        self.memo.forget(TabulateForCheck::NAME);
        let brdf = with_tables(&tables);
        let errors = check.errors(&brdf);
        Ok((if forced || is_close(errors) { brdf } else { check.direct }, errors))
    }
}
