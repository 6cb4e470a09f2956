//! What the pipeline hands out.

use std::sync::{Arc, OnceLock};

use glam::Vec3;

use super::ShadingBrdf;
use super::StageTimes;
use super::images::Images;
use crate::base::{Cancel, Result};
use crate::diagnostics::{Health, HealthInputs, Limits};
use crate::effective::{EffectiveBrdf, Reflectance};
use crate::metrics::Errors;
use crate::plan::{Plan, Settings};

/// What the stages made of a scene.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub brdf: Arc<EffectiveBrdf>,
    pub plan: Plan,
    pub settings: Settings,
    /// What ran this time.
    pub times: StageTimes,
    /// What the factored form's error against the direct sum stays below, where it was tried.
    pub factored: Option<Errors>,
    pub notes: Vec<String>,
    /// What the health is measured from.
    pub evidence: HealthInputs,
    /// The health, once it was asked for: see [`Outcome::health`].
    pub examined: Arc<OnceLock<Health>>,
    pub(super) images: Arc<Images>,
}

impl Outcome {
    /// The same, as whoever did not have to wait for it sees it.
    pub fn without_times(self) -> Self {
        Self { times: StageTimes::new(), ..self }
    }

    /// What pictures read instead of [`Outcome::brdf`]: a table of it where that pays and is close enough. The first call
    /// makes it.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn shading_brdf(&self, cancel: &Cancel) -> Result<ShadingBrdf> {
        self.images.get(cancel)
    }

    /// What [`Outcome::shading_brdf`] made, if it was asked before.
    pub fn known_shading_brdf(&self) -> Option<Arc<EffectiveBrdf>> {
        self.images.made()
    }

    /// How sound the result is. Measured when first asked for: some hundredths of a second at draft.
    pub fn health(&self) -> &Health {
        let limits = limits(&self.settings);
        self.examined.get_or_init(|| Health::of(&self.brdf, &self.evidence, self.factored, limits))
    }
}

/// What an examination needs to know of the settings.
pub(super) fn limits(settings: &Settings) -> Limits {
    Limits { max_rank: settings.max_rank, tolerance: settings.tolerance }
}

impl Reflectance for Outcome {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        self.brdf.eval_lights(lights, o, out);
    }
}
