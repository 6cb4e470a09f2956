//! The object's picture: a draft at once, then the scene's own quality while the hand rests.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use biscale::filtering::EffectiveBrdf;
use biscale::large_scale::Picture;
use biscale::large_scale::tone_map::ToneMap;
use biscale::pipeline::{Outcome, Pipeline};
use biscale::plan::Effect;
use biscale::scene::{Camera, LoadedScene, Material, Painted, Quality, Tile};
use biscale::{Cancel, Error, Result};
use eframe::egui::ColorImage;

use super::runner::Desk;
use super::studio::{Shot, Studio};
use super::tone::color_image;

/// A first picture should be there after this many milliseconds.
const DRAFT_MS: f64 = 60.0;
/// A picture on the way to the full one.
const STEP_MS: f64 = 350.0;
/// Most pixels of a picture; a larger view shows it enlarged.
const MOST_PIXELS: f64 = 900.0 * 900.0;
/// How long the hand must rest before refinement begins.
const REST: Duration = Duration::from_millis(120);

/// A picture to make.
#[derive(Debug, Clone)]
pub struct PictureJob {
    /// The document's version, handed back with every answer.
    pub version: u64,
    pub loaded: Arc<LoadedScene>,
    /// Pixels of the view.
    pub size: [usize; 2],
    pub asked: Instant,
}

/// How far a picture is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grade {
    Draft,
    /// On the way from draft to final.
    Refining,
    Final,
}

/// A picture and how it came about.
#[derive(Debug, Clone)]
pub struct Made {
    pub version: u64,
    pub grade: Grade,
    pub picture: Arc<Picture>,
    pub image: Arc<ColorImage>,
    pub brdf: Arc<EffectiveBrdf>,
    /// Milliseconds of what ran for it.
    pub stages: Vec<(&'static str, f64)>,
    /// From the edit to here.
    pub latency_ms: f64,
    pub device: String,
    /// From the camera to the object, in radii.
    pub distance: f32,
    pub notes: Vec<String>,
    pub effects: Vec<Effect>,
    /// What the preset that made it is called.
    pub preset: &'static str,
}

/// What comes back.
#[derive(Debug, Clone)]
pub enum PictureAnswer {
    Made(Box<Made>),
    /// What is being done, for the status line.
    Doing(u64, &'static str),
    Failed(u64, String),
    /// The worker met a fault and went on anew.
    Fault(String),
}

/// What an effective BRDF depends on.
type SmallScale = (Tile, Vec<Material>, Quality, PathBuf, Painted);

/// Keeps the stages of both qualities and what stays between pictures.
#[derive(Default)]
pub struct Photographer {
    draft: Pipeline,
    refined: Pipeline,
    studio: Studio,
    /// The last result at the scene's own quality.
    best: Option<(SmallScale, Outcome)>,
    /// Milliseconds a pixel, of the draft's and of the refined BRDF.
    cost: [Cost; 2],
    /// The last full picture, for edits that only tone it.
    last: Option<(Box<LoadedScene>, [usize; 2], Made)>,
}

struct Cost(f64);

impl Default for Cost {
    fn default() -> Self {
        Self(4e-3)
    }
}

impl Photographer {
    /// Does a job, step by step, until it is done or newer work is there.
    pub fn work(&mut self, job: PictureJob, desk: &Desk<PictureJob>, answer: &dyn Fn(PictureAnswer)) {
        match self.steps(&job, desk, answer) {
            Ok(()) | Err(Error::Cancelled) => {}
            Err(error) => answer(PictureAnswer::Failed(job.version, error.to_string())),
        }
    }

    fn steps(&mut self, job: &PictureJob, desk: &Desk<PictureJob>, answer: &dyn Fn(PictureAnswer)) -> Result<()> {
        if let Some(made) = self.toned(job)? {
            answer(PictureAnswer::Made(Box::new(made)));
            return Ok(());
        }
        self.draft.cancel_with(Cancel::default());
        self.refined.cancel_with(desk.cancel.clone());
        self.studio.prepare(&job.loaded)?;
        let key = small_scale(&job.loaded);
        let known = self.best.as_ref().filter(|(last, _)| *last == key).map(|(_, outcome)| outcome.clone());
        // A draft is never cancelled: while the hand moves, the picture must follow.
        let (first, which) = match known {
            Some(outcome) => (Outcome { times: Vec::new(), ..outcome }, 1),
            None => (self.draft.effective(&as_draft(&job.loaded))?, 0),
        };
        let size = self.affordable(job.size, which, DRAFT_MS);
        let made = self.shoot(job, &first, which, size, 1, &Cancel::default())?;
        let full = fitting(job.size);
        let is_preset_draft = job.loaded.scene.quality.preset == "draft";
        answer(PictureAnswer::Made(Box::new(made)));
        if !desk.is_newest_after(REST) {
            return Ok(());
        }
        answer(PictureAnswer::Doing(job.version, "Refining the material"));
        let outcome =
            if which == 1 || is_preset_draft && job.loaded.scene.quality == as_draft(&job.loaded).scene.quality {
                first
            } else {
                self.refined.effective(&job.loaded)?
            };
        self.best = Some((key, outcome.clone()));
        let step = self.affordable(job.size, 1, STEP_MS);
        let mut outcome = outcome;
        if step[0] * step[1] * 3 < full[0] * full[1] * 2 {
            let mut made = self.shoot(job, &outcome, 1, step, 1, desk.cancel)?;
            made.grade = Grade::Refining;
            outcome.times = Vec::new();
            answer(PictureAnswer::Made(Box::new(made)));
        }
        answer(PictureAnswer::Doing(job.version, "Refining the picture"));
        let mut made = self.shoot(job, &outcome, 1, full, 2, desk.cancel)?;
        made.grade = Grade::Final;
        self.last = Some((Box::new((*job.loaded).clone()), job.size, made.clone()));
        answer(PictureAnswer::Made(Box::new(made)));
        Ok(())
    }

    /// The last full picture in other tones, where nothing else changed.
    fn toned(&mut self, job: &PictureJob) -> Result<Option<Made>> {
        let Some((last, size, made)) = &mut self.last else { return Ok(None) };
        let mut like_last = (*job.loaded).clone();
        let camera = camera(&job.loaded);
        let before = last.scene.camera.clone().unwrap_or_default();
        like_last.scene.camera =
            Some(Camera { exposure_ev: before.exposure_ev, tone_map: before.tone_map.clone(), ..camera.clone() });
        let same_view = like_last.scene.camera.as_ref() == Some(&before);
        like_last.scene.camera = last.scene.camera.clone();
        like_last.name.clone_from(&last.name);
        if !same_view || like_last != **last || *size != job.size {
            return Ok(None);
        }
        let start = Instant::now();
        made.image = Arc::new(color_image(&made.picture, &ToneMap::new(&camera)?));
        made.version = job.version;
        made.stages = vec![("tone", ms(start))];
        made.latency_ms = ms(job.asked);
        Ok(Some(made.clone()))
    }

    fn shoot(
        &mut self,
        job: &PictureJob,
        outcome: &Outcome,
        which: usize,
        size: [usize; 2],
        samples_per_side: usize,
        cancel: &Cancel,
    ) -> Result<Made> {
        let camera = camera(&job.loaded);
        let tone_map = ToneMap::new(&camera)?;
        let backend = job.loaded.scene.quality.backend.as_str();
        let settle = samples_per_side > 1;
        let shot = Shot { camera: &camera, brdf: &outcome.brdf, size, samples_per_side, settle, backend };
        let rendered = self.studio.shoot(&shot, cancel)?;
        let times = rendered.times;
        let spent = times.gbuffer_ms + times.shadows_ms + times.shading_ms;
        if samples_per_side == 1 {
            let measured = spent / (size[0] * size[1]) as f64;
            self.cost[which].0 = if measured > 0.0 { measured } else { self.cost[which].0 };
        }
        let large = [("g-buffer", times.gbuffer_ms), ("shadows", times.shadows_ms), ("shading", times.shading_ms)];
        let start = Instant::now();
        let image = Arc::new(color_image(&rendered.picture, &tone_map));
        let mut stages = outcome.times.clone();
        stages.extend(large.into_iter().filter(|(_, ms)| *ms > 0.005));
        stages.push(("tone", ms(start)));
        let mut notes = outcome.notes.clone();
        notes.extend(self.studio.warnings());
        Ok(Made {
            version: job.version,
            grade: Grade::Draft,
            picture: Arc::new(rendered.picture),
            image,
            brdf: outcome.brdf.clone(),
            stages,
            latency_ms: ms(job.asked),
            device: self.studio.device(),
            distance: self.studio.distance(&camera, size),
            notes,
            effects: outcome.plan.effects.clone(),
            preset: outcome.settings.preset.name(),
        })
    }

    /// The largest size, the view's shape kept, that `budget_ms` is likely to pay for.
    fn affordable(&self, size: [usize; 2], which: usize, budget_ms: f64) -> [usize; 2] {
        let full = fitting(size);
        let pixels = (full[0] * full[1]) as f64;
        let scale = (budget_ms / self.cost[which].0 / pixels).sqrt();
        // Few sizes, so that the picture does not breathe while the hand moves.
        let parts = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0];
        let part = parts.into_iter().find(|part| 1.0 / part <= scale).unwrap_or(8.0);
        full.map(|side| ((side as f64 / part).round() as usize).max(24))
    }
}

/// The view's size, cut to what is ever rendered.
fn fitting(size: [usize; 2]) -> [usize; 2] {
    let size = size.map(|side| side.clamp(24, 8192));
    let scale = (MOST_PIXELS / (size[0] * size[1]) as f64).sqrt().min(1.0);
    size.map(|side| ((side as f64 * scale) as usize).max(24))
}

fn camera(loaded: &LoadedScene) -> Camera {
    loaded.scene.camera.clone().unwrap_or_default()
}

fn small_scale(loaded: &LoadedScene) -> SmallScale {
    let scene = &loaded.scene;
    let parts = (scene.tile.clone(), scene.materials.clone(), scene.quality.clone());
    (parts.0, parts.1, parts.2, loaded.base_dir.clone(), loaded.painted.clone())
}

/// The same scene at the draft preset, without knobs that were turned by hand.
fn as_draft(loaded: &LoadedScene) -> LoadedScene {
    let mut draft = loaded.clone();
    let quality = &loaded.scene.quality;
    draft.scene.quality = Quality {
        preset: "draft".to_owned(),
        seed: quality.seed,
        backend: quality.backend.clone(),
        ..Quality::default()
    };
    draft
}

fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
