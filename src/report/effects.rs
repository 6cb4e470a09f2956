//! Measured cost and influence of each effect of the plan: milliseconds with the effect on and off, and the change of
//! f̄ and of the image.

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

/// Cost and influence of one effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectCost {
    pub name: &'static str,
    /// Time from a geometry edit to `f̄` and a small image with the effect on [ms].
    pub on_ms: f64,
    /// Time with the effect off [ms].
    pub off_ms: f64,
    /// Standard error of the difference between both [ms]; `None` after a single run.
    pub std_error_ms: Option<f64>,
    /// Time with the plan's own choice [ms]. It differs from one of the other two only by timing noise.
    pub auto_ms: f64,
    /// Relative L2 between `f̄` with and without the effect.
    pub rel_l2: f64,
    /// Mean CIE ΔE between the images with and without the effect.
    pub mean_delta_e: f64,
    /// 95th percentile of the CIE ΔE.
    pub high_delta_e: f64,
}

/// A scene with one state of an effect, which is timed several times.
struct Runner {
    scene: LoadedScene,
    renderer: ThumbnailRenderer,
    pipeline: Pipeline,
    outcome: Outcome,
    image: Image,
    first_ms: f64,
    times: Vec<f64>,
}

/// Duration of a first run above which an effect counts as slow [ms].
const SLOW_MS: f64 = 1500.0;
/// Direction pairs for the change of `f̄`.
const PAIRS: usize = 128;

/// Measures every effect that can be forced, as the median of `runs`: their usual number, and that of an effect that is
/// slow. `progress` receives the effect's name.
///
/// # Errors
/// Returns the errors of [`Pipeline::effective`], or an error if the object or the environment cannot be used.
pub fn measure_effects(
    loaded: &LoadedScene,
    runs: [u64; 2],
    cancel: &Cancel,
    mut progress: impl FnMut(&str),
) -> Result<Vec<EffectCost>> {
    let mut costs = Vec::new();
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
        // The three take turns, so that other load on the machine affects them alike. The last run uses the scene's own
        // seed.
        let slow = runners.iter().any(|runner| runner.first_ms > SLOW_MS);
        for run in (0..runs[usize::from(slow)].max(1)).rev() {
            for runner in &mut runners {
                runner.run(run, cancel)?;
            }
        }
        let [on, auto, off] = &mut runners[..] else { continue };
        let differences: Vec<f64> = on.times.iter().zip(&off.times).map(|(on, off)| on - off).collect();
        let mut delta_e = on.renderer.difference(&on.image, &off.image);
        delta_e.sort_by(f32::total_cmp);
        costs.push(EffectCost {
            name,
            on_ms: on.median_ms(),
            off_ms: off.median_ms(),
            std_error_ms: std_error(&differences),
            auto_ms: auto.median_ms(),
            rel_l2: compare(&off.values(), &on.values()).rel_l2,
            mean_delta_e: f64::from(delta_e.iter().sum::<f32>() / delta_e.len().max(1) as f32),
            high_delta_e: f64::from(delta_e.get(delta_e.len() * 95 / 100).copied().unwrap_or(0.0)),
        });
    }
    Ok(costs)
}

/// Standard error of the mean; `None` for fewer than two values.
fn std_error(values: &[f64]) -> Option<f64> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (values.len() > 1).then(|| (squares / (count - 1.0) / count).sqrt())
}

impl Runner {
    fn new(scene: LoadedScene, cancel: &Cancel) -> Result<Self> {
        let renderer = ThumbnailRenderer::new(&scene)?;
        let mut pipeline = crate::gpu::pipeline();
        pipeline.set_cancel(cancel.clone());
        let start = Instant::now();
        let outcome = pipeline.effective(&scene)?;
        let image = renderer.image(&*outcome.shading_brdf(cancel)?.brdf)?;
        let first_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(Self { scene, renderer, pipeline, outcome, image, first_ms, times: Vec::new() })
    }

    /// Times an edit with other facets, so that all stages after the mesh run. Run 0 uses the scene's own seed.
    fn run(&mut self, run: u64, cancel: &Cancel) -> Result<()> {
        let mut edited = self.scene.clone();
        // Facets that equal those of the last run would not be computed again.
        edited.scene.quality.seed ^= if self.times.is_empty() && run == 0 { 1 } else { run };
        let start = Instant::now();
        self.outcome = self.pipeline.effective(&edited)?;
        self.image = self.renderer.image(&*self.outcome.shading_brdf(cancel)?.brdf)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standard_error_of_a_mean_needs_two_values() {
        assert_eq!(std_error(&[7.0]), None);
        // Deviation √(2/2) = 1 of the values, √3 less of their mean.
        let error = std_error(&[1.0, 2.0, 3.0]).unwrap();
        assert!((error - 3.0_f64.sqrt().recip()).abs() < 1e-12, "{error}");
    }
}
