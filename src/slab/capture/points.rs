//! From the radiances of a pixel to the samples of its point.

use glam::{DVec2, DVec3, Vec3};

use super::bounced::AboveFloor;
use super::clusters::non_negative;
use super::fit::{Sample, View};
use super::lobe::{LobeOptics, PointModel};
use super::push_pull::DirectionGrid;
use super::radiance::{DotLight, dark_samples, diffuse_of};
use super::rig::Rig;

/// Part of the diffuse BTDF below which the rest is no lobe.
const LEAST_LOBE: f64 = 1e-3;

/// The measurements of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Channel means without the diffuse part, per camera.
    pub views: Vec<View>,
    /// Transmitted part of each channel, up to a common factor.
    pub color: DVec3,
    /// `ρ_d` [1/sr] (Eq. 14).
    pub diffuse: DVec3,
    /// Part of the values that are not a number.
    pub broken: f64,
}

impl Point {
    /// The point at `place`, from the radiances of each dot for each camera. Negative values count as 0.
    pub fn new(rig: &Rig, dots: &[DVec2], place: DVec2, radiances: &[&[Vec3]]) -> Self {
        let monitor = DVec3::from_array(rig.monitor);
        let lights: Vec<DotLight> = dots.iter().map(|dot| DotLight::new(*dot, rig.distance, place)).collect();
        let clean = |value: &Vec3| if value.is_finite() { value.max(Vec3::ZERO) } else { Vec3::NAN };
        let btdf = |(light, radiance): (&DotLight, &Vec3)| {
            let radiance = clean(radiance).as_dvec3();
            DVec3::from_array([0, 1, 2].map(|k| light.btdf(radiance[k], monitor[k])))
        };
        let of_cameras: Vec<Vec<DVec3>> =
            radiances.iter().map(|values| lights.iter().zip(*values).map(btdf).collect()).collect();
        // Lobes of all channels have the same shape, so that their mean tells which samples are dark.
        let mean = |(light, value): (&DotLight, &DVec3)| {
            let btdf = if value.is_finite() { value.element_sum() / 3.0 } else { f64::NAN };
            Sample { i: light.i, irradiance: light.irradiance, btdf }
        };
        let means: Vec<Vec<Sample>> =
            of_cameras.iter().map(|values| lights.iter().zip(values).map(mean).collect()).collect();
        let dark = dark_samples(&means.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let diffuse =
            DVec3::from_array([0, 1, 2].map(|channel| diffuse_of(&dark, |view, k| of_cameras[view][k][channel])));
        let mut color = DVec3::ZERO;
        let mut broken = 0;
        let mut view = |o: DVec3, values: &[DVec3]| {
            let sample = |(light, value): (&DotLight, &DVec3)| {
                let lobe = *value - diffuse;
                let lobe = DVec3::select(lobe.cmpgt(LEAST_LOBE * diffuse), lobe, DVec3::ZERO);
                let btdf = if value.is_finite() { lobe.element_sum() / 3.0 } else { f64::NAN };
                if btdf.is_finite() {
                    color += light.irradiance * lobe;
                } else {
                    broken += 1;
                }
                Sample { i: light.i, irradiance: light.irradiance, btdf }
            };
            View { o, samples: lights.iter().zip(values).map(sample).collect() }
        };
        let views: Vec<View> =
            rig.cameras.iter().zip(&of_cameras).map(|(camera, values)| view(camera.unit_direction(), values)).collect();
        let all = (dots.len() * views.len()).max(1);
        Self { views, color, diffuse, broken: broken as f64 / all as f64 }
    }

    /// The factors of the channels on the channel mean.
    pub fn tint(&self) -> DVec3 {
        let mean = self.color.element_sum() / 3.0;
        if mean > 0.0 { self.color / mean } else { DVec3::ONE }
    }

    /// Square root of the number of dots over which the lobe of the first camera spreads.
    pub fn dots_across(&self) -> f64 {
        let finite = || self.views[0].samples.iter().map(|sample| sample.btdf).filter(|value| value.is_finite());
        let (sum, squares) = finite().fold((0.0, 0.0), |(a, b), value| (a + value, b + value * value));
        if squares > 0.0 { (sum * sum / squares).sqrt() } else { 0.0 }
    }

    /// Directions of the first camera's samples and slopes of their facets with the transmitted energy.
    fn energies(&self, camera: usize, optics: &LobeOptics) -> Vec<(DVec2, DVec2, f64)> {
        let View { o, samples } = &self.views[camera];
        let energy = |sample: &Sample| {
            let terms = optics.terms(sample.i, *o)?;
            let value = sample.btdf * sample.irradiance;
            let slope = 0.5 * (terms.slope_top + terms.slope_bottom);
            (value > 0.0).then(|| (sample.i.truncate() + o.truncate(), slope, value))
        };
        samples.iter().filter_map(energy).collect()
    }

    /// Half width of the square of slopes that holds the part `part` of the energy of all cameras; `None` without a lobe.
    pub fn slope_reach(&self, optics: &LobeOptics, part: f64) -> Option<f64> {
        let reach = |camera| {
            reach(self.energies(camera, optics).into_iter().map(|(_, slope, energy)| (slope, energy)).collect(), part)
        };
        (0..self.views.len()).filter_map(reach).reduce(f64::max)
    }

    /// The same of the directions (i.x, i.y) of one camera about the straight one.
    pub fn direction_reach(&self, camera: usize, optics: &LobeOptics, part: f64) -> Option<f64> {
        reach(self.energies(camera, optics).into_iter().map(|(at, _, energy)| (at, energy)).collect(), part)
    }

    /// Number of samples of a camera inside a square of directions.
    pub fn samples_in(&self, camera: usize, grid: &DirectionGrid) -> usize {
        self.views[camera].samples.iter().filter(|sample| grid.holds(sample.i.truncate())).count()
    }

    /// The combination of models that is nearest to the samples inside the squares of directions (Eq. 21), without negative
    /// weights. `bounced` is the light that is reflected inside, beside the lobes of the models.
    pub fn mixed(
        &self,
        optics: &LobeOptics,
        directions: &[DirectionGrid],
        models: &[&PointModel],
        bounced: Option<&AboveFloor>,
    ) -> Mixture {
        let count = models.len();
        let (mut gram, mut right, mut power) = (vec![0.0; count * count], vec![0.0; count], 0.0);
        for (View { o, samples }, grid) in self.views.iter().zip(directions) {
            let inside = samples.iter().filter(|sample| sample.btdf.is_finite() && grid.holds(sample.i.truncate()));
            for sample in inside {
                let Some(terms) = optics.terms(sample.i, *o) else { continue };
                let inside = bounced.map_or(0.0, |bounced| bounced.read(sample.i, *o));
                let values: Vec<f64> = models.iter().map(|model| model.btdf(&terms) + inside).collect();
                for (a, value) in values.iter().enumerate() {
                    values.iter().enumerate().for_each(|(b, other)| gram[a * count + b] += value * other);
                    right[a] += value * sample.btdf;
                }
                power += sample.btdf * sample.btdf;
            }
        }
        let found = non_negative(&gram, &right);
        let scale: f64 = found.iter().sum();
        let product = |a: usize| (0..count).map(|b| gram[a * count + b] * found[b]).sum::<f64>() - 2.0 * right[a];
        let squares = power + (0..count).map(|a| found[a] * product(a)).sum::<f64>();
        let residual = if power > 0.0 { (squares.max(0.0) / power).sqrt() as f32 } else { 0.0 };
        let is_sound = scale > 0.0 && scale.is_finite() && residual.is_finite();
        if !is_sound {
            let mut weights = vec![0.0; count];
            weights[0] = 1.0;
            return Mixture { weights, scale: 0.0, residual: 0.0 };
        }
        let weights = found.iter().map(|value| ((value / scale) as f32).clamp(0.0, 1.0)).collect();
        Mixture { weights, scale, residual }
    }
}

/// A combination of models of mass 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixture {
    /// They are not negative and sum to 1.
    pub weights: Vec<f32>,
    /// Scale of the combination (`k_s`).
    pub scale: f64,
    /// Relative L2 against the samples.
    pub residual: f32,
}

/// Half width of the square about 0 that holds the part `part` of masses.
fn reach(mut masses: Vec<(DVec2, f64)>, part: f64) -> Option<f64> {
    masses.sort_by(|a, b| a.0.abs().max_element().total_cmp(&b.0.abs().max_element()));
    let total: f64 = masses.iter().map(|(_, mass)| mass).sum();
    let mut sum = 0.0;
    let at = masses.iter().find(|(_, mass)| {
        sum += mass;
        sum >= part * total
    });
    at.map(|(place, _)| place.abs().max_element())
}
