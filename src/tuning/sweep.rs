//! What each knob costs and buys: settings to try, and what each leaves of the truth in how many milliseconds.

use std::time::Instant;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::candidates::{Candidate, Family, with_settings};
use crate::base::Result;
use crate::effective::Reflectance;
use crate::math::directions::from_angles;
use crate::metrics::{Errors, Pair, compare, mirror_biased_pairs};
use crate::pipeline::Outcome;
use crate::plan::Preset;
use crate::reference::ReferenceSettings;
use crate::scene::LoadedScene;

/// Upper ends [rad] of the bands that errors are listed by: the larger of the two angles from the normal.
pub const BANDS_DEG: [f32; 4] = [30.0, 55.0, 70.0, 85.0];

/// Directions that are asked for, and what is right there.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Truth {
    pub pairs: Vec<Pair>,
    pub f_bar: Vec<Vec3>,
    /// Relative L2 of the reference's own standard errors, and the same as a PSNR [dB].
    pub own: f64,
    pub own_db: f64,
    /// Reference passes that were summed, and the seconds they took.
    pub passes: usize,
    pub seconds: f64,
    /// Lights of the directional albedo, each with [`ALBEDO_VIEWS`] pairs at the end of `pairs`.
    first_albedo: usize,
}

/// Angles of the lights whose reflected fraction is compared [degrees], and the directions it is summed over.
const ALBEDO_LIGHTS_DEG: [f32; 3] = [10.0, 45.0, 75.0];
const ALBEDO_VIEWS: usize = 64;

impl Truth {
    /// The reference at `count` mirror-biased pairs and at those of the albedos. `progress(passes, own error)` says whether
    /// to go on.
    ///
    /// # Errors
    /// As [`Pipeline::effective`].
    pub fn new(
        scene: &LoadedScene,
        count: usize,
        settings: &ReferenceSettings,
        mut progress: impl FnMut(usize, f64) -> bool,
    ) -> Result<Self> {
        let mut pairs = mirror_biased_pairs(count, 20_110_801);
        for light in ALBEDO_LIGHTS_DEG {
            let i = from_angles(light.to_radians(), 0.4);
            pairs.extend((0..ALBEDO_VIEWS).map(|k| Pair { i, o: cosine_direction(k) }));
        }
        let start = Instant::now();
        let (mut own, mut passes) = (0.0, 0);
        let estimates = crate::gpu::pipeline().with_reference(scene, |reference| {
            reference.estimate(&pairs, settings, |done, error| {
                (own, passes) = (error, done);
                progress(done, error)
            })
        })?;
        let f_bar: Vec<Vec3> = estimates.iter().map(|estimate| estimate.f_bar).collect();
        let off: Vec<Vec3> = estimates.iter().map(|estimate| estimate.f_bar + estimate.standard_error).collect();
        let own_db = compare(&off, &f_bar).psnr_db.min(MAX_DB);
        Ok(Self { pairs, f_bar, own, own_db, passes, seconds: start.elapsed().as_secs_f64(), first_albedo: count })
    }

    /// Errors over all pairs but the albedos'.
    pub fn errors(&self, values: &[Vec3]) -> Errors {
        compare(&values[..self.first_albedo], &self.f_bar[..self.first_albedo])
    }

    /// Relative L2 in each of [`BANDS_DEG`].
    pub fn by_angle(&self, values: &[Vec3]) -> [f64; BANDS_DEG.len()] {
        let band = |pair: &Pair| {
            let angle = pair.i.z.min(pair.o.z).acos().to_degrees();
            BANDS_DEG.iter().position(|end| angle <= *end).unwrap_or(BANDS_DEG.len() - 1)
        };
        std::array::from_fn(|wanted| {
            let inside = |all: &[Vec3]| -> Vec<Vec3> {
                let chosen =
                    self.pairs.iter().zip(all).take(self.first_albedo).filter(|(pair, _)| band(pair) == wanted);
                chosen.map(|(_, value)| *value).collect()
            };
            compare(&inside(values), &inside(&self.f_bar)).rel_l2
        })
    }

    /// The largest relative error of a directional albedo.
    pub fn albedo_error(&self, values: &[Vec3]) -> f64 {
        let total = |all: &[Vec3]| all.iter().map(|f_bar| f_bar.as_dvec3()).sum::<DVec3>();
        values[self.first_albedo..]
            .chunks(ALBEDO_VIEWS)
            .zip(self.f_bar[self.first_albedo..].chunks(ALBEDO_VIEWS))
            .map(|(got, right)| {
                let (got, right) = (total(got), total(right));
                if right.length() > 0.0 { (got - right).length() / right.length() } else { got.length() }
            })
            .fold(0.0, f64::max)
    }
}

/// The k-th of [`ALBEDO_VIEWS`] directions with a density of cos θ / π, so that their plain mean is the albedo's integral.
fn cosine_direction(k: usize) -> Vec3 {
    let height = (k as f32 + 0.5) / ALBEDO_VIEWS as f32;
    from_angles(height.sqrt().asin(), k as f32 * 2.399_963_2)
}

/// What one setting costs and leaves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    pub scene: String,
    /// Words that repeat it on the command line.
    pub settings: String,
    pub family: Family,
    pub preset: String,
    /// Milliseconds from a geometry edit to the effective BRDF.
    pub ms: f64,
    /// Microseconds one direction pair takes on one thread.
    pub query_us: f64,
    pub rel_l2: f64,
    pub psnr_db: f64,
    /// Largest relative error of a directional albedo.
    pub albedo_error: f64,
    pub rel_l2_by_angle: [f64; BANDS_DEG.len()],
    pub stages: Vec<(String, f64)>,
    /// What holds the BRDF, in words.
    pub form: String,
}

/// No difference at all, as a number that JSON can hold [dB].
const MAX_DB: f64 = 300.0;

/// Most runs that a time is the median of, and the seconds after which there are no more.
const RUNS: usize = 5;
const ENOUGH_SECONDS: f64 = 1.5;
/// A first run longer than this is the only one.
const LONG_SECONDS: f64 = 2.0;

/// Times a geometry edit at a candidate's settings and compares what comes out with the truth.
///
/// # Errors
/// As [`Pipeline::effective`].
pub fn measure(loaded: &LoadedScene, candidate: &Candidate, truth: &Truth) -> Result<(Point, Outcome)> {
    let scene = with_settings(loaded, candidate)?;
    let mut moved = scene.clone();
    let edits = moved.scene.nudge_geometry().is_some();
    let mut pipeline = crate::gpu::pipeline();
    let mut runs: Vec<(f64, Vec<(&'static str, f64)>)> = Vec::new();
    let started = Instant::now();
    let mut outcome = pipeline.effective(&scene)?;
    let first = started.elapsed().as_secs_f64();
    if first > LONG_SECONDS && candidate.preset != Preset::Wu2011.name() {
        // What a warm-up could save is lost in this; not in the paper's hours before the first edit.
        runs.push((first * 1e3, outcome.times.clone()));
    }
    while runs.is_empty() || runs.len() < RUNS && started.elapsed().as_secs_f64() < ENOUGH_SECONDS {
        // There and back again, timed on the way back: what is measured is this scene.
        if edits {
            pipeline.effective(&moved)?;
        } else {
            pipeline = crate::gpu::pipeline();
        }
        let start = Instant::now();
        outcome = pipeline.effective(&scene)?;
        runs.push((start.elapsed().as_secs_f64() * 1e3, outcome.times.clone()));
    }
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (ms, times) = runs.swap_remove(runs.len() / 2);
    let values: Vec<Vec3> = truth.pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
    let errors = truth.errors(&values);
    let point = Point {
        scene: loaded.name.clone(),
        settings: candidate.words(),
        family: candidate.family.clone(),
        preset: candidate.preset.to_owned(),
        ms,
        query_us: query_us(&outcome, truth),
        rel_l2: errors.rel_l2,
        psnr_db: errors.psnr_db.min(MAX_DB),
        albedo_error: truth.albedo_error(&values),
        rel_l2_by_angle: truth.by_angle(&values),
        stages: times.iter().map(|(name, ms)| ((*name).to_owned(), *ms)).collect(),
        form: outcome.brdf.representation.describe(),
    };
    Ok((point, outcome))
}

/// Microseconds a pair on one thread, as a picture asks: all lights of one view together.
fn query_us(outcome: &Outcome, truth: &Truth) -> f64 {
    const LIGHTS: usize = 8;
    let lights: Vec<Vec3> = truth.pairs.iter().take(LIGHTS).map(|pair| pair.i).collect();
    let mut out = vec![Vec3::ZERO; lights.len()];
    let start = Instant::now();
    let mut views = 0;
    for pair in truth.pairs.iter().take(64) {
        outcome.brdf.eval_lights(&lights, pair.o, &mut out);
        views += 1;
        if start.elapsed().as_secs_f64() > 0.1 {
            break;
        }
    }
    start.elapsed().as_secs_f64() * 1e6 / (views * lights.len()).max(1) as f64
}

/// Is this one of the points that no other beats in both time and error?
pub fn pareto(points: &[&Point]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].ms.total_cmp(&points[b].ms).then(points[a].rel_l2.total_cmp(&points[b].rel_l2)));
    let mut best = f64::INFINITY;
    order.retain(|&k| {
        let better = points[k].rel_l2 < best;
        best = best.min(points[k].rel_l2);
        better
    });
    order
}

/// What the reference itself costs and leaves: all its passes, and its own standard error.
pub fn reference_point(scene: &str, truth: &Truth) -> Point {
    Point {
        scene: scene.to_owned(),
        settings: "--quality reference".to_owned(),
        family: Family::Preset,
        preset: Preset::Reference.name().to_owned(),
        ms: truth.seconds * 1e3,
        query_us: truth.seconds * 1e6 / truth.pairs.len().max(1) as f64,
        rel_l2: truth.own,
        psnr_db: truth.own_db,
        albedo_error: truth.own,
        rel_l2_by_angle: [truth.own; BANDS_DEG.len()],
        stages: vec![("reference".to_owned(), truth.seconds * 1e3)],
        form: format!("{} passes over {} pairs, rays", truth.passes, truth.pairs.len()),
    }
}

/// Is this the point of a preset as it is?
pub fn is_preset(point: &Point, preset: Preset) -> bool {
    point.family == Family::Preset && point.preset == preset.name()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(ms: f64, rel_l2: f64) -> Point {
        Point {
            scene: String::new(),
            settings: String::new(),
            family: Family::Combination,
            preset: String::new(),
            ms,
            query_us: 0.0,
            rel_l2,
            psnr_db: 0.0,
            albedo_error: 0.0,
            rel_l2_by_angle: [0.0; BANDS_DEG.len()],
            stages: Vec::new(),
            form: String::new(),
        }
    }

    #[test]
    fn the_front_holds_what_nothing_beats_in_both_time_and_error() {
        let points = [point(3.0, 0.1), point(1.0, 0.5), point(2.0, 0.6), point(4.0, 0.1), point(9.0, 0.01)];
        let points: Vec<&Point> = points.iter().collect();
        assert_eq!(pareto(&points), [1, 0, 4]);
    }

    #[test]
    fn the_mean_over_cosine_directions_of_a_constant_times_its_square_cosine_is_its_integral() {
        // ∫ cos θ · cos θ dω / π = 2/3.
        let mean = (0..ALBEDO_VIEWS).map(|k| f64::from(cosine_direction(k).z)).sum::<f64>() / ALBEDO_VIEWS as f64;
        assert!((mean - 2.0 / 3.0).abs() < 1e-3, "{mean}");
    }
}
