//! The lobe that a slab makes of one light, by its models and by photons, and the parts of the light.

use std::sync::Arc;
use std::time::Duration;

use crate::base::{Cancel, Error, Result};
use crate::pipeline::{Pipeline, SlabOutcome};
use crate::plan::Preset;
use crate::render::image::tone_map::srgb_byte;
use crate::scene::{LoadedScene, Switch};
use crate::slab::{DiscLobe, Method, Slab};
use eframe::egui::{Color32, ColorImage};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::gpu_drafts::as_preset;
use super::lobe::logarithmic;
use super::runner::JobContext;
use super::slab_truth::{Truth, TruthState};

/// Steps of a curve, from horizon to horizon.
pub const STEPS: usize = 120;
/// Cells per side of the square around the disc.
pub(super) const SIDE: usize = 64;
/// Most batches of photons.
const BATCHES: usize = 64;
/// Noise of the truth at which the photons end: relative L2 of the standard errors.
const NOISE: f64 = 0.01;
/// Time without a new job after which the slab is computed at the scene's own quality.
const PAUSE: Duration = Duration::from_millis(150);

/// A slab and the direction to its light.
#[derive(Debug, Clone)]
pub struct SlabLobeJob {
    pub loaded: Arc<LoadedScene>,
    pub light: Vec3,
    pub log: bool,
}

/// BTDF [1/sr], channel mean, by the angle of the viewer below the slab in the plane of incidence: from the horizon on the
/// side of the light to the other.
#[derive(Debug, Clone, PartialEq)]
pub struct LobeCurve {
    pub name: &'static str,
    pub values: Vec<f32>,
    /// Standard errors of a truth.
    pub errors: Option<Vec<f32>>,
}

/// The plots of one light.
#[derive(Debug, Clone)]
pub struct SlabLobe {
    pub light: Vec3,
    pub curves: Vec<LobeCurve>,
    /// Transmitted light over (o.x, o.y): x to the right, y up.
    pub disc: Arc<ColorImage>,
    /// Parts of the incident light; together 1.
    pub parts: [(&'static str, f32); 5],
    pub truth: Option<TruthState>,
}

/// A report of the worker.
#[derive(Debug, Clone)]
pub enum SlabLobeResult {
    Lobe(Box<SlabLobe>),
    Failed(String),
}

pub fn work(
    pipeline: &mut Pipeline,
    job: &SlabLobeJob,
    context: &JobContext<SlabLobeJob>,
    report: &dyn Fn(SlabLobeResult),
) {
    let never = Cancel::default();
    // The draft is never cancelled, so that the plots follow the pointer.
    pipeline.set_cancel(never);
    let draft = || -> Result<SlabLobe> {
        let outcome = pipeline.slab(&as_preset(&job.loaded, Preset::Draft))?;
        Ok(Models::new(&outcome, job, false).lobe(job))
    };
    match draft() {
        Ok(lobe) => report(SlabLobeResult::Lobe(Box::new(lobe))),
        Err(error) => return report(SlabLobeResult::Failed(error.to_string())),
    }
    if !context.is_newest_after(PAUSE) {
        return;
    }
    pipeline.set_cancel(context.cancel.clone());
    match refine(pipeline, job, context.cancel, report) {
        Ok(()) | Err(Error::Cancelled) => {}
        Err(error) => report(SlabLobeResult::Failed(error.to_string())),
    }
}

fn refine(pipeline: &Pipeline, job: &SlabLobeJob, cancel: &Cancel, report: &dyn Fn(SlabLobeResult)) -> Result<()> {
    let outcome = pipeline.slab(&job.loaded)?;
    let models = Models::new(&outcome, job, true);
    cancel.check()?;
    report(SlabLobeResult::Lobe(Box::new(models.lobe(job))));
    // A captured sheet has no faces for photons.
    if outcome.slab.captured.is_some() {
        return Ok(());
    }
    let bounces = job.loaded.scene.slab.as_ref().is_some_and(|slab| slab.bounces == Switch::On);
    let mut truth = Truth::new(&outcome, job.light.as_dvec3(), bounces);
    for _ in 0..BATCHES {
        truth.add_batch(cancel)?;
        let mut lobe = models.lobe(job);
        lobe.curves.push(truth.curve());
        let state = truth.state(&models.cells);
        let done = state.noise < NOISE;
        lobe.truth = Some(state);
        report(SlabLobeResult::Lobe(Box::new(lobe)));
        if done {
            break;
        }
    }
    Ok(())
}

/// The lobes of the models of a slab.
struct Models {
    curves: Vec<LobeCurve>,
    /// Means over the cells of the disc, channel mean, by model.
    cells: Vec<(&'static str, Vec<f64>)>,
    disc: Arc<ColorImage>,
    parts: [(&'static str, f32); 5],
}

impl Models {
    /// Computes the lobe of Eq. 11, and the sum over facets if `all` are asked for. The disc shows the scene's own method.
    fn new(outcome: &SlabOutcome, job: &SlabLobeJob, all: bool) -> Self {
        let i = job.light.as_dvec3();
        let slab = &*outcome.slab;
        let mut models: Vec<(&'static str, Slab)> = Vec::new();
        if slab.captured.is_some() {
            models.push(("captured", slab.clone()));
        } else {
            models.push(("Eq. 11", Slab { method: Method::Dual, ..slab.clone() }));
            if all {
                models.push(("faces", slab.clone().by_faces(outcome.settings.facets.max(64))));
            }
        }
        let own = usize::from(all && slab.method == Method::Faces).min(models.len() - 1);
        let curve = |(name, slab): &(&'static str, Slab)| LobeCurve { name, values: plane(slab, i), errors: None };
        let lobes: Vec<DiscLobe> = models.iter().map(|(_, slab)| DiscLobe::transmitted(slab, i, SIDE)).collect();
        let grey = |lobe: &DiscLobe| lobe.values.iter().map(|value| value.element_sum() / 3.0).collect();
        Self {
            curves: models.iter().map(curve).collect(),
            cells: models.iter().zip(&lobes).map(|((name, _), lobe)| (*name, grey(lobe))).collect(),
            disc: Arc::new(disc_image(&lobes[own], job.log)),
            parts: parts(slab, &lobes[own], i),
        }
    }

    fn lobe(&self, job: &SlabLobeJob) -> SlabLobe {
        let (curves, disc) = (self.curves.clone(), self.disc.clone());
        SlabLobe { light: job.light, curves, disc, parts: self.parts, truth: None }
    }
}

/// Directions below the slab in the plane of incidence.
pub(super) fn plane_direction(i: DVec3, step: usize) -> DVec3 {
    let along = -i.truncate().try_normalize().unwrap_or(DVec2::NEG_X);
    let theta = (step as f64 / STEPS as f64 - 0.5) * std::f64::consts::PI;
    (theta.sin() * along).extend(-theta.cos().max(0.0))
}

fn plane(slab: &Slab, i: DVec3) -> Vec<f32> {
    let value = |step: usize| (slab.btdf(i, plane_direction(i, step)).element_sum() / 3.0) as f32;
    (0..=STEPS).into_par_iter().map(value).collect()
}

/// Parts of the incident light, channel means.
fn parts(slab: &Slab, transmitted: &DiscLobe, i: DVec3) -> [(&'static str, f32); 5] {
    let grey = |value: DVec3| (value.element_sum() / 3.0) as f32;
    let [straight, mirrored] = slab.straight(i).map(grey);
    let left = DVec3::select(slab.optics.eta.cmpne(DVec3::ONE), DVec3::ONE - slab.optics.diffuse, DVec3::ZERO);
    let bounced =
        slab.parts(i).map_or(0.0, |parts| grey(left * DVec3::from_array(parts.map(|parts| parts.after_bounces))));
    // Light that bounces between level facets is straight.
    let total = grey(transmitted.total());
    let bounced = bounced.min(total);
    let through = total - bounced;
    let reflected = if slab.captured.is_some() { 0.0 } else { grey(DiscLobe::reflected(slab, i, SIDE).total()) };
    let reflected = reflected + mirrored;
    let rest = (1.0 - through - bounced - straight - reflected).max(0.0);
    let rest_name = match (&slab.captured, &slab.inner) {
        (Some(_), _) => "not captured",
        (None, Some(_)) => "absorbed",
        (None, None) => "left out",
    };
    [("through", through), ("bounced", bounced), ("straight", straight), ("reflected", reflected), (rest_name, rest)]
}

/// The lobe as an image: row 0 on top is the largest y.
fn disc_image(lobe: &DiscLobe, log: bool) -> ColorImage {
    let peak = lobe.values.iter().fold(f64::MIN_POSITIVE, |peak, value| peak.max(value.max_element()));
    let color = |k: usize| {
        let (x, y) = (k % SIDE, SIDE - 1 - k / SIDE);
        let centre = (DVec2::new(x as f64, y as f64) + 0.5) * (2.0 / SIDE as f64) - 1.0;
        if centre.length_squared() > 1.0 {
            return Color32::TRANSPARENT;
        }
        let value = (lobe.values[y * SIDE + x] / peak).as_vec3();
        let [r, g, b] = (if log { logarithmic(value) } else { value }).to_array().map(srgb_byte);
        Color32::from_rgb(r, g, b)
    };
    ColorImage::new([SIDE, SIDE], (0..SIDE * SIDE).map(color).collect())
}

#[cfg(test)]
#[path = "slab_lobe_tests.rs"]
mod tests;
