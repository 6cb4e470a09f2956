//! Accuracy against time of the open scene. Quality levels and the scene's own settings first state their errors. Then they
//! are compared with a reference that is refined in the background.

use std::sync::Arc;
use std::time::Instant;

use crate::app::views::difference;
use crate::base::{Error, Result};
use crate::effective::EffectiveBrdf;
use crate::pipeline::{Outcome, Pipeline};
use crate::plan::effect_names;
use crate::render::Image;
use crate::report::{EffectCost, ThumbnailRenderer, measure_effects};
use crate::scene::{LoadedScene, Quality};
use crate::tuning::candidates::with_settings;
use crate::tuning::progressive::{ProgressiveReference, ReferenceErrors};
use crate::tuning::quality_scale;
use eframe::egui::ColorImage;

use super::runner::JobContext;

/// A scene to measure.
#[derive(Debug, Clone)]
pub struct AccuracyJob {
    pub version: u64,
    pub loaded: Arc<LoadedScene>,
    pub chart: AccuracyChart,
    /// Continue to refine the reference and render the difference image.
    pub compare: bool,
    /// Measure each effect forced on and off.
    pub effects: bool,
}

/// Points of the chart to measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AccuracyChart {
    None,
    /// The fastest quality levels, by their stated errors.
    First,
    /// The scene's settings and all quality levels, also against the reference.
    Whole,
}

/// Time and error of one quality level on this machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccuracyPoint {
    pub facets: usize,
    pub ms: f64,
    pub compared: ReferenceErrors,
}

/// Difference of PSNR [dB] from which settings count as finer.
pub const FINER_DB: f64 = 0.5;

impl AccuracyPoint {
    /// Returns true if two points are those of the same settings, measured at two times.
    pub fn is_same(&self, other: &Self) -> bool {
        let [own, others] = [self, other].map(|point| point.compared.psnr_db);
        // The same value also stands for two points without any error, whose PSNR is infinite.
        self.facets == other.facets && (own == others || (own - others).abs() <= FINER_DB)
    }
}

/// A report of the worker that measures accuracy.
#[derive(Debug, Clone)]
pub enum AccuracyResult {
    /// The settings that are being measured.
    Doing(String),
    /// All quality levels measured so far.
    Levels(Vec<AccuracyPoint>),
    /// The settings of a version of the document.
    Current(u64, AccuracyPoint),
    /// Difference between the image of a version of the document and the reference image.
    Difference(u64, Difference),
    /// Cost and change of each effect.
    Effects(u64, Vec<EffectCost>),
    Done(u64),
    Failed(String),
}

/// ΔE between the current image and a more accurate one.
#[derive(Debug, Clone)]
pub struct Difference {
    pub image: Arc<ColorImage>,
    pub mean: f32,
    /// Part of the mean that is noise of the reference image; `None` if the finest level replaces the reference.
    pub noise: Option<f32>,
}

/// Quality levels of the chart.
const LEVELS: [f64; 5] = [4.0, 6.0, 8.0, 10.0, 12.0];
/// Number of levels that are measured before the image is final.
const FIRST_LEVELS: usize = 2;
/// Quality level that replaces the reference in difference images, if the reference is too slow for images.
const FINEST: f64 = 12.0;
/// Direction pairs of the reference.
const PAIRS: usize = 96;
/// Batches of the reference for the chart, and for the comparison.
const BATCHES: [usize; 2] = [2, 24];
/// Runs of an effect on and off, and of one that is slow.
const EFFECT_RUNS: [u64; 2] = [3, 3];
/// Number of noisy reference images that are averaged.
const IMAGES: u64 = 24;

/// The worker's state. The reference and the levels belong to a scene, independent of its settings.
pub struct AccuracyWorker {
    key: Option<Box<LoadedScene>>,
    pipeline: Pipeline,
    reference: Option<ProgressiveReference>,
    levels: Vec<MeasuredLevel>,
}

/// A measured quality level.
struct MeasuredLevel {
    level: f64,
    point: AccuracyPoint,
    /// The result, until it is compared with the reference.
    brdf: Option<Arc<EffectiveBrdf>>,
}

impl Default for AccuracyWorker {
    fn default() -> Self {
        Self { key: None, pipeline: crate::gpu::pipeline(), reference: None, levels: Vec::new() }
    }
}

impl AccuracyWorker {
    pub fn work(&mut self, job: &AccuracyJob, context: &JobContext<AccuracyJob>, report: &dyn Fn(AccuracyResult)) {
        match self.measure(job, context, report) {
            Ok(()) => report(AccuracyResult::Done(job.version)),
            Err(Error::Cancelled) => {}
            Err(error) => report(AccuracyResult::Failed(error.to_string())),
        }
    }

    fn measure(
        &mut self,
        job: &AccuracyJob,
        context: &JobContext<AccuracyJob>,
        report: &dyn Fn(AccuracyResult),
    ) -> Result<()> {
        self.pipeline.set_cancel(context.cancel.clone());
        let job = &AccuracyJob { loaded: Arc::new(self.pipeline.with_same_light(&job.loaded)?), ..job.clone() };
        let key = without_settings(&job.loaded);
        if self.key.as_deref() != Some(&key) {
            *self = Self { key: Some(Box::new(key)), ..Self::default() };
        }
        self.pipeline.set_cancel(context.cancel.clone());
        if job.effects {
            let (mut done, all) = (0, effect_names().count());
            let costs = measure_effects(&job.loaded, EFFECT_RUNS, context.cancel, |name| {
                done += 1;
                report(AccuracyResult::Doing(format!("{done} of {all}: {}", name.replace('_', " "))));
            })?;
            report(AccuracyResult::Effects(job.version, costs));
        }
        match job.chart {
            AccuracyChart::None => return Ok(()),
            AccuracyChart::First => {
                let coarsest = with_settings(&job.loaded, &quality_scale::candidate_at(LEVELS[0], false))?;
                let overhangs = self.pipeline.effective(&coarsest)?.plan.overhangs();
                return self.measure_levels(job, &LEVELS[..FIRST_LEVELS], overhangs, context, report);
            }
            AccuracyChart::Whole => {}
        }
        let outcome = self.pipeline.effective(&job.loaded)?;
        let ms = self.edit_ms(&job.loaded)?;
        let mut current = stated_point(&outcome, ms);
        report(AccuracyResult::Current(job.version, current));
        self.measure_levels(job, &LEVELS, outcome.plan.overhangs(), context, report)?;
        report(AccuracyResult::Doing("Reference".to_owned()));
        let mut reference = self.reference.take().unwrap_or_else(|| ProgressiveReference::new(PAIRS));
        while reference.batches < BATCHES[0] {
            reference.refine(&mut self.pipeline, &job.loaded)?;
            context.cancel.check()?;
        }
        self.reference = Some(reference.clone());
        current.compared = reference.compare(&outcome.brdf);
        report(AccuracyResult::Current(job.version, current));
        for measured in self.levels.iter_mut().filter(|measured| measured.point.compared.is_stated()) {
            if let Some(brdf) = measured.brdf.take() {
                measured.point.compared = reference.compare(&brdf);
            }
        }
        report(AccuracyResult::Levels(self.points()));
        if job.compare { self.compare(job, context, report, reference, &outcome, current) } else { Ok(()) }
    }

    fn points(&self) -> Vec<AccuracyPoint> {
        self.levels.iter().map(|measured| measured.point).collect()
    }

    /// Measures the time and the stated error of the quality levels that are not known yet, the fastest first.
    fn measure_levels(
        &mut self,
        job: &AccuracyJob,
        levels: &[f64],
        overhangs: bool,
        context: &JobContext<AccuracyJob>,
        report: &dyn Fn(AccuracyResult),
    ) -> Result<()> {
        for (at, &level) in levels.iter().enumerate() {
            if self.levels.iter().any(|measured| measured.level == level) {
                continue;
            }
            context.cancel.check()?;
            report(AccuracyResult::Doing(format!("Settings {} of {}", at + 1, levels.len())));
            let scene = with_settings(&job.loaded, &quality_scale::candidate_at(level, overhangs))?;
            let ms = self.edit_ms(&scene)?;
            let outcome = self.pipeline.effective(&scene)?;
            let point = stated_point(&outcome, ms);
            self.levels.push(MeasuredLevel { level, point, brdf: Some(outcome.brdf) });
            report(AccuracyResult::Levels(self.points()));
        }
        report(AccuracyResult::Levels(self.points()));
        Ok(())
    }

    /// Renders the difference from the mean of noisy reference images, and refines the reference between them.
    fn compare(
        &mut self,
        job: &AccuracyJob,
        context: &JobContext<AccuracyJob>,
        report: &dyn Fn(AccuracyResult),
        mut reference: ProgressiveReference,
        outcome: &Outcome,
        mut current: AccuracyPoint,
    ) -> Result<()> {
        let thumbnails = ThumbnailRenderer::new(&job.loaded)?;
        let current_image = thumbnails.image(&*outcome.brdf)?;
        let mut mean = MeanImage::default();
        for seed in 0..IMAGES {
            context.cancel.check()?;
            report(AccuracyResult::Doing(format!("Reference {} of {IMAGES}", seed + 1)));
            let sample = self.pipeline.with_reference(&job.loaded, |reference| {
                thumbnails.reference_image(reference, seed, context.cancel)
            })??;
            match sample {
                Some(sample) => mean.add(sample),
                // With interreflection, the finest level replaces the reference.
                None if seed == 0 => {
                    let settings = quality_scale::candidate_at(FINEST, outcome.plan.overhangs());
                    let fine = with_settings(&job.loaded, &settings)?;
                    let finest = thumbnails.image(&*self.pipeline.effective(&fine)?.brdf)?;
                    report(AccuracyResult::Difference(
                        job.version,
                        compared(&thumbnails, &current_image, &finest, None),
                    ));
                }
                None => {}
            }
            if let Some((mean_image, noise)) = mean.mean_and_noise(&thumbnails) {
                let shown = compared(&thumbnails, &current_image, &mean_image, Some(noise));
                report(AccuracyResult::Difference(job.version, shown));
            }
            if reference.batches < BATCHES[1] {
                reference.refine(&mut self.pipeline, &job.loaded)?;
                self.reference = Some(reference.clone());
                current.compared = reference.compare(&outcome.brdf);
                report(AccuracyResult::Current(job.version, current));
            }
        }
        Ok(())
    }

    /// The time of an edit that requires new facets [ms].
    fn edit_ms(&mut self, scene: &LoadedScene) -> Result<f64> {
        let mut moved = scene.clone();
        moved.scene.quality.seed ^= 1;
        self.pipeline.effective(&moved)?;
        let start = Instant::now();
        self.pipeline.effective(scene)?;
        Ok(start.elapsed().as_secs_f64() * 1e3)
    }
}

/// The point of a result by its stated error.
fn stated_point(outcome: &Outcome, ms: f64) -> AccuracyPoint {
    AccuracyPoint { facets: outcome.settings.facets, ms, compared: ReferenceErrors::stated(outcome) }
}

/// The inputs of the reference and of the levels: the scene without settings, object, light and camera.
pub fn without_settings(loaded: &LoadedScene) -> LoadedScene {
    let mut key = loaded.clone();
    key.scene.quality = Quality { seed: key.scene.quality.seed, ..Quality::default() };
    key.scene.camera = None;
    key.scene.object = Default::default();
    key.scene.light = Default::default();
    key.name.clear();
    key
}

/// Mean image, stored as the means of two halves of the samples. Their difference estimates the noise.
#[derive(Default)]
struct MeanImage {
    halves: [Option<Image>; 2],
    counts: [usize; 2],
}

impl MeanImage {
    fn add(&mut self, sample: Image) {
        let half = usize::from(self.counts[0] > self.counts[1]);
        self.counts[half] += 1;
        let part = 1.0 / self.counts[half] as f32;
        match &mut self.halves[half] {
            Some(mean) => {
                for (mean, sample) in mean.pixels.iter_mut().zip(&sample.pixels) {
                    *mean += (*sample - *mean) * part;
                }
            }
            empty => *empty = Some(sample),
        }
    }

    /// The mean and its noise; `None` with fewer than two samples. The mean has half the noise of the difference.
    fn mean_and_noise(&self, thumbnails: &ThumbnailRenderer) -> Option<(Image, f32)> {
        let [Some(a), Some(b)] = &self.halves else { return None };
        let part = self.counts[1] as f32 / (self.counts[0] + self.counts[1]) as f32;
        let pixels = a.pixels.iter().zip(&b.pixels).map(|(a, b)| a.lerp(*b, part)).collect();
        let noise = 0.5 * average(&thumbnails.difference(a, b));
        Some((Image { pixels, ..*a }, noise))
    }
}

fn average(delta_e: &[f32]) -> f32 {
    delta_e.iter().sum::<f32>() / delta_e.len().max(1) as f32
}

fn compared(thumbnails: &ThumbnailRenderer, current: &Image, reference: &Image, noise: Option<f32>) -> Difference {
    let delta_e = thumbnails.difference(current, reference);
    Difference { image: Arc::new(image(current.width, current.height, &delta_e)), mean: average(&delta_e), noise }
}

fn image(width: usize, height: usize, delta_e: &[f32]) -> ColorImage {
    let pixels = delta_e.iter().map(|delta_e| difference::color(*delta_e)).collect();
    ColorImage::new([width, height], pixels)
}
