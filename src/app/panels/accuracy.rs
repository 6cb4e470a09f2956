//! State of the measurements of accuracy against time: requests to the worker and what it reported.

use std::sync::Arc;

use crate::plan::Effect;
use crate::report::EffectCost;
use crate::scene::{LoadedScene, Quality, Scene};
use crate::tuning::quality_scale;
use eframe::egui::{Context, TextureHandle, TextureOptions};

use super::accuracy_chart;
use crate::app::worker::{AccuracyChart, AccuracyJob, AccuracyPoint, AccuracyResult, FINER_DB, without_settings};

/// State of the panel between frames.
#[derive(Default)]
pub struct AccuracyState {
    /// True while the panel is unfolded. The chart is measured then, or if it is wanted.
    pub open: bool,
    /// True if the user asked for the chart of this scene with the panel folded.
    pub wanted: bool,
    /// True if the worker keeps refining the reference.
    pub comparing: bool,
    /// True while a measurement of each effect, on and off, is requested or running.
    pub measuring: bool,
    /// Costs of the effects, and the document version that they belong to.
    pub costs: Option<(u64, Vec<EffectCost>)>,
    /// The last request: version, `comparing`, `measuring`, and whether the image was final.
    requested: Option<(u64, bool, bool, bool)>,
    pub(super) levels: Vec<AccuracyPoint>,
    /// Scenes without settings: that of the last request, and that of the levels.
    requested_of: Option<Box<LoadedScene>>,
    levels_of: Option<Box<LoadedScene>>,
    /// Version that was compared with the scene of the levels, and whether it is the same.
    freshness: Option<(u64, bool)>,
    current: Option<(u64, AccuracyPoint)>,
    difference: Option<(u64, ShownDifference)>,
    /// The object's view shows the difference image.
    pub large: bool,
    /// The settings that the worker measures, in words.
    pub activity: Option<String>,
    pub(super) error: Option<String>,
}

/// The difference between the scene's image and a more accurate one.
pub struct ShownDifference {
    pub texture: TextureHandle,
    /// The mean ΔE in words.
    pub caption: String,
}

impl AccuracyState {
    /// Returns the job for a document version, unless that job is the last request. Before the image is final, only an
    /// empty chart is measured, and only at the fastest levels.
    pub fn job(&mut self, version: u64, loaded: &Arc<LoadedScene>, is_final: bool) -> Option<AccuracyJob> {
        self.examine(version, loaded);
        let wanted = (version, self.comparing, self.measuring, is_final);
        let may_start = is_final || self.open && self.levels.is_empty();
        if loaded.scene.slab.is_some() || !self.is_needed() || !may_start || self.requested == Some(wanted) {
            return None;
        }
        self.requested = Some(wanted);
        self.requested_of = Some(Box::new(without_settings(loaded)));
        (self.error, self.activity) = (None, Some("Starting".to_owned()));
        let chart = match (self.open || self.wanted, is_final) {
            (false, _) => AccuracyChart::None,
            (true, false) => AccuracyChart::First,
            (true, true) => AccuracyChart::Whole,
        };
        let (compare, effects) = (self.comparing, self.measuring && is_final);
        Some(AccuracyJob { version, loaded: loaded.clone(), chart, compare, effects })
    }

    fn is_needed(&self) -> bool {
        self.open || self.wanted || self.measuring
    }

    /// Compares a version with the scene of the levels. The chart of another scene is no longer wanted.
    fn examine(&mut self, version: u64, loaded: &LoadedScene) {
        if self.freshness.is_some_and(|(examined, _)| examined == version) {
            return;
        }
        let is_fresh = self.levels_of.as_ref().is_some_and(|of| **of == without_settings(loaded));
        self.freshness = Some((version, is_fresh));
        self.wanted &= is_fresh || self.levels_of.is_none();
    }

    /// Returns true if the levels belong to a version of the document.
    pub fn is_fresh(&self, version: u64) -> bool {
        self.freshness == Some((version, true))
    }

    /// The point of the settings of a version, if it was measured.
    pub fn now(&self, version: u64) -> Option<AccuracyPoint> {
        self.current.filter(|(measured, _)| *measured == version).map(|(_, point)| point)
    }

    /// The levels that are next to the settings of a version on the front: the faster and the finer one.
    pub fn neighbours(&self, version: u64) -> [Option<AccuracyPoint>; 2] {
        let Some(now) = self.now(version).filter(|_| self.is_fresh(version)) else { return [None; 2] };
        let points: Vec<&AccuracyPoint> = self.levels.iter().collect();
        let front = accuracy_chart::front(&points);
        // These settings may be a level themselves, which took another time.
        let own = front.iter().filter(|point| point.is_same(&now)).map(|point| point.ms);
        let ms = own.fold(now.ms, f64::min);
        let faster = front.iter().rev().find(|point| point.ms < NEARER * ms && !point.is_same(&now));
        let finer = front.iter().find(|point| point.compared.psnr_db > now.compared.psnr_db + FINER_DB);
        [faster, finer].map(|point| point.map(|point| **point))
    }

    /// The most accurate level that is finer and not slower than the settings of a version.
    pub fn better(&self, version: u64) -> Option<AccuracyPoint> {
        let now = self.now(version).filter(|_| self.is_fresh(version))?;
        let beats = |point: &&AccuracyPoint| {
            let (level, own) = (&point.compared, &now.compared);
            let noise = level.psnr_std_error_db + own.psnr_std_error_db;
            point.ms < now.ms && level.psnr_db > own.psnr_db + noise.max(FINER_DB)
        };
        self.levels.iter().filter(beats).max_by(|a, b| a.compared.psnr_db.total_cmp(&b.compared.psnr_db)).copied()
    }

    /// Sets the points as if a version of the document had been measured.
    #[cfg(test)]
    pub fn record(&mut self, version: u64, levels: Vec<AccuracyPoint>, current: AccuracyPoint) {
        (self.levels, self.current, self.freshness) = (levels, Some((version, current)), Some((version, true)));
    }

    /// Forgets the chart of the last document.
    pub fn forget(&mut self) {
        (self.levels_of, self.freshness, self.wanted) = (None, None, false);
        (self.requested, self.current, self.costs, self.difference) = (None, None, None, None);
        self.levels.clear();
    }

    /// Returns true if the running job belongs to another document version, or if nothing needs it any longer.
    pub fn is_late(&mut self, version: u64) -> bool {
        let late = self.activity.is_some()
            && (!self.is_needed() || self.requested.is_some_and(|(requested, ..)| requested != version));
        if late {
            self.activity = None;
            self.requested = None;
        }
        late
    }

    /// Costs of the effects in a version, if they were measured.
    pub fn costs_of(&self, version: u64) -> Option<&[EffectCost]> {
        self.costs.as_ref().filter(|(measured, _)| *measured == version).map(|(_, costs)| &costs[..])
    }

    /// Ends the running job, which is requested again later. Returns true if a job was running.
    pub fn pause(&mut self) -> bool {
        self.requested = None;
        self.activity.take().is_some()
    }

    /// The difference image of a version, while a reference is compared.
    pub fn shown_difference(&self, version: u64) -> Option<&ShownDifference> {
        let (_, shown) = self.difference.as_ref().filter(|(measured, _)| *measured == version)?;
        self.comparing.then_some(shown)
    }

    pub fn receive(&mut self, ctx: &Context, result: AccuracyResult) {
        match result {
            AccuracyResult::Doing(what) => self.activity = Some(what),
            AccuracyResult::Levels(levels) => {
                self.levels = levels;
                (self.levels_of, self.freshness) = (self.requested_of.clone(), None);
            }
            AccuracyResult::Current(version, point) => self.current = Some((version, point)),
            AccuracyResult::Difference(version, shown) => {
                let texture = ctx.load_texture("difference", shown.image, TextureOptions::NEAREST);
                let caption = match shown.noise {
                    Some(noise) => {
                        format!("Difference from the reference: mean ΔE {:.2}, of which noise {noise:.2}", shown.mean)
                    }
                    None => format!("Difference from 65,536 facets: mean ΔE {:.2}", shown.mean),
                };
                self.difference = Some((version, ShownDifference { texture, caption }));
            }
            AccuracyResult::Effects(version, costs) => {
                self.measuring = false;
                // Only the effects are measured. The rest of the job continues.
                self.requested = self.requested.map(|(version, comparing, _, last)| (version, comparing, false, last));
                self.costs = Some((version, costs));
            }
            AccuracyResult::Done(version) => {
                if self.requested.is_some_and(|(requested, ..)| requested == version) {
                    self.activity = None;
                }
            }
            AccuracyResult::Failed(text) => {
                (self.activity, self.error, self.measuring, self.wanted) = (None, Some(text), false, false);
            }
        }
    }

    /// Numbers of points by their stated errors and against the reference.
    #[cfg(test)]
    pub fn point_counts(&self) -> [usize; 2] {
        let stated = self.levels.iter().filter(|point| point.compared.is_stated()).count();
        [stated, self.levels.len() - stated]
    }

    /// Returns true if the chart shows the current settings and at least five quality levels.
    #[cfg(test)]
    pub fn is_measured(&self, version: u64) -> bool {
        self.activity.is_none()
            && self.levels.iter().filter(|point| !point.compared.is_stated()).count() >= 5
            && self.current.is_some_and(|(measured, _)| measured == version)
    }
}

/// Factor on the time from which settings count as faster.
const NEARER: f64 = 0.9;
/// Uncertainty of an error that a result states itself [dB].
pub const STATED_DB: f64 = 3.0;

/// Sets the quality to that of a measured level.
pub fn take(scene: &mut Scene, facets: usize, effects: &[Effect]) {
    take_level(scene, quality_scale::level_of_facets(facets), effects);
}

pub(super) fn take_level(scene: &mut Scene, level: f64, effects: &[Effect]) {
    let overhangs = effects.iter().any(|effect| effect.name == "overhangs" && effect.on);
    let candidate = quality_scale::candidate_at(level, overhangs);
    let plain = Quality {
        preset: candidate.preset.to_owned(),
        seed: scene.quality.seed,
        backend: scene.quality.backend.clone(),
        ..Quality::default()
    };
    let bare = Scene { quality: plain, ..scene.clone() };
    if let Ok(walked) = bare.with_quality(&candidate.set) {
        *scene = walked;
    }
}

/// Errors and time of a point in words.
pub fn describe_point(point: &AccuracyPoint) -> String {
    accuracy_chart::describe(point)
}
