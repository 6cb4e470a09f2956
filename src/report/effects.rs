//! What each effect of the plan costs and changes, measured on the scene: on, off, and the picture between.

use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::ThumbnailRenderer;
use crate::base::{Cancel, Result};
use crate::metrics::{compare, mirror_biased_pairs};
use crate::pipeline::{Outcome, Pipeline};
use crate::plan::{effect_names, switch_mut};
use crate::render::Image;
use crate::scene::{LoadedScene, Switch};

/// An effect forced on and off.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectCost {
    pub name: &'static str,
    /// From a geometry edit to `f̄`, and a small picture [ms].
    pub on_ms: f64,
    pub off_ms: f64,
    /// As the plan has it: one of the other two, and what differs is the noise of the clock.
    pub auto_ms: f64,
    /// Relative L2 of `f̄` that it changes.
    pub rel_l2: f64,
    /// CIE ΔE of the picture that it changes: mean, and the 95th of a hundred pixels.
    pub mean_delta_e: f64,
    pub high_delta_e: f64,
}

/// A scene with an effect forced one way, timed again and again.
struct Runner {
    scene: LoadedScene,
    studio: ThumbnailRenderer,
    pipeline: Pipeline,
    outcome: Outcome,
    image: Image,
    first_ms: f64,
    times: Vec<f64>,
}

/// Times are medians of this many.
const RUNS: u64 = 5;
/// What takes longer than this the first time is timed once more only.
const SLOW_MS: f64 = 1500.0;
const PAIRS: usize = 128;

/// Measures every switch; `progress` hears its name.
///
/// # Errors
/// As [`Pipeline::effective`], and an object or environment that cannot be used.
pub fn measure_effects(
    loaded: &LoadedScene,
    cancel: &Cancel,
    mut progress: impl FnMut(&str),
) -> Result<Vec<EffectCost>> {
    let mut all = Vec::new();
    for name in effect_names() {
        let forced = |switch: Switch| {
            let mut scene = loaded.clone();
            if let Some(field) = switch_mut(&mut scene.scene.effects, name) {
                *field = switch;
            }
            scene
        };
        progress(name);
        let mut runners = Vec::with_capacity(3);
        for scene in [Switch::On, Switch::Auto, Switch::Off].map(forced) {
            runners.push(Runner::new(scene, cancel)?);
        }
        // In turn: what else the machine does meets all three alike. The last run is of the scene's own facets.
        let slow = runners.iter().any(|runner| runner.first_ms > SLOW_MS);
        for run in (0..if slow { 1 } else { RUNS }).rev() {
            for runner in &mut runners {
                runner.run(run, cancel)?;
            }
        }
        let [on, auto, off] = &mut runners[..] else { continue };
        let mut delta_e = on.studio.difference(&on.image, &off.image);
        delta_e.sort_by(f32::total_cmp);
        all.push(EffectCost {
            name,
            on_ms: on.median_ms(),
            off_ms: off.median_ms(),
            auto_ms: auto.median_ms(),
            rel_l2: compare(&off.values(), &on.values()).rel_l2,
            mean_delta_e: f64::from(delta_e.iter().sum::<f32>() / delta_e.len().max(1) as f32),
            high_delta_e: f64::from(delta_e.get(delta_e.len() * 95 / 100).copied().unwrap_or(0.0)),
        });
    }
    Ok(all)
}

impl Runner {
    fn new(scene: LoadedScene, cancel: &Cancel) -> Result<Self> {
        let studio = ThumbnailRenderer::new(&scene)?;
        let mut pipeline = crate::gpu::pipeline();
        pipeline.set_cancel(cancel.clone());
        let start = Instant::now();
        let outcome = pipeline.effective(&scene)?;
        let image = studio.image(&*outcome.shading_brdf(cancel)?.brdf)?;
        let first_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(Self { scene, studio, pipeline, outcome, image, first_ms, times: Vec::new() })
    }

    /// Other facets each time: all that an edit of the geometry asks for; 0 are the scene's own.
    fn run(&mut self, run: u64, cancel: &Cancel) -> Result<()> {
        let mut moved = self.scene.clone();
        // Never the facets that were drawn last.
        moved.scene.quality.seed ^= if self.times.is_empty() && run == 0 { 1 } else { run };
        let start = Instant::now();
        self.outcome = self.pipeline.effective(&moved)?;
        self.image = self.studio.image(&*self.outcome.shading_brdf(cancel)?.brdf)?;
        self.times.push(start.elapsed().as_secs_f64() * 1e3);
        Ok(())
    }

    fn median_ms(&mut self) -> f64 {
        self.times.sort_by(f64::total_cmp);
        self.times[self.times.len() / 2]
    }

    fn values(&self) -> Vec<Vec3> {
        let pairs = mirror_biased_pairs(PAIRS, 20_110_801);
        pairs.par_iter().map(|pair| self.outcome.brdf.eval(pair.i, pair.o)).collect()
    }
}
