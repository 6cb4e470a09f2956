//! Sweeps over settings: the time of each candidate and its error against a reference.

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

/// Upper ends of the bands of angles for which errors are listed [degrees]. A pair belongs to the band of the larger
/// of its two angles from the normal.
pub const BANDS_DEG: [f32; 4] = [30.0, 55.0, 70.0, 85.0];

/// Reference values at the direction pairs of a sweep.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ReferenceValues {
    pub pairs: Vec<Pair>,
    pub f_bar: Vec<Vec3>,
    /// Relative L2 of the standard errors.
    #[serde(rename = "own")]
    pub std_error: f64,
    /// PSNR of the standard errors [dB].
    #[serde(rename = "own_db")]
    pub std_error_db: f64,
    /// Number of reference passes.
    pub passes: usize,
    pub seconds: f64,
    /// Index of the first pair for albedos. Each light has [`ALBEDO_VIEWS`] of them at the end of `pairs`.
    first_albedo: usize,
}

/// Angles of the lights whose directional albedo is compared [degrees].
const ALBEDO_LIGHTS_DEG: [f32; 3] = [10.0, 45.0, 75.0];
/// View directions over which an albedo is summed.
const ALBEDO_VIEWS: usize = 64;

impl ReferenceValues {
    /// Computes the reference at `count` mirror-biased pairs and at the pairs of the albedos. `progress(passes,
    /// standard error)` returns whether to continue.
    ///
    /// # Errors
    /// Returns the errors of [`Pipeline::effective`].
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
        let (mut std_error, mut passes) = (0.0, 0);
        let estimates = crate::gpu::pipeline().with_reference(scene, |reference| {
            reference.estimate(&pairs, settings, |done, error| {
                (std_error, passes) = (error, done);
                progress(done, error)
            })
        })?;
        let f_bar: Vec<Vec3> = estimates.iter().map(|estimate| estimate.f_bar).collect();
        let upper: Vec<Vec3> = estimates.iter().map(|estimate| estimate.f_bar + estimate.standard_error).collect();
        let std_error_db = compare(&upper, &f_bar).psnr_db.min(MAX_DB);
        let seconds = start.elapsed().as_secs_f64();
        Ok(Self { pairs, f_bar, std_error, std_error_db, passes, seconds, first_albedo: count })
    }

    /// Errors over all pairs except those of the albedos.
    pub fn errors(&self, values: &[Vec3]) -> Errors {
        compare(&values[..self.first_albedo], &self.f_bar[..self.first_albedo])
    }

    /// Relative L2 in each band of [`BANDS_DEG`].
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
            .map(|(values, exact)| {
                let (sum, exact) = (total(values), total(exact));
                if exact.length() > 0.0 { (sum - exact).length() / exact.length() } else { sum.length() }
            })
            .fold(0.0, f64::max)
    }
}

/// The k-th of [`ALBEDO_VIEWS`] directions with the density cos θ / π. The mean over them estimates the integral of an
/// albedo.
fn cosine_direction(k: usize) -> Vec3 {
    let height = (k as f32 + 0.5) / ALBEDO_VIEWS as f32;
    from_angles(height.sqrt().asin(), k as f32 * 2.399_963_2)
}

/// Time and errors of one candidate on one scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SweepPoint {
    pub scene: String,
    /// Command-line options that select the settings.
    pub settings: String,
    pub family: Family,
    pub preset: String,
    /// Milliseconds from a geometry edit to the effective BRDF.
    pub ms: f64,
    /// Microseconds per direction pair on one thread.
    pub query_us: f64,
    pub rel_l2: f64,
    pub psnr_db: f64,
    /// Largest relative error of a directional albedo.
    pub albedo_error: f64,
    pub rel_l2_by_angle: [f64; BANDS_DEG.len()],
    pub stages: Vec<(String, f64)>,
    /// Representation of the effective BRDF.
    #[serde(rename = "form")]
    pub representation: String,
}

/// PSNR that stands for no difference, because JSON has no infinity [dB].
const MAX_DB: f64 = 300.0;

/// Largest number of timed runs. Their median is reported.
const MAX_RUNS: usize = 5;
/// Time after which no further run starts [s].
const ENOUGH_SECONDS: f64 = 1.5;
/// Duration of a first run above which it is the only run [s].
const LONG_SECONDS: f64 = 2.0;

/// Times a geometry edit at a candidate's settings and compares the result with the reference.
///
/// # Errors
/// Returns the errors of [`Pipeline::effective`].
pub fn measure(
    loaded: &LoadedScene,
    candidate: &Candidate,
    reference: &ReferenceValues,
) -> Result<(SweepPoint, Outcome)> {
    let scene = with_settings(loaded, candidate)?;
    let mut edited = scene.clone();
    let edits = edited.scene.nudge_geometry().is_some();
    let mut pipeline = crate::gpu::pipeline();
    let mut runs: Vec<(f64, Vec<(&'static str, f64)>)> = Vec::new();
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
    let values: Vec<Vec3> = reference.pairs.par_iter().map(|pair| outcome.brdf.eval(pair.i, pair.o)).collect();
    let errors = reference.errors(&values);
    let point = SweepPoint {
        scene: loaded.name.clone(),
        settings: candidate.cli_args(),
        family: candidate.family.clone(),
        preset: candidate.preset.to_owned(),
        ms,
        query_us: query_us(&outcome, reference),
        rel_l2: errors.rel_l2,
        psnr_db: errors.psnr_db.min(MAX_DB),
        albedo_error: reference.albedo_error(&values),
        rel_l2_by_angle: reference.by_angle(&values),
        stages: times.iter().map(|(name, ms)| ((*name).to_owned(), *ms)).collect(),
        representation: outcome.brdf.representation.describe(),
    };
    Ok((point, outcome))
}

/// Microseconds per pair on one thread. All lights of a view are evaluated together, as in rendering.
fn query_us(outcome: &Outcome, reference: &ReferenceValues) -> f64 {
    const LIGHTS: usize = 8;
    let lights: Vec<Vec3> = reference.pairs.iter().take(LIGHTS).map(|pair| pair.i).collect();
    let mut out = vec![Vec3::ZERO; lights.len()];
    let start = Instant::now();
    let mut views = 0;
    for pair in reference.pairs.iter().take(64) {
        outcome.brdf.eval_lights(&lights, pair.o, &mut out);
        views += 1;
        if start.elapsed().as_secs_f64() > 0.1 {
            break;
        }
    }
    start.elapsed().as_secs_f64() * 1e6 / (views * lights.len()).max(1) as f64
}

/// Indices of the Pareto front in order of time: no other point is both faster and more accurate.
pub fn pareto(points: &[&SweepPoint]) -> Vec<usize> {
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

/// Time and standard error of the reference itself.
pub fn reference_point(scene: &str, reference: &ReferenceValues) -> SweepPoint {
    SweepPoint {
        scene: scene.to_owned(),
        settings: "--quality reference".to_owned(),
        family: Family::Preset,
        preset: Preset::Reference.name().to_owned(),
        ms: reference.seconds * 1e3,
        query_us: reference.seconds * 1e6 / reference.pairs.len().max(1) as f64,
        rel_l2: reference.std_error,
        psnr_db: reference.std_error_db,
        albedo_error: reference.std_error,
        rel_l2_by_angle: [reference.std_error; BANDS_DEG.len()],
        stages: vec![("reference".to_owned(), reference.seconds * 1e3)],
        representation: format!("{} passes over {} pairs, rays", reference.passes, reference.pairs.len()),
    }
}

/// Returns true if a point is a preset without overrides.
pub fn is_preset(point: &SweepPoint, preset: Preset) -> bool {
    point.family == Family::Preset && point.preset == preset.name()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(ms: f64, rel_l2: f64) -> SweepPoint {
        SweepPoint {
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
            representation: String::new(),
        }
    }

    #[test]
    fn the_front_holds_the_points_that_no_other_beats_in_both_time_and_error() {
        let points = [point(3.0, 0.1), point(1.0, 0.5), point(2.0, 0.6), point(4.0, 0.1), point(9.0, 0.01)];
        let points: Vec<&SweepPoint> = points.iter().collect();
        assert_eq!(pareto(&points), [1, 0, 4]);
    }

    #[test]
    fn the_mean_of_the_cosine_over_cosine_distributed_directions_is_two_thirds() {
        // ∫ cos θ · cos θ dω / π = 2/3.
        let mean = (0..ALBEDO_VIEWS).map(|k| f64::from(cosine_direction(k).z)).sum::<f64>() / ALBEDO_VIEWS as f64;
        assert!((mean - 2.0 / 3.0).abs() < 1e-3, "{mean}");
    }
}
