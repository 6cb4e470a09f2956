//! The factored form: tried where the plan expects it to pay, kept where it is close to the direct sum.

use glam::Vec3;
use rayon::prelude::*;

use super::stage::Version;
use super::{Pipeline, StageTimes};
use crate::base::Result;
use crate::effective::{Direct, EffectiveBrdf, Factors, LowRank, Material, Representation, VisibilityRows};
use crate::geometry::Facets;
use crate::metrics::{Errors, Pair, mirror_biased_pairs, upper_errors};
use crate::plan::{Method, Settings};

/// Pairs that the factored form is checked on.
const CHECK_PAIRS: usize = 256;

/// What the factors are made from.
pub(super) struct Source<'a> {
    pub facets: &'a Facets,
    pub material_of_slot: &'a [usize],
    pub materials: &'a [Material],
    /// Whether normals may point anywhere, as under overhangs.
    pub whole_sphere: bool,
    pub base_area: f64,
    /// Of facets and visibility.
    pub versions: [Version; 2],
}

/// Factors, kept or given up.
#[derive(Debug, Clone)]
pub(super) enum Made {
    Whole(LowRank),
    /// No more of the tables than the check reads.
    Trial(LowRank),
}

impl Made {
    pub(super) fn recolored(&self, materials: &[Material]) -> Self {
        match self {
            Self::Whole(factors) => Self::Whole(factors.recolored(materials)),
            Self::Trial(factors) => Self::Trial(factors.recolored(materials)),
        }
    }
}

/// The effective BRDF, factored or not.
pub(super) struct Factored {
    pub brdf: EffectiveBrdf,
    /// Absent where they were not worth making.
    pub factors: Option<Made>,
    /// How far the factors are from the direct sum, or what they were not made for.
    pub errors: Option<Errors>,
}

/// What the factored form is checked against: the direct sum at pairs that few highlights escape.
struct FactorCheck {
    direct: EffectiveBrdf,
    pairs: Vec<Pair>,
    exact: Vec<Vec3>,
}

impl FactorCheck {
    fn new(direct: Direct, base_area: f64, seed: u64) -> Self {
        let direct = EffectiveBrdf { form: Representation::Direct(direct), base_area };
        let pairs = mirror_biased_pairs(CHECK_PAIRS, seed ^ 0x5eed);
        let exact = pairs.par_iter().map(|pair| direct.eval(pair.i, pair.o)).collect();
        Self { direct, pairs, exact }
    }

    fn errors(&self, factored: &EffectiveBrdf) -> Errors {
        let values: Vec<Vec3> = self.pairs.par_iter().map(|pair| factored.eval(pair.i, pair.o)).collect();
        upper_errors(&values, &self.exact)
    }

    /// Those of reading visibility between the nodes of `rows`, as factors do, with exact lobes: factors add theirs to it.
    fn errors_of_visibility(&self, rows: &VisibilityRows) -> Errors {
        let Representation::Direct(direct) = &self.direct.form else { return self.errors(&self.direct) };
        let values: Vec<Vec3> = self.pairs.par_iter().map(|pair| direct.seen_between(rows, pair.i, pair.o)).collect();
        upper_errors(&values, &self.exact)
    }
}

impl Pipeline {
    /// The factored form where it is close to the direct sum, else the direct sum. `made` are factors that still hold.
    pub(super) fn factored(
        &mut self,
        direct: Direct,
        of: &Source,
        made: Option<Made>,
        settings: &Settings,
    ) -> Result<Factored> {
        let knobs = settings.low_rank(of.whole_sphere);
        let visibility = direct.visibility.clone();
        let check = FactorCheck::new(direct, of.base_area, settings.seed);
        let forced = settings.method == Method::LowRank;
        let close = |errors: Errors| errors.rel_l2 <= settings.tolerance && errors.psnr_db >= settings.tolerance_db;
        let held = |factors: &LowRank| EffectiveBrdf {
            form: Representation::LowRank(factors.clone()),
            base_area: of.base_area,
        };
        let whole = match made {
            Some(Made::Whole(factors)) => factors,
            made => {
                let key = (of.versions, knobs.directions);
                let (rows, _) = self.rows.get("rows", key, &mut StageTimes::new(), &self.cancel, || {
                    Ok(VisibilityRows::new(&visibility, 0..of.facets.len(), knobs.directions))
                })?;
                let factored = || Factors::new(of.facets, &rows, of.material_of_slot, of.materials, &knobs);
                if forced {
                    factored()?.tabulate()
                } else {
                    // What is told before the factors, and before their tables, spares them where they would not serve.
                    let least = check.errors_of_visibility(&rows);
                    if !close(least) {
                        return Ok(Factored { brdf: check.direct, factors: made, errors: Some(least) });
                    }
                    let (trial, factors) = match made {
                        Some(Made::Trial(trial)) => (trial, None),
                        _ => {
                            let factors = factored()?;
                            (factors.tabulate_for(check.pairs.iter().map(|pair| (pair.i, pair.o))), Some(factors))
                        }
                    };
                    self.cancel.check()?;
                    let tried = check.errors(&held(&trial));
                    if !close(tried) {
                        let factors = Some(Made::Trial(trial));
                        return Ok(Factored { brdf: check.direct, factors, errors: Some(tried) });
                    }
                    factors.map_or_else(factored, Ok)?.tabulate()
                }
            }
        };
        let brdf = held(&whole);
        let errors = check.errors(&brdf);
        let brdf = if forced || close(errors) { brdf } else { check.direct };
        Ok(Factored { brdf, factors: Some(Made::Whole(whole)), errors: Some(errors) })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::effective::FacetSum;

    #[test]
    fn factors_are_tried_no_further_than_shows_that_they_would_not_serve() {
        let loaded = crate::scene::open("fig8d_leather", &["quality.preset=draft".to_owned()]).unwrap();
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let (facets, materials) = (&outcome.evidence.facets, &outcome.evidence.materials);
        let Representation::Direct(made) = &outcome.brdf.form else { panic!("not a sum") };
        let of = Source {
            facets,
            material_of_slot: &materials.0,
            materials: &materials.1,
            whole_sphere: false,
            base_area: outcome.brdf.base_area,
            versions: [1, 1],
        };
        let mut pipeline = Pipeline::new();
        let mut with = |tolerance: f64, made_before: Option<Made>| {
            let sum = FacetSum::new(facets, &materials.0, &materials.1);
            let direct = Direct::new(Arc::new(sum), made.visibility.clone());
            let settings = Settings { tolerance, tolerance_db: 0.0, ..outcome.settings.clone() };
            pipeline.factored(direct, &of, made_before, &settings).unwrap()
        };
        let error = |factored: &Factored| factored.errors.unwrap().rel_l2;
        let seen = with(0.0, None);
        assert!(seen.factors.is_none() && error(&seen) > 0.0);
        let whole = with(1.0, None);
        assert!(matches!((&whole.brdf.form, &whole.factors), (Representation::LowRank(_), Some(Made::Whole(_)))));
        // Visibility alone is a part of what factors are off.
        assert!(error(&seen) < error(&whole), "{} {}", error(&seen), error(&whole));
        let tried = with(0.5 * (error(&seen) + error(&whole)), None);
        assert!(matches!((&tried.brdf.form, &tried.factors), (Representation::Direct(_), Some(Made::Trial(_)))));
        assert!((error(&tried) - error(&whole)).abs() < 1e-4 * error(&whole), "{} {}", error(&tried), error(&whole));
        // A colour edit judges the same trial again, and makes the rest of it where it serves now.
        let later = with(1.0, tried.factors.map(|factors| factors.recolored(&materials.1)));
        assert!(matches!(later.factors, Some(Made::Whole(_))));
        assert!((error(&later) - error(&whole)).abs() < 1e-6, "{} {}", error(&later), error(&whole));
    }
}
