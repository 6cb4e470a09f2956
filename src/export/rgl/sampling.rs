//! Directions drawn in proportion to an effective BRDF, by the warps that a file holds.
//!
//! A file holds two warps per slice of the viewer: `luminance` over `vndf`. A direction is drawn from one of the slices around
//! the viewer, chosen by their weights, or from a cosine lobe. The density is that of the whole mixture and therefore exact.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec3, Vec3};

use super::super::ExportResolution;
use super::super::sampler::in_parallel;
use super::slices::{Sizes, ViewSlice, one_slice, planes, reflected, solid_angle};
use super::widened;
use crate::base::{Cancel, Error, Progress, Result};
use crate::brdf::rgl::table::{direction_of_u, elevation, u_of_phi, u_of_theta};
use crate::brdf::rgl::warp::{Between, SliceBlend, Warp};
use crate::effective::EffectiveBrdf;

/// Polar angles and azimuths of the viewer, then samples along both axes of a warp: those of the smallest file.
const RESOLUTION: [usize; 4] = [9, 24, 24, 24];
/// Part of the directions that the cosine lobe draws. It bounds the weights where the warps of the slices miss `f̄`.
const COSINE_PART: f64 = 0.1;

/// Draws directions for one effective BRDF.
pub struct DirectionSampler {
    phi: Vec<f64>,
    theta: Vec<f64>,
    luminance: Warp,
    vndf: Warp,
}

impl std::fmt::Debug for DirectionSampler {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "DirectionSampler of {} x {} slices", self.phi.len(), self.theta.len())
    }
}

/// A direction, its density [1/sr] and `f̄` over the density.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sampled {
    /// Zero if the warp left the hemisphere; density and weight are then 0.
    pub direction: Vec3,
    pub pdf: f32,
    pub weight: Vec3,
}

/// The tables of a [`DirectionSampler`], for programs that draw from them themselves.
#[derive(Debug, Clone, Copy)]
pub struct SamplerTables<'a> {
    /// Azimuths of the viewer [rad], from -π to π; only one if a rotation of the tile changes nothing.
    pub phi: &'a [f64],
    /// Polar angles of the viewer [rad].
    pub theta: &'a [f64],
    /// Height and width of each slice of `luminance`, and its densities, `[phi][theta][y][x]`.
    pub luminance: ([usize; 2], &'a [f64]),
    /// The same of `vndf`.
    pub vndf: ([usize; 2], &'a [f64]),
}

impl DirectionSampler {
    /// The tables.
    pub fn tables(&self) -> SamplerTables<'_> {
        let sized = |warp: &Warp| {
            let (grid, _) = warp.densities();
            [grid.height, grid.width]
        };
        SamplerTables {
            phi: &self.phi,
            theta: &self.theta,
            luminance: (sized(&self.luminance), self.luminance.densities().1),
            vndf: (sized(&self.vndf), self.vndf.densities().1),
        }
    }

    /// Tabulates the warps. `isotropic` is true if a rotation of the tile changes nothing.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` cancels, or a value that is not finite.
    pub fn new(brdf: &EffectiveBrdf, isotropic: bool, progress: &Progress<'_>) -> Result<Self> {
        let [theta_i, phi_i, theta_o, phi_o] = RESOLUTION;
        let sizes = Sizes::new(&ExportResolution { theta_i, phi_i, theta_o, phi_o }, isotropic);
        let planes = planes(brdf, &sizes);
        let count = sizes.phis * sizes.thetas;
        let failed = |error: std::io::Error| error.downcast::<Error>().unwrap_or_else(Error::failed);
        let slices = in_parallel(count, progress, |slice| one_slice(brdf, &planes, &sizes, slice)).map_err(failed)?;
        let slices: Vec<ViewSlice> = slices.into_iter().collect::<std::io::Result<_>>().map_err(failed)?;
        Ok(Self {
            luminance: Warp::new(sizes.samples, widened(&slices, |slice| &slice.luminance))?,
            vndf: Warp::new(sizes.vndf, widened(&slices, |slice| &slice.vndf))?,
            phi: planes.phi_i,
            theta: planes.theta_i,
        })
    }

    /// Draws one direction per viewer from two uniform numbers each.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn sample_all(
        &self,
        brdf: &EffectiveBrdf,
        viewers: &[Vec3],
        uniform: &[[f64; 2]],
        cancel: &Cancel,
    ) -> Result<Vec<Sampled>> {
        cancel.map("samples", viewers.len().min(uniform.len()), |k| {
            let viewer = viewers[k];
            let Some(direction) = self.sample(viewer, uniform[k]) else { return Sampled::default() };
            let pdf = self.pdf(viewer, direction);
            let weight = if pdf > 0.0 { brdf.eval(direction, viewer) / pdf } else { Vec3::ZERO };
            Sampled { direction, pdf, weight }
        })
    }

    /// Draws a direction for a viewer from two uniform numbers. `None` if the warp leaves the hemisphere.
    pub fn sample(&self, viewer: Vec3, [u, v]: [f64; 2]) -> Option<Vec3> {
        if viewer.z <= 0.0 {
            return None;
        }
        if u < COSINE_PART {
            return Some(cosine_lobe([u / COSINE_PART, v]).as_vec3());
        }
        let u = (u - COSINE_PART) / (1.0 - COSINE_PART);
        let viewer = viewer.as_dvec3();
        let (blend, rotation) = self.slices_of(viewer);
        let (slice, v) = choose(blend.slices(), v);
        let (s, _) = self.luminance.sample(slice, [u, v]);
        let ([x, y], _) = self.vndf.sample(slice, s);
        let normal = direction_of_u([x, y + rotation / TAU]);
        let direction = reflected(viewer, normal).as_vec3();
        (viewer.dot(normal) > 0.0 && direction.z > 0.0).then(|| direction.normalize_or(Vec3::Z))
    }

    /// The density [1/sr] with which [`DirectionSampler::sample`] draws a direction.
    pub fn pdf(&self, viewer: Vec3, direction: Vec3) -> f32 {
        if viewer.z <= 0.0 || direction.z <= 0.0 {
            return 0.0;
        }
        let (viewer, direction) = (viewer.as_dvec3(), direction.as_dvec3());
        let cosine = COSINE_PART * direction.z / PI;
        let Some(half) = (viewer + direction).try_normalize() else { return cosine as f32 };
        let (blend, rotation) = self.slices_of(viewer);
        let at = [u_of_theta(elevation(half)).min(1.0), u_of_phi(half.y.atan2(half.x) - rotation)];
        let jacobian = solid_angle(at) * 4.0 * viewer.dot(half);
        let warped: f64 = blend
            .slices()
            .iter()
            .filter(|(_, weight)| *weight > 0.0)
            .map(|&(slice, weight)| {
                let s = self.vndf.invert(SliceBlend::only(slice), at);
                weight * self.luminance.density(slice, s) * self.vndf.density(slice, at)
            })
            .sum();
        let warped = if jacobian > 0.0 { warped / jacobian } else { 0.0 };
        (cosine + (1.0 - COSINE_PART) * warped) as f32
    }

    /// The slices around a viewer, and the rotation of an isotropic table [rad].
    fn slices_of(&self, viewer: DVec3) -> (SliceBlend, f64) {
        let (theta, phi) = (elevation(viewer), viewer.y.atan2(viewer.x));
        let theta = Between::find(&self.theta, theta.min(FRAC_PI_2));
        if self.phi.len() == 1 {
            return (SliceBlend::new(Between { lower: 0, weight: 0.0 }, theta, self.theta.len()), phi);
        }
        (SliceBlend::new(Between::find(&self.phi, phi), theta, self.theta.len()), 0.0)
    }
}

/// A slice by its weight, and the uniform number within its part.
fn choose(slices: [(usize, f64); 4], v: f64) -> (usize, f64) {
    let mut below = 0.0;
    let mut chosen = (slices[0].0, v);
    for (slice, weight) in slices.into_iter().filter(|(_, weight)| *weight > 0.0) {
        chosen = (slice, ((v - below) / weight).clamp(0.0, 1.0));
        below += weight;
        if v < below {
            break;
        }
    }
    chosen
}

/// Maps uniform numbers to the upper hemisphere, in proportion to the cosine.
fn cosine_lobe([u, v]: [f64; 2]) -> DVec3 {
    let (radius, phi) = (u.sqrt(), TAU * v);
    DVec3::new(radius * phi.cos(), radius * phi.sin(), (1.0 - u).max(1e-12).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::directions::from_angles;
    use crate::pipeline::Pipeline;

    /// Means over a grid of 128 x 128 uniform numbers: of the weights, of their squared luminance, and of `1/pdf`.
    fn means(scene: &str, viewer: Vec3) -> (Vec3, f64, Vec3) {
        let loaded = crate::scene::open(scene, &["quality.preset=draft".to_owned()]).unwrap();
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let isotropic = !outcome.plan.is_on("anisotropy");
        let sampler = DirectionSampler::new(&outcome.brdf, isotropic, &|_| true).unwrap();
        const SIDE: usize = 128;
        let middle = |k: usize| (k as f64 + 0.5) / SIDE as f64;
        let uniform: Vec<_> = (0..SIDE * SIDE).map(|k| [middle(k % SIDE), middle(k / SIDE)]).collect();
        let viewers = vec![viewer; uniform.len()];
        let cancel = Cancel::default();
        let drawn = sampler.sample_all(&outcome.brdf, &viewers, &uniform, &cancel).unwrap();
        let weight: Vec3 = drawn.iter().map(|drawn| drawn.weight).sum::<Vec3>() / uniform.len() as f32;
        let covered = drawn.iter().filter(|drawn| drawn.pdf > 0.0);
        let area = covered.map(|drawn| 1.0 / f64::from(drawn.pdf)).sum::<f64>() / uniform.len() as f64;
        let albedo = crate::export::reflectances(&outcome.brdf, &[viewer], &cancel).unwrap()[0];
        (weight, area, albedo)
    }

    #[test]
    fn the_mean_weight_is_the_albedo_and_the_density_covers_the_hemisphere() {
        for scene in ["fig4b_bicolor_cup", "fig5a_isotropic"] {
            for viewer in [from_angles(0.3, 0.9), from_angles(1.1, 4.0)] {
                let (weight, area, albedo) = means(scene, viewer);
                let error = ((weight - albedo) / albedo).abs().max_element();
                assert!(error < 0.01, "{scene}: {weight} {albedo}");
                assert!((area / TAU - 1.0).abs() < 0.03, "{scene}: {area}");
            }
        }
    }
}
