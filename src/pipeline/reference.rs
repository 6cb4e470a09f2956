//! The reference of a scene.

use super::inputs::Processor;
use super::slab::refuse_slab;
use super::{Pipeline, StageTimes};
use crate::base::Result;
use crate::metrics::Pair;
use crate::plan::Settings;
use crate::reference::{Estimate, Reference, ReferenceSettings};
use crate::scene::{LoadedScene, Switch};

impl Pipeline {
    /// Estimates `f̄` of pairs by ray casting, until the relative standard error is `target`, by default that of the settings, or
    /// their passes are done. `progress` receives the number of passes and the error, and returns false to stop.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn reference(
        &self,
        loaded: &LoadedScene,
        pairs: &[Pair],
        target: Option<f64>,
        progress: impl FnMut(usize, f64) -> bool,
    ) -> Result<Vec<Estimate>> {
        let settings = Settings::from_quality(&loaded.scene.quality);
        let settings = ReferenceSettings {
            facets: settings.reference_facets,
            max_passes: settings.reference_passes,
            target: target.unwrap_or(settings.reference_target),
            seed: settings.seed,
        };
        let estimates = self.with_reference(loaded, |reference| reference.estimate(pairs, &settings, progress))?;
        self.env.cancel.check()?;
        Ok(estimates)
    }

    /// Calls `work` with a reference evaluator of the scene.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn with_reference<T>(&self, loaded: &LoadedScene, work: impl FnOnce(&Reference<'_>) -> T) -> Result<T> {
        refuse_slab(loaded, "this computation")?;
        let mut times = StageTimes::new();
        let tile = self.tile(loaded, &mut times)?;
        let assignment = self.assignment(loaded, &tile, &mut times)?;
        let bounces = if self.interreflects(loaded)? { loaded.scene.effects.bounces } else { 0 };
        let reference = Reference::new(&tile.mesh, &assignment.material_of_slot, &assignment.materials);
        Ok(work(&reference.with_bounces(bounces).with_cancel(self.env.cancel.clone())))
    }
    /// Returns true if the result of the scene holds light that facets send to each other.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn interreflects(&self, loaded: &LoadedScene) -> Result<bool> {
        let processor = Processor::Gpu { max_facets: None };
        Ok(self.tile_inputs(loaded, processor, &mut StageTimes::new())?.plan.interreflection.is_some())
    }

    /// The scene with its own decision on interreflection forced, so that every preset computes the same light.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn with_same_light(&self, loaded: &LoadedScene) -> Result<LoadedScene> {
        let mut same = loaded.clone();
        same.scene.effects.interreflection = if self.interreflects(loaded)? { Switch::On } else { Switch::Off };
        Ok(same)
    }
}
