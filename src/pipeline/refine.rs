//! Refinement: facets, azimuths and the sharpness of shadows are raised until the estimated error of the direct sum is
//! within the bound of the preset.

use std::time::Instant;

use super::inputs::{Processor, TileInputs};
use super::stage::elapsed_ms;
use super::{Keyed, Pipeline, StageTimes};
use crate::base::Result;
use crate::effective::{Direct, ErrorBound, ErrorEstimator, quick_estimate};
use crate::plan::Refinement;
use crate::scene::LoadedScene;
use crate::visibility::Visibility;

/// A quick estimate below this part of the bound ends the search. It examines few pairs, so that the highest of them
/// may be missing. Light from a rare part of the surface reaches few pairs, so that no quick estimate is made.
const QUICK_PART: f64 = 0.5;

/// A direct sum with the results that it was computed from.
pub(super) struct RefinedSum {
    pub inputs: TileInputs,
    pub visibility: Keyed<Visibility>,
    pub direct: Direct,
    /// The estimator of this sum, if its error was close to the bound.
    pub estimator: Option<ErrorEstimator>,
    pub refinement: Refinement,
}

impl RefinedSum {
    fn new(inputs: TileInputs, visibility: Keyed<Visibility>, refinement: Refinement) -> Self {
        let direct = Direct::new(inputs.sum.clone(), visibility.value.clone());
        Self { inputs, visibility, direct, estimator: None, refinement }
    }

    /// Examines the sum, if a quick estimate does not rule out that its error exceeds the bound.
    fn examine(&mut self, bound: ErrorBound) {
        let TileInputs { facets, material_of_slot, materials, .. } = &self.inputs;
        let is_first = self.refinement == Refinement::NONE;
        let is_quick = is_first && !facets.has_rare_part();
        if is_quick && quick_estimate(&self.direct, facets).excess(bound) <= QUICK_PART {
            return;
        }
        self.estimator = Some(ErrorEstimator::new(&self.direct, facets, material_of_slot, &materials.materials, 0.0));
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
                "refined to {} facets, {azimuths} azimuths and shadows with a soft step of {:.2}°, because the estimated \
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
        let may_refine = settings.max_refined_facets.is_some();
        let Some(bound) = settings.error_bound().filter(|_| may_refine) else { return Ok(sum) };
        loop {
            let start = Instant::now();
            sum.examine(bound);
            times.push(("error_estimate", elapsed_ms(start)));
            let estimate = sum.estimator.as_ref().map(ErrorEstimator::estimate);
            let next = estimate.and_then(|estimate| sum.refinement.next(&estimate, bound, &settings));
            let Some(refinement) = next else { return Ok(sum) };
            self.env.cancel.check()?;
            let inputs = self.tile_inputs(loaded, Processor::Cpu(refinement), times)?;
            let visibility = self.visibility(&inputs, times)?;
            sum = RefinedSum::new(inputs, visibility, refinement);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::metrics::mirror_biased_pairs;
    use crate::pipeline::Outcome;

    /// Grooves whose horizons jump between azimuths.
    const DEEP_GROOVES: [&str; 3] =
        ["tile.geometry.depth=2.5", "tile.geometry.side_angle_deg=89", "tile.geometry.rotation_deg=32"];

    fn open(scene: &str, preset: &str, settings: &[&str]) -> LoadedScene {
        let mut all = vec![format!("quality.preset={preset}"), "quality.backend=cpu".to_owned()];
        all.extend(settings.iter().map(|&setting| setting.to_owned()));
        crate::scene::open(scene, &all).unwrap()
    }

    fn effective(loaded: &LoadedScene) -> Outcome {
        Pipeline::new().effective(loaded).unwrap()
    }

    fn values(outcome: &Outcome) -> Vec<Vec3> {
        mirror_biased_pairs(20, 3).iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect()
    }

    fn refines(outcome: &Outcome) -> bool {
        outcome.notes.iter().any(|note| note.starts_with("refined to "))
    }

    #[test]
    fn a_result_within_its_bound_has_the_same_bits_without_refinement() {
        for scene in ["table4_plate", "fig4b_bicolor_cup", "fig6d_velvet_left", "fig9b_cylinder_stripes"] {
            let (with, without) =
                (effective(&open(scene, "draft", &[])), effective(&open(scene, "draft", &["quality.adaptive=false"])));
            assert_eq!(values(&with), values(&without), "{scene}");
            assert!(!refines(&with) && with.times.iter().any(|(name, _)| *name == "error_estimate"), "{scene}");
            assert!(without.times.iter().all(|(name, _)| *name != "error_estimate"), "{scene}");
        }
    }

    #[test]
    fn a_difficult_tile_is_refined_until_it_states_an_error_within_the_bound() {
        let plain = effective(&open("fig1d_yellow_sides", "fine", &["quality.adaptive=false"]));
        let bound = plain.settings.error_bound().unwrap();
        let loaded = open("fig1d_yellow_sides", "fine", &DEEP_GROOVES);
        let outcome = effective(&loaded);
        assert!(refines(&outcome), "{:?}", outcome.errors().unwrap().estimate());
        assert!(outcome.settings.facets > plain.settings.facets || outcome.settings.horizon_azimuths > 96);
        let estimate = outcome.errors().unwrap().estimate();
        let warns = outcome.health().warnings.iter().any(|warning| warning.contains("error is estimated at"));
        assert_eq!(warns, estimate.may_exceed(bound), "{estimate:?}");
    }

    #[test]
    fn limits_end_refinement_and_a_warning_states_the_error() {
        let mirror = "material.default.brdf={kind=\"cook_torrance\",roughness=0.02,f0=[1,1,1]}";
        let loaded = open("fig8d_leather", "standard", &["quality.max_facets=16", mirror]);
        let outcome = effective(&loaded);
        let estimate = outcome.errors().unwrap().estimate();
        assert!(estimate.may_exceed(outcome.settings.error_bound().unwrap()), "{estimate:?}");
        let warning =
            outcome.health().warnings.iter().find(|warning| warning.contains("error is estimated at")).unwrap();
        assert!(warning.contains("`standard` allows 10 %"), "{warning}");
    }

    #[test]
    fn a_refined_result_does_not_depend_on_earlier_edits() {
        let pipeline = Pipeline::new();
        let refined = open("fig1d_yellow_sides", "fine", &DEEP_GROOVES);
        let plain = open("fig1d_yellow_sides", "fine", &["tile.geometry.depth=0.02"]);
        let first = values(&pipeline.effective(&refined).unwrap());
        assert!(!refines(&pipeline.effective(&plain).unwrap()));
        assert_eq!(values(&pipeline.effective(&refined).unwrap()), first);
        assert_eq!(values(&effective(&refined)), first);
    }

    #[test]
    fn a_scene_that_sets_the_resolution_is_not_refined() {
        for setting in ["quality.facets=64", "quality.azimuths=4", "quality.penumbra_deg=2.0"] {
            let outcome = effective(&open("fig1d_yellow_sides", "draft", &[setting, DEEP_GROOVES[0]]));
            assert!(!refines(&outcome) && outcome.times.iter().all(|(name, _)| *name != "error_estimate"), "{setting}");
        }
    }
}
