//! Sweeps over settings: the time of each candidate and its error against a reference.

use std::time::Instant;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::candidates::Family;
use super::progressive::ReferenceErrors;
use crate::base::Result;
use crate::math::directions::from_angles;
use crate::metrics::{Pair, compare, mirror_biased_pairs};
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
    pub standard_errors: Vec<Vec3>,
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

/// Seed of the pairs.
pub(super) const PAIRS_SEED: u64 = 20_110_801;
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
        let mut pairs = mirror_biased_pairs(count, PAIRS_SEED);
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
        let standard_errors: Vec<Vec3> = estimates.iter().map(|estimate| estimate.standard_error).collect();
        let upper: Vec<Vec3> = f_bar.iter().zip(&standard_errors).map(|(f_bar, error)| *f_bar + *error).collect();
        let std_error_db = compare(&upper, &f_bar).psnr_db.min(MAX_DB);
        let seconds = start.elapsed().as_secs_f64();
        Ok(Self { pairs, f_bar, standard_errors, std_error, std_error_db, passes, seconds, first_albedo: count })
    }

    /// Errors over all pairs except those of the albedos.
    pub fn errors(&self, values: &[Vec3]) -> ReferenceErrors {
        let reference = self.f_bar.iter().zip(&self.standard_errors).map(|(f_bar, error)| {
            let error = error.as_dvec3();
            (f_bar.as_dvec3(), error * error)
        });
        ReferenceErrors::measured(&values[..self.first_albedo], reference, self.passes)
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
    /// Standard error of `rel_l2`.
    pub rel_l2_std_error: f64,
    pub psnr_db: f64,
    /// The errors are those that the result states without a reference; the two fields that follow are 0.
    pub is_stated: bool,
    /// Largest relative error of a directional albedo.
    pub albedo_error: f64,
    pub rel_l2_by_angle: [f64; BANDS_DEG.len()],
    pub stages: Vec<(String, f64)>,
    /// Representation of the effective BRDF.
    #[serde(rename = "form")]
    pub representation: String,
}

/// PSNR that stands for no difference, because JSON has no infinity [dB].
pub(super) const MAX_DB: f64 = 300.0;

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
        rel_l2_std_error: 0.0,
        is_stated: false,
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
            rel_l2_std_error: 0.0,
            psnr_db: 0.0,
            is_stated: false,
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
