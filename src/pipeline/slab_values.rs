//! Values of slabs at direction pairs.

use glam::{DVec3, Vec3};

use super::{Pipeline, SlabOutcome};
use crate::base::{Cancel, InputError, Result};
use crate::diagnostics::Health;
use crate::plan::{Preset, Settings};
use crate::reference::photons::{PairSettings, PairTruth};
use crate::scene::{LoadedScene, Switch};
use crate::slab::Method;

/// `f̄` of pairs with their standard errors, which are empty unless the values are a reference.
pub struct SlabValues {
    pub values: Vec<Vec3>,
    pub errors: Vec<Vec3>,
    pub representation: String,
    pub health: Health,
}

/// Standard error over the value at which the photons of a pair end.
pub const PHOTON_TARGET: f64 = 5e-3;

impl Pipeline {
    /// Evaluates the slab of a scene at pairs of directions towards the light and the viewer, on any side.
    ///
    /// # Errors
    /// As [`Pipeline::slab`].
    pub fn slab_values(&self, loaded: &LoadedScene, pairs: &[(DVec3, DVec3)]) -> Result<SlabValues> {
        if Settings::of(&loaded.scene).preset == Preset::Reference {
            return self.slab_reference(loaded, pairs, PHOTON_TARGET);
        }
        let outcome = self.slab(loaded)?;
        let values = outcome.eval_pairs(pairs, &self.env.cancel)?;
        let representation = outcome.describe();
        Ok(SlabValues { values, errors: Vec::new(), representation, health: outcome.health })
    }

    /// Estimates `f̄` of pairs by photons through random facets, until the standard error over the value is `target` or the
    /// photons of the settings are used.
    ///
    /// # Errors
    /// As [`Pipeline::slab`], or the slab has no faces.
    pub fn slab_reference(&self, loaded: &LoadedScene, pairs: &[(DVec3, DVec3)], target: f64) -> Result<SlabValues> {
        require_faces(loaded, "the quality `reference`")?;
        let outcome = self.slab_of_faces(loaded)?;
        let slab = &outcome.slab;
        let settings = PairSettings {
            walks: outcome.settings.reference_walks,
            target,
            bounces: loaded.scene.slab.as_ref().is_some_and(|slab| slab.bounces == Switch::On),
            seed: outcome.settings.seed,
        };
        let truth = PairTruth::of_pairs((&slab.top, &slab.bottom), &slab.optics, pairs, &settings, &self.env.cancel)?;
        let (values, errors) = truth.iter().map(|pair| (pair.f_bar.as_vec3(), pair.standard_error.as_vec3())).unzip();
        let representation = "photons through random facets of both faces".to_owned();
        Ok(SlabValues { values, errors, representation, health: outcome.health })
    }
}

impl SlabOutcome {
    /// `f̄` at pairs of directions towards the light and the viewer, on any side.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn eval_pairs(&self, pairs: &[(DVec3, DVec3)], cancel: &Cancel) -> Result<Vec<Vec3>> {
        cancel.map("pairs", pairs.len(), |k| self.slab.eval(pairs[k].0, pairs[k].1).as_vec3())
    }

    /// The slab in words.
    pub fn describe(&self) -> String {
        let slab = &self.slab;
        if let Some(captured) = &slab.captured {
            return format!("captured sheet: mean over its pixels, {} representatives", captured.len());
        }
        let method = match slab.method {
            Method::Dual => "dual-microfacet model".to_owned(),
            Method::Faces => format!("sum over {} facets", self.settings.facets.max(1)),
        };
        format!("{method}; top: {}; bottom: {}; alpha {:.2}", slab.top.describe(), slab.bottom.describe(), slab.alpha)
    }
}

/// Checks that photons and facets are asked for only if the slab has faces.
///
/// # Errors
/// The scene shows a captured sheet.
pub fn require_faces(loaded: &LoadedScene, asked: &str) -> Result<()> {
    if loaded.scene.slab.as_ref().is_some_and(|slab| slab.svbtdf.is_some()) {
        let expected = "the mean of its pixels: a captured sheet has no faces";
        return Err(InputError::new("slab.svbtdf", format!("a captured sheet and {asked}"), expected).into());
    }
    Ok(())
}
