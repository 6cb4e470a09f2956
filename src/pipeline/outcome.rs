//! The results of the pipeline.

use std::sync::{Arc, OnceLock};

use glam::Vec3;

use super::Env;
use super::shading::{Shading, ShadingBrdf};
use super::stage::{Keyed, StageTimes, run_without_memo};
use super::stages::{ComputeVisibility, FacetsRole, SampleFacets, TileShape};
use crate::base::{Cancel, Result};
use crate::brdf::Material;
use crate::cache::{Cache, Key};
use crate::diagnostics::{Health, HealthInputs, Limits};
use crate::effective::{
    Direct, EffectiveBrdf, ErrorEstimator, FacetSum, PAIRS, Reflectance, Representation, SECOND_SAMPLE_DIVISOR,
};
use crate::metrics::Errors;
use crate::plan::{Plan, Settings, VisibilityAlgorithm};
use crate::scene::Scene;

/// The effective BRDF of a scene, and how it was computed.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub brdf: Arc<EffectiveBrdf>,
    pub plan: Plan,
    pub settings: Settings,
    /// The stages that ran this time.
    pub times: StageTimes,
    /// An upper bound of the errors of the low-rank representation against the direct sum, if it was tried.
    pub factored: Option<Errors>,
    pub notes: Vec<String>,
    /// The inputs of the health report.
    pub health_inputs: HealthInputs,
    /// The health report, once [`Outcome::health`] computed it.
    pub examined: Arc<OnceLock<Health>>,
    pub(super) shading: Arc<Shading>,
    /// The direct sum whose error is estimated; absent with the paper's method.
    pub(super) direct: Option<ExaminedSum>,
    pub(super) estimator: Arc<OnceLock<ErrorEstimator>>,
    /// True if the quick estimate was too close to the bound to rule refinement out, or if factors were asked for.
    pub(super) close_to_bound: bool,
}

/// A direct sum, and what a second sample of its surface needs.
#[derive(Debug, Clone)]
pub(super) struct ExaminedSum {
    pub direct: Direct,
    pub tile: Keyed<TileShape>,
    pub material_of_slot: Vec<usize>,
    pub algorithm: VisibilityAlgorithm,
    pub env: Env,
}

impl ExaminedSum {
    /// The sum over other facets of the same surface, fewer by [`SECOND_SAMPLE_DIVISOR`]. The memo keeps the facets of the
    /// result itself.
    fn second_sample(&self, settings: &Settings, materials: &[Material], cancel: &Cancel) -> Result<Direct> {
        /// Added to the seed, so that no scene is likely to ask for the facets of the second sample.
        const SEED_STEP: u64 = 0x9e37_79b9_7f4a_7c15;
        let Self { tile, material_of_slot, algorithm, .. } = self;
        let settings = Settings {
            facets: settings.facets.div_ceil(SECOND_SAMPLE_DIVISOR),
            seed: settings.seed.wrapping_add(SEED_STEP),
            ..settings.clone()
        };
        let mut env = self.env.clone();
        env.cancel = cancel.clone();
        let (disk, mut times) = (Cache::default(), StageTimes::new());
        let sample = SampleFacets { tile, settings: &settings, grid: None, role: FacetsRole::Main };
        let facets = Arc::new(run_without_memo(&sample, &env, &disk, &mut times)?);
        let facets = Keyed { key: Key::of_numbers(b"second sample"), value: facets };
        let (algorithm, settings) = (*algorithm, &settings);
        let visible = ComputeVisibility { tile, facets: &facets, algorithm, settings, refined: false, coarser: None };
        let visibility = run_without_memo(&visible, &env, &disk, &mut times)?;
        let mut sum = FacetSum::new(&facets, material_of_slot, materials);
        sum.force(&facets, &settings.effects);
        Ok(Direct::new(Arc::new(sum), Arc::new(visibility)))
    }
}

impl Outcome {
    /// The same outcome for a scene that differs only in its object and its lights.
    pub fn for_scene(mut self, scene: &Scene) -> Self {
        self.plan.decide_large_scale(scene);
        self
    }

    /// The same outcome for a caller that did not wait for it: without times.
    pub fn without_times(self) -> Self {
        Self { times: StageTimes::new(), ..self }
    }

    /// The representation that images read instead of [`Outcome::brdf`]: a table of it if that pays and is close
    /// enough. The first call computes it.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn shading_brdf(&self, cancel: &Cancel) -> Result<ShadingBrdf> {
        self.shading.get(cancel)
    }

    /// The result of [`Outcome::shading_brdf`], if it was computed.
    pub fn known_shading_brdf(&self) -> Option<Arc<EffectiveBrdf>> {
        self.shading.known()
    }

    /// Estimates the errors of the result, as [`Outcome::errors_unless`].
    pub fn errors(&self) -> Option<&ErrorEstimator> {
        self.errors_unless(&Cancel::default()).ok().flatten()
    }

    /// Estimates the errors of the result. The first call computes a second sample of the facets with their visibility, in
    /// about half of the time of the result, and examines some hundreds of direction pairs. `None` with the paper's method.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn errors_unless(&self, cancel: &Cancel) -> Result<Option<&ErrorEstimator>> {
        let Some(examined) = &self.direct else { return Ok(None) };
        if let Some(estimator) = self.estimator.get() {
            return Ok(Some(estimator));
        }
        let HealthInputs { facets, materials, .. } = &self.health_inputs;
        let is_low_rank = matches!(self.brdf.direct_representation(), Representation::LowRank(_));
        let table = self.factored.filter(|_| is_low_rank).map_or(0.0, |errors| errors.rel_l2);
        let slots = (&examined.material_of_slot[..], &materials.materials[..]);
        // Without replicates the facets are exact.
        let second = if facets.replicates.is_empty() {
            None
        } else {
            Some(examined.second_sample(&self.settings, &materials.materials, cancel)?)
        };
        let bounced = match &self.brdf.representation {
            Representation::Interreflecting(_, bounced) => Some((bounced.clone(), self.brdf.base_area)),
            _ => None,
        };
        let light = (bounced, self.plan.light_left_out);
        let new = || ErrorEstimator::new(&PAIRS, &examined.direct, facets, slots, second.as_ref(), table, light);
        Ok(Some(self.estimator.get_or_init(new)))
    }

    /// The health of the result. The first call measures it: some hundredths of a second at draft.
    pub fn health(&self) -> &Health {
        let errors = if self.close_to_bound { self.errors() } else { None };
        self.health_with(errors)
    }

    /// The health of the result, as [`Outcome::health`].
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`], if the error of the result has to be estimated.
    pub fn health_unless(&self, cancel: &Cancel) -> Result<&Health> {
        let errors = if self.close_to_bound { self.errors_unless(cancel)? } else { None };
        Ok(self.health_with(errors))
    }

    fn health_with(&self, errors: Option<&ErrorEstimator>) -> &Health {
        let (limits, estimate) = (limits(&self.settings), errors.map(ErrorEstimator::estimate));
        self.examined.get_or_init(|| Health::of(&self.brdf, &self.health_inputs, self.factored, estimate, limits))
    }
}

/// The settings that the health report needs.
pub(super) fn limits(settings: &Settings) -> Limits {
    let Settings { max_rank, tolerance, .. } = *settings;
    Limits { max_rank, tolerance, preset: settings.preset.name(), error: settings.error_bound() }
}

impl Reflectance for Outcome {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        self.brdf.eval_lights(lights, o, out);
    }

    fn eval_direct(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) -> bool {
        self.brdf.eval_direct(lights, o, out)
    }

    fn eval_bounced(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        self.brdf.eval_bounced(lights, o, out);
    }
}
