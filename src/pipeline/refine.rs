//! Refinement: facets, azimuths and the sharpness of shadows are raised until the estimated error of the direct sum is
//! within the bound of the preset. Rays and directions of the light between facets follow a bound of their own.

use std::sync::Arc;
use std::time::Instant;

use super::inputs::{Processor, TileInputs};
use super::stage::add_time;
use super::{Keyed, Pipeline, StageTimes, VisibleSurface};
use crate::base::Result;
use crate::effective::{
    Direct, ErrorBound, ErrorEstimate, ErrorEstimator, FEW_PAIRS, PairValues, estimate_of_bounced, quick_estimate,
};
use crate::interreflection::{InterreflectionSettings, InterreflectionTable};
use crate::plan::{Preset, Refinement, Settings, finer_interreflection};
use crate::scene::LoadedScene;
use crate::visibility::Visibility;

/// A quick estimate below this part of the bound ends the search. It examines few pairs, so that the highest of them
/// may be missing, and so may pairs of nearly equal directions. Light from a rare part of the surface reaches few pairs, so
/// that no quick estimate is made.
const QUICK_PART: f64 = 0.65;

/// A direct sum with the results that it was computed from.
pub(super) struct RefinedSum {
    pub inputs: TileInputs,
    pub visibility: Keyed<Visibility>,
    pub direct: Direct,
    /// The estimate from the replicates of this sum, if its error was close to the bound.
    pub estimate: Option<ErrorEstimate>,
    /// Values of this sum that its quick estimate found.
    pub values: PairValues,
    pub refinement: Refinement,
}

impl RefinedSum {
    fn new(inputs: TileInputs, visibility: Keyed<Visibility>, refinement: Refinement) -> Self {
        let direct = Direct::new(inputs.sum.clone(), visibility.value.clone());
        Self { inputs, visibility, direct, estimate: None, values: PairValues::default(), refinement }
    }

    /// Examines the sum, if a quick estimate does not rule out that its error exceeds the bound.
    fn examine(&mut self, bound: ErrorBound) {
        let TileInputs { facets, material_of_slot, materials, .. } = &self.inputs;
        let is_first = self.refinement == Refinement::NONE;
        let is_quick = is_first && !facets.has_rare_part();
        if is_quick {
            let (quick, values) = quick_estimate(&self.direct, facets);
            self.values = values;
            if quick.excess(bound) <= QUICK_PART {
                return;
            }
        }
        let slots = (&material_of_slot[..], &materials.materials[..]);
        self.estimate =
            Some(ErrorEstimator::new(&FEW_PAIRS, &self.direct, facets, slots, None, 0.0, (None, None)).estimate());
    }

    /// A sentence about raised settings, if any were raised.
    pub fn note(&self) -> Option<String> {
        let settings = &self.inputs.settings;
        let azimuths = match &*self.visibility {
            Visibility::OcclusionIntervals(_) => settings.slice_azimuths,
            _ => settings.horizon_azimuths,
        };
        (self.refinement != Refinement::NONE).then(|| {
            format!(
                "refined to {} facets, {azimuths} azimuths and shadows with a transition width of {:.2}°, because the estimated \
                 error was larger than `{}` allows",
                self.inputs.facets.len(),
                settings.penumbra.to_degrees(),
                settings.preset.name()
            )
        })
    }
}

impl Pipeline {
    /// The direct sum over the facets of `inputs`, or over more facets with finer visibility if its estimated error is
    /// larger than the preset allows.
    pub(super) fn refined_sum(
        &self,
        loaded: &LoadedScene,
        inputs: TileInputs,
        visibility: Keyed<Visibility>,
        times: &mut StageTimes,
    ) -> Result<RefinedSum> {
        let settings = inputs.settings.clone();
        let mut sum = RefinedSum::new(inputs, visibility, Refinement::NONE);
        let Some(bound) = settings.refinement_bound() else { return Ok(sum) };
        loop {
            let start = Instant::now();
            sum.examine(bound);
            add_time(times, "error_estimate", start);
            let next = sum.estimate.and_then(|estimate| sum.refinement.next(&estimate, bound, &settings));
            let Some(refinement) = next else { return Ok(sum) };
            self.env.cancel.check()?;
            let inputs = self.tile_inputs(loaded, Processor::Cpu(refinement), times)?;
            let has_same_facets = inputs.facets.key == sum.inputs.facets.key;
            let coarser = has_same_facets.then_some(&*sum.visibility);
            let visibility = self.finer_visibility(&inputs, coarser, times)?;
            sum = RefinedSum::new(inputs, visibility, refinement);
        }
    }
}

/// The light between facets, and the settings to which refinement brought it.
pub(super) struct RefinedInterreflection {
    pub table: Arc<InterreflectionTable>,
    pub settings: InterreflectionSettings,
    /// True if this light alone brings the error so close to the bound of the preset that the result must be examined.
    pub close_to_bound: bool,
}

impl RefinedInterreflection {
    /// A sentence about settings that were raised above the `first` ones, if any were.
    pub fn note(&self, first: &InterreflectionSettings, preset: Preset) -> Option<String> {
        let InterreflectionSettings { useful_rays: rays, grid, .. } = self.settings;
        (self.settings != *first).then(|| {
            format!(
                "interreflection refined to {rays} rays between facets and {} directions, because its estimated error was \
                 larger than `{}` allows",
                grid.len(),
                preset.name()
            )
        })
    }
}

impl Pipeline {
    /// The light between facets, with more rays and directions than those of `first` if its part of the estimated errors is
    /// larger than [`Settings::bounced_bound`].
    pub(super) fn refined_interreflection(
        &self,
        surface: &VisibleSurface<'_>,
        first: InterreflectionSettings,
        (direct, values, settings): (&Direct, &mut PairValues, &Settings),
        times: &mut StageTimes,
    ) -> Result<RefinedInterreflection> {
        let base_area = f64::from(surface.tile.mesh.base_area());
        let mut refined = first;
        let mut close_to_bound = false;
        loop {
            let table = self.interreflection(surface, (&refined, refined != first), times)?;
            let done =
                |close_to_bound| RefinedInterreflection { table: table.clone(), settings: refined, close_to_bound };
            let Some(whole_bound) = settings.refinement_bound() else { return Ok(done(false)) };
            let bound = settings.bounced_bound(whole_bound);
            let start = Instant::now();
            let estimate = estimate_of_bounced(direct, (&table, base_area), values, (bound, QUICK_PART));
            add_time(times, "error_estimate", start);
            close_to_bound |= estimate.excess(whole_bound) > QUICK_PART;
            let next = finer_interreflection([&first, &refined], &table, &estimate, bound);
            let Some(next) = next else { return Ok(done(close_to_bound)) };
            self.env.cancel.check()?;
            refined = next;
        }
    }
}

#[cfg(test)]
#[path = "refine_tests.rs"]
mod tests;
