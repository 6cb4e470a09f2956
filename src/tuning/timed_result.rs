//! Results of candidates with their times, by their stated errors and against a reference.

use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::candidates::{Candidate, with_settings};
use super::progressive::ReferenceErrors;
use super::sweep::{BANDS_DEG, MAX_DB, PAIRS_SEED, ReferenceValues, SweepPoint};
use crate::base::Result;
use crate::effective::Reflectance;
use crate::metrics::{Pair, mirror_biased_pairs};
use crate::pipeline::{Outcome, StageTimes};
use crate::plan::Preset;
use crate::scene::LoadedScene;

/// Largest number of views for which a query is timed.
const QUERIES: usize = 64;
/// Largest number of timed runs. Their median is reported.
const MAX_RUNS: usize = 5;
/// Time after which no further run starts [s].
const ENOUGH_SECONDS: f64 = 1.5;
/// Duration of a first run above which it is the only run [s].
const LONG_SECONDS: f64 = 2.0;

/// A candidate's result with the time of a geometry edit.
#[derive(Debug)]
pub struct TimedResult {
    scene: String,
    candidate: Candidate,
    outcome: Outcome,
    ms: f64,
    times: StageTimes,
}

/// Times a geometry edit at a candidate's settings.
///
/// # Errors
/// Returns the errors of [`Pipeline::effective`].
pub fn time(loaded: &LoadedScene, candidate: &Candidate) -> Result<TimedResult> {
    let scene = with_settings(loaded, candidate)?;
    let mut edited = scene.clone();
    let edits = edited.scene.nudge_geometry().is_some();
    let mut pipeline = crate::gpu::pipeline();
    let mut runs: Vec<(f64, StageTimes)> = Vec::new();
    let started = Instant::now();
    let mut outcome = pipeline.effective(&scene)?;
    let first = started.elapsed().as_secs_f64();
    if first > LONG_SECONDS && candidate.preset != Preset::Wu2011.name() {
        // A warm-up changes a long run little. The tables of `wu2011` are the exception: an edit reuses most of them.
        runs.push((first * 1e3, outcome.times.clone()));
    }
    while runs.is_empty() || runs.len() < MAX_RUNS && started.elapsed().as_secs_f64() < ENOUGH_SECONDS {
        // Only the edit back to this scene is timed.
        if edits {
            pipeline.effective(&edited)?;
        } else {
            pipeline = crate::gpu::pipeline();
        }
        let start = Instant::now();
        outcome = pipeline.effective(&scene)?;
        runs.push((start.elapsed().as_secs_f64() * 1e3, outcome.times.clone()));
    }
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (ms, times) = runs.swap_remove(runs.len() / 2);
    Ok(TimedResult { scene: loaded.name.clone(), candidate: candidate.clone(), outcome, ms, times })
}

impl TimedResult {
    /// The point by the error that the result states; `None` if it states none.
    pub fn stated_point(&self) -> Option<SweepPoint> {
        self.outcome.errors()?;
        let pairs = mirror_biased_pairs(QUERIES, PAIRS_SEED);
        Some(self.with_errors(&pairs, ReferenceErrors::stated(&self.outcome)))
    }

    /// The point by the errors against a reference.
    pub fn point(&self, reference: &ReferenceValues) -> SweepPoint {
        let brdf = &self.outcome.brdf;
        let values: Vec<Vec3> = reference.pairs.par_iter().map(|pair| brdf.eval(pair.i, pair.o)).collect();
        SweepPoint {
            albedo_error: reference.albedo_error(&values),
            rel_l2_by_angle: reference.by_angle(&values),
            ..self.with_errors(&reference.pairs, reference.errors(&values))
        }
    }

    fn with_errors(&self, pairs: &[Pair], errors: ReferenceErrors) -> SweepPoint {
        let Self { scene, candidate, outcome, ms, times } = self;
        SweepPoint {
            scene: scene.clone(),
            settings: candidate.cli_args(),
            family: candidate.family.clone(),
            preset: candidate.preset.to_owned(),
            ms: *ms,
            query_us: query_us(outcome, pairs),
            rel_l2: errors.rel_l2,
            rel_l2_std_error: errors.rel_l2_std_error,
            psnr_db: errors.psnr_db.min(MAX_DB),
            is_stated: errors.is_stated(),
            albedo_error: 0.0,
            rel_l2_by_angle: [0.0; BANDS_DEG.len()],
            stages: times.iter().map(|(name, ms)| ((*name).to_owned(), *ms)).collect(),
            representation: outcome.brdf.representation.describe(),
        }
    }
}

/// Microseconds per pair on one thread. All lights of a view are evaluated together, as in rendering.
fn query_us(outcome: &Outcome, pairs: &[Pair]) -> f64 {
    const LIGHTS: usize = 8;
    let lights: Vec<Vec3> = pairs.iter().take(LIGHTS).map(|pair| pair.i).collect();
    let mut out = vec![Vec3::ZERO; lights.len()];
    let start = Instant::now();
    let mut views = 0;
    for pair in pairs.iter().take(QUERIES) {
        outcome.brdf.eval_lights(&lights, pair.o, &mut out);
        views += 1;
        if start.elapsed().as_secs_f64() > 0.1 {
            break;
        }
    }
    start.elapsed().as_secs_f64() * 1e6 / (views * lights.len()).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::ReferenceSettings;
    use crate::tuning::candidates::Family;

    #[test]
    fn a_result_states_its_error_until_a_reference_measures_it() {
        let loaded = crate::scene::open("fig4b_bicolor_cup", &[]).unwrap();
        let candidate = Candidate { family: Family::QualityScale, preset: "draft", set: Vec::new() };
        let result = time(&loaded, &candidate).unwrap();
        let stated = result.stated_point().unwrap();
        assert!(stated.is_stated && stated.rel_l2 > 0.0 && stated.rel_l2_std_error == 0.5 * stated.rel_l2);
        let settings = ReferenceSettings { facets: 1024, max_passes: 4, target: 0.0, seed: 1 };
        let reference = ReferenceValues::new(&loaded, 64, &settings, |_, _| true).unwrap();
        let measured = result.point(&reference);
        assert!(!measured.is_stated && measured.rel_l2_std_error > 0.0 && measured.albedo_error > 0.0);
        assert_eq!((measured.ms, &measured.settings), (stated.ms, &stated.settings));
        let paper = Candidate { family: Family::Preset, preset: "wu2011", set: Vec::new() };
        assert!(time(&loaded, &paper).unwrap().stated_point().is_none());
    }
}
