//! Accuracy against time of the scene at hand: rungs from faster to finer and the present settings, held against a reference
//! that refines in the background.

use std::sync::Arc;
use std::time::Instant;

use crate::base::{Error, Result};
use crate::pipeline::Pipeline;
use crate::render::Image;
use crate::report::{EffectCost, ThumbnailRenderer, heat, measure_effects};
use crate::scene::{LoadedScene, Quality};
use crate::tuning::candidates::with_settings;
use crate::tuning::progressive::{Compared, ProgressiveReference};
use crate::tuning::quality_scale;
use eframe::egui::ColorImage;

use super::runner::Desk;

/// A scene to measure.
#[derive(Debug, Clone)]
pub struct AccuracyJob {
    pub version: u64,
    pub loaded: Arc<LoadedScene>,
    /// Measure the present settings and the rungs.
    pub chart: bool,
    /// Go on refining the reference, and make the difference picture.
    pub compare: bool,
    /// Force each effect on and off.
    pub effects: bool,
}

/// A rung of the ladder on this machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    pub facets: usize,
    pub ms: f64,
    pub compared: Compared,
}

/// What comes back.
#[derive(Debug, Clone)]
pub enum AccuracyAnswer {
    Doing(&'static str),
    /// All rungs measured so far.
    Rungs(Vec<Point>),
    /// The present settings of a version of the document.
    Present(u64, Point),
    /// How far the picture of a version of the document is from the right one.
    Difference(u64, Difference),
    /// What each effect costs and changes.
    Effects(u64, Vec<EffectCost>),
    Done(u64),
    Failed(String),
}

/// ΔE between the present picture and a better one.
#[derive(Debug, Clone)]
pub struct Difference {
    pub image: Arc<ColorImage>,
    pub mean: f32,
    /// What of it is the noise of the reference's picture; `None` against a far finer setting, which has none.
    pub noise: Option<f32>,
}

/// Rungs of the chart.
const RUNGS: [f64; 5] = [4.0, 6.0, 8.0, 10.0, 12.0];
/// The rung that difference pictures are taken against where the reference is too slow for pictures.
const FINEST: f64 = 12.0;
const PAIRS: usize = 96;
/// Batches of the reference: for the chart, and when it is asked for.
const BATCHES: [usize; 2] = [2, 24];
/// Noisy pictures of the reference that are averaged.
const IMAGES: u64 = 24;

/// What stays between jobs: the reference and the rungs belong to a scene, whatever its settings.
#[derive(Default)]
pub struct Accuracy {
    key: Option<Box<LoadedScene>>,
    pipeline: Pipeline,
    reference: Option<ProgressiveReference>,
    rungs: Vec<(f64, Point)>,
}

impl Accuracy {
    pub fn work(&mut self, job: &AccuracyJob, desk: &Desk<AccuracyJob>, answer: &dyn Fn(AccuracyAnswer)) {
        match self.measure(job, desk, answer) {
            Ok(()) => answer(AccuracyAnswer::Done(job.version)),
            Err(Error::Cancelled) => {}
            Err(error) => answer(AccuracyAnswer::Failed(error.to_string())),
        }
    }

    fn measure(&mut self, job: &AccuracyJob, desk: &Desk<AccuracyJob>, answer: &dyn Fn(AccuracyAnswer)) -> Result<()> {
        let key = without_settings(&job.loaded);
        if self.key.as_deref() != Some(&key) {
            *self = Self { key: Some(Box::new(key)), ..Self::default() };
        }
        self.pipeline.cancel_with(desk.cancel.clone());
        if job.effects {
            answer(AccuracyAnswer::Doing("Each effect on and off"));
            let costs = measure_effects(&job.loaded, desk.cancel, |_| {})?;
            answer(AccuracyAnswer::Effects(job.version, costs));
        }
        if !job.chart {
            return Ok(());
        }
        answer(AccuracyAnswer::Doing("Reference"));
        let mut reference = self.reference.take().unwrap_or_else(|| ProgressiveReference::new(PAIRS));
        while reference.batches < BATCHES[0] {
            reference.refine(&mut self.pipeline, &job.loaded)?;
            desk.cancel.check()?;
        }
        self.reference = Some(reference.clone());
        let outcome = self.pipeline.effective(&job.loaded)?;
        let mut present = self.point(&job.loaded, &reference)?;
        answer(AccuracyAnswer::Present(job.version, present));
        let overhangs = outcome.plan.effects.iter().any(|effect| effect.name == "overhangs" && effect.on);
        for rung in RUNGS {
            if self.rungs.iter().any(|(known, _)| *known == rung) {
                continue;
            }
            desk.cancel.check()?;
            answer(AccuracyAnswer::Doing("Faster and finer settings"));
            let scene = with_settings(&job.loaded, &quality_scale::rung(rung, overhangs))?;
            let point = self.point(&scene, &reference)?;
            self.rungs.push((rung, point));
            answer(AccuracyAnswer::Rungs(self.rungs.iter().map(|(_, point)| *point).collect()));
        }
        answer(AccuracyAnswer::Rungs(self.rungs.iter().map(|(_, point)| *point).collect()));
        if !job.compare {
            return Ok(());
        }
        answer(AccuracyAnswer::Doing("Refining the reference"));
        let studio = ThumbnailRenderer::new(&job.loaded)?;
        let now = studio.image(&*outcome.brdf)?;
        let mut right = MeanImage::default();
        for seed in 0..IMAGES {
            desk.cancel.check()?;
            let drawn = self
                .pipeline
                .with_reference(&job.loaded, |reference| studio.reference_image(reference, seed, desk.cancel))??;
            match drawn {
                Some(drawn) => right.add(drawn),
                // Paths between facets: against the finest setting instead.
                None if seed == 0 => {
                    let fine = with_settings(&job.loaded, &quality_scale::rung(FINEST, overhangs))?;
                    let finest = studio.image(&*self.pipeline.effective(&fine)?.brdf)?;
                    answer(AccuracyAnswer::Difference(job.version, difference(&studio, &now, &finest, None)));
                }
                None => {}
            }
            if let Some((mean, noise)) = right.mean_and_noise(&studio) {
                let shown = difference(&studio, &now, &mean, Some(noise));
                answer(AccuracyAnswer::Difference(job.version, shown));
            }
            if reference.batches < BATCHES[1] {
                reference.refine(&mut self.pipeline, &job.loaded)?;
                self.reference = Some(reference.clone());
                present.compared = reference.compare(&outcome.brdf);
                answer(AccuracyAnswer::Present(job.version, present));
            }
        }
        Ok(())
    }

    /// Errors of a scene at its settings, and the time of an edit that asks for other facets.
    fn point(&mut self, scene: &LoadedScene, reference: &ProgressiveReference) -> Result<Point> {
        let mut moved = scene.clone();
        moved.scene.quality.seed ^= 1;
        self.pipeline.effective(&moved)?;
        let start = Instant::now();
        let outcome = self.pipeline.effective(scene)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(Point { facets: outcome.settings.facets, ms, compared: reference.compare(&outcome.brdf) })
    }
}

/// What the reference and the rungs depend on: all but settings and camera.
fn without_settings(loaded: &LoadedScene) -> LoadedScene {
    let mut key = loaded.clone();
    key.scene.quality = Quality { seed: key.scene.quality.seed, ..Quality::default() };
    key.scene.camera = None;
    key.scene.object = Default::default();
    key.scene.light = Default::default();
    key.name.clear();
    key
}

/// Two means of every second picture each: how far they are apart tells their noise.
#[derive(Default)]
struct MeanImage {
    halves: [Option<Image>; 2],
    counts: [usize; 2],
}

impl MeanImage {
    fn add(&mut self, drawn: Image) {
        let half = usize::from(self.counts[0] > self.counts[1]);
        self.counts[half] += 1;
        let part = 1.0 / self.counts[half] as f32;
        match &mut self.halves[half] {
            Some(mean) => {
                for (mean, drawn) in mean.pixels.iter_mut().zip(&drawn.pixels) {
                    *mean += (*drawn - *mean) * part;
                }
            }
            empty => *empty = Some(drawn),
        }
    }

    /// `None` before the second picture. The mean of both halves has half the noise of their difference.
    fn mean_and_noise(&self, studio: &ThumbnailRenderer) -> Option<(Image, f32)> {
        let [Some(a), Some(b)] = &self.halves else { return None };
        let part = self.counts[1] as f32 / (self.counts[0] + self.counts[1]) as f32;
        let pixels = a.pixels.iter().zip(&b.pixels).map(|(a, b)| a.lerp(*b, part)).collect();
        let noise = 0.5 * average(&studio.difference(a, b));
        Some((Image { pixels, ..*a }, noise))
    }
}

fn average(delta_e: &[f32]) -> f32 {
    delta_e.iter().sum::<f32>() / delta_e.len().max(1) as f32
}

fn difference(studio: &ThumbnailRenderer, now: &Image, right: &Image, noise: Option<f32>) -> Difference {
    let delta_e = studio.difference(now, right);
    Difference { image: Arc::new(image(now.width, now.height, &delta_e)), mean: average(&delta_e), noise }
}

fn image(width: usize, height: usize, delta_e: &[f32]) -> ColorImage {
    let color = |delta: &f32| {
        let [r, g, b] = heat(*delta).to_array().map(crate::render::image::tone_map::srgb_byte);
        eframe::egui::Color32::from_rgb(r, g, b)
    };
    ColorImage::new([width, height], delta_e.iter().map(color).collect())
}
