//! The results of the pipeline.

use std::sync::{Arc, OnceLock};

use glam::Vec3;

use super::shading::{Shading, ShadingBrdf};
use super::stage::StageTimes;
use crate::base::{Cancel, Result};
use crate::diagnostics::{Health, HealthInputs, Limits};
use crate::effective::{Direct, EffectiveBrdf, ErrorEstimator, Reflectance, Representation};
use crate::metrics::Errors;
use crate::plan::{Plan, Settings};

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
    /// The direct sum and the materials of its slots, from which errors are estimated; absent with the paper's method.
    pub(super) direct: Option<(Direct, Vec<usize>)>,
    pub(super) estimator: Arc<OnceLock<ErrorEstimator>>,
    /// The error may exceed what the preset allows: its estimate decided whether the result was refined, or factors were asked
    /// for.
    pub(super) close_to_bound: bool,
}

impl Outcome {
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

    /// Estimates the errors of the result. The first call examines some dozens of direction pairs. `None` with the paper's
    /// method. Interreflection and the sampling of its rays are not examined.
    pub fn errors(&self) -> Option<&ErrorEstimator> {
        let (direct, material_of_slot) = self.direct.as_ref()?;
        Some(self.estimator.get_or_init(|| {
            let HealthInputs { facets, materials, .. } = &self.health_inputs;
            let is_low_rank = matches!(self.brdf.direct_representation(), Representation::LowRank(_));
            let table = self.factored.filter(|_| is_low_rank).map_or(0.0, |errors| errors.rel_l2);
            ErrorEstimator::new(direct, facets, material_of_slot, &materials.materials, table)
        }))
    }

    /// The health of the result. The first call measures it: some hundredths of a second at draft.
    pub fn health(&self) -> &Health {
        let limits = limits(&self.settings);
        let estimate = self.close_to_bound.then(|| self.errors()).flatten().map(ErrorEstimator::estimate);
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
}
