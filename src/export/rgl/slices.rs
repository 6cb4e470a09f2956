//! The data of a table for each view direction.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::io;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::super::ExportResolution;
use crate::base::finite::Numbers;
use crate::brdf::LUMINANCE;
use crate::brdf::rgl::table::{RglTable, direction_of_u, u_of_direction};
use crate::brdf::rgl::warp::{Grid, Warp};
use crate::effective::{EffectiveBrdf, Reflectance};

/// Polar angle at which the last slice is evaluated, because f̄ is not defined at its nominal 90°.
const LAST_THETA: f64 = 89.9 / 90.0 * FRAC_PI_2;
/// Lower bound of sigma, as a fraction of the base area.
const MIN_SIGMA: f64 = 1e-3;
/// Offset added to `ndf`, relative to its largest value, because normals without retro-reflection may still reflect.
const NDF_OFFSET: f64 = 1e-3;
/// Offset added to the density of normals, times their cosine and relative to the largest density, so that the tails of
/// lobes get samples.
const DENSITY_OFFSET: f64 = 0.05;
/// Offset added to the solid angle per unit of the square, steradians. Near the pole lie the half vectors of grazing
/// reflections, whose lobes are steep.
const POLE_SOLID_ANGLE: f64 = 0.3;
/// Weight of the cosine between viewer and normal in the density of a warp. Readers blend the warps of neighbouring
/// slices, so the error grows with the difference between these warps.
const COSINE_WEIGHT: f64 = 0.3;
/// Factor on the number of samples, minus 1, for a grazing viewer and a grazing light. There f̄ is largest, and facets
/// turn from lit to unlit within a few degrees.
const GRAZING_DENSITY: f64 = 3.0;
/// Cosine of the light at which the extra samples have decreased to 1/e.
const GRAZING_COSINE: f64 = 0.15;

/// Sizes of the file's grids.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    /// Number of polar angles of the viewer from 0 to 90°.
    pub(super) thetas: usize,
    /// Number of azimuths of the viewer from -π to π, with the seam twice; 1 for an isotropic table.
    pub(super) phis: usize,
    /// Grid of luminance and colours of each slice.
    pub(super) samples: Grid,
    /// Grid of each slice's warp, which may be finer along the azimuth.
    pub(super) vndf: Grid,
    /// Grid of the functions of one direction.
    pub(super) ndf: Grid,
}

impl Sizes {
    pub(super) fn new(resolution: &ExportResolution, isotropic: bool) -> Self {
        let ExportResolution { theta_i, phi_i, theta_o, phi_o } = *resolution;
        // Mitsuba loads only square grids.
        let side = ((theta_o * phi_o) as f64).sqrt().round().max(2.0) as usize;
        Self {
            thetas: theta_i.max(2),
            phis: if isotropic { 1 } else { phi_i.max(3) + 1 },
            samples: Grid { width: side, height: side },
            vndf: Grid { width: side, height: 2 * side },
            ndf: Grid { width: 4 * side, height: 4 * side },
        }
    }

    fn theta(&self, k: usize) -> f64 {
        // The slices are denser towards the horizon, where f̄ changes most.
        let t = k as f64 / (self.thetas - 1) as f64;
        t * (1.0 + 0.9 * (1.0 - t)) * FRAC_PI_2
    }

    fn phi(&self, k: usize) -> f64 {
        if self.phis == 1 { 0.0 } else { k as f64 / (self.phis - 1) as f64 * TAU - PI }
    }

    /// Returns the view direction of a slice, at least slightly above the horizon.
    fn viewer(&self, slice: usize) -> DVec3 {
        let theta = self.theta(slice % self.thetas).min(LAST_THETA);
        let phi = self.phi(slice / self.thetas);
        DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    }
}

/// Returns the points of a grid's vertices on the unit square, x fastest.
fn vertices(grid: Grid) -> impl Iterator<Item = [f64; 2]> + Clone {
    let at = |k: usize, n: usize| k as f64 / (n - 1) as f64;
    (0..grid.height).flat_map(move |y| (0..grid.width).map(move |x| [at(x, grid.width), at(y, grid.height)]))
}

/// Returns `dω_h / du`, the solid angle of half vectors per unit of the square.
pub(super) fn solid_angle([x, _]: [f64; 2]) -> f64 {
    2.0 * PI * PI * x * (x * x * FRAC_PI_2).sin()
}

/// The data of one view direction.
pub(super) struct ViewSlice {
    pub(super) vndf: Vec<f32>,
    pub(super) luminance: Vec<f32>,
    /// Planes of R, G and B.
    pub(super) rgb: Vec<f32>,
}

impl Numbers for ViewSlice {
    fn are_finite(&self) -> bool {
        [&self.vndf, &self.luminance, &self.rgb].into_iter().all(Vec::are_finite)
    }
}

/// Evaluates `f̄` at the reflections of `viewer` about half vectors. Directions below the horizon take the value at the
/// horizon, because readers interpolate across it and return 0 below.
fn reflect(brdf: &EffectiveBrdf, viewer: DVec3, halves: &[DVec3]) -> Vec<DVec3> {
    let lights: Vec<_> = halves.iter().map(|&h| above_horizon(reflected(viewer, h)).as_vec3()).collect();
    let mut values = vec![Vec3::ZERO; lights.len()];
    brdf.eval_lights(&lights, viewer.as_vec3(), &mut values);
    values.into_iter().map(|value| value.as_dvec3()).collect()
}

pub(super) fn reflected(viewer: DVec3, half: DVec3) -> DVec3 {
    2.0 * viewer.dot(half) * half - viewer
}

/// Returns the direction itself, or the nearest one above the horizon.
fn above_horizon(direction: DVec3) -> DVec3 {
    let lowest = LAST_THETA.cos();
    if direction.z >= lowest {
        return direction;
    }
    let flat = direction.with_z(0.0).try_normalize().unwrap_or(DVec3::X);
    (flat * LAST_THETA.sin()).with_z(lowest)
}

fn luminance(value: DVec3) -> f64 {
    value.dot(LUMINANCE.as_dvec3())
}

/// Returns the density of half vectors on the unit square for this viewer's warp, up to a constant factor. It is the
/// density of normals in `ndf`, increased for normals towards the viewer and at grazing angles. When a renderer samples
/// the table, `luminance` corrects the remaining difference.
fn warp_density(viewer: DVec3, grid: Grid, ndf: &(Grid, Vec<f64>)) -> Vec<f64> {
    let grazing = GRAZING_DENSITY * (1.0 - viewer.z).powi(5);
    let density = |at: [f64; 2]| {
        let m = direction_of_u(at);
        let normals = ndf.0.eval(&ndf.1, at) + DENSITY_OFFSET * m.z;
        let height = reflected(viewer, m).z / GRAZING_COSINE;
        let view_weight = (1.0 + COSINE_WEIGHT * viewer.dot(m).max(0.0)) * (1.0 + grazing * (-height * height).exp());
        normals * (solid_angle(at) + POLE_SOLID_ANGLE) * view_weight
    };
    vertices(grid).map(density).collect()
}

/// Computes the functions of one direction. `ndf` is the root of the retro-reflection `G(m, m)`, scaled to a largest
/// value of 1; `sigma` is the visible projected area. The root puts more samples on the slopes of lobes, where
/// interpolation has the largest error.
pub(super) fn planes(brdf: &EffectiveBrdf, sizes: &Sizes) -> RglTable {
    let points: Vec<_> = vertices(sizes.ndf).collect();
    let at = |point: &[f64; 2]| {
        let m = above_horizon(direction_of_u(*point)).as_vec3();
        let area = f64::from(brdf.relative_projected_area(m));
        (luminance(brdf.eval(m, m).as_dvec3()) * area, area.max(MIN_SIGMA))
    };
    let (retro, sigma): (Vec<f64>, Vec<f64>) = points.par_iter().map(at).unzip();
    let largest = retro.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let ndf = retro.into_iter().map(|value| (value / largest).max(0.0).sqrt() + NDF_OFFSET).collect();
    RglTable {
        phi_i: (0..sizes.phis).map(|k| sizes.phi(k)).collect(),
        theta_i: (0..sizes.thetas).map(|k| sizes.theta(k)).collect(),
        ndf: (sizes.ndf, as_stored(ndf)),
        sigma: (sizes.ndf, as_stored(sigma)),
        vndf: Warp::empty(sizes.vndf),
        rgb: (sizes.samples, Vec::new()),
        jacobian: true,
    }
}

/// Rounds values to the f32 that the file stores.
fn as_stored(values: Vec<f64>) -> Vec<f64> {
    values.into_iter().map(|value| f64::from(value as f32)).collect()
}

pub(super) fn one_slice(brdf: &EffectiveBrdf, planes: &RglTable, sizes: &Sizes, slice: usize) -> io::Result<ViewSlice> {
    let viewer = sizes.viewer(slice);
    // The warp must use the rounded numbers that the file stores.
    let vndf = scaled(warp_density(viewer, sizes.vndf, &planes.ndf));
    let density = vndf.iter().map(|&value| f64::from(value)).collect();
    let warp = Warp::new(sizes.vndf, density).map_err(io::Error::other)?;
    let drawn: Vec<([f64; 2], f64)> = vertices(sizes.samples).map(|at| warp.sample(0, at)).collect();
    let halves: Vec<_> = drawn.iter().map(|(at, _)| direction_of_u(*at)).collect();
    let values = reflect(brdf, viewer, &halves);
    // The last slice represents 90°; it stores G, which is bounded.
    let (grid, sigmas) = &planes.sigma;
    let sigma = if slice % sizes.thetas + 1 == sizes.thetas {
        f64::from(brdf.relative_projected_area(viewer.as_vec3()))
    } else {
        grid.eval(sigmas, u_of_direction(viewer))
    };
    let mut rgb = vec![0.0; 3 * drawn.len()];
    let mut weights = Vec::with_capacity(drawn.len());
    for (k, ((at, density), value)) in drawn.iter().zip(&values).enumerate() {
        let stored = *value * 4.0 * sigma / planes.ndf.0.eval(&planes.ndf.1, *at);
        for c in 0..3 {
            rgb[c * drawn.len() + k] = stored[c] as f32;
        }
        let jacobian = solid_angle(*at) * 4.0 * viewer.dot(halves[k]).max(0.0);
        weights.push(if *density > 0.0 && reflected(viewer, halves[k]).z > 0.0 {
            luminance(*value) * jacobian / density
        } else {
            0.0
        });
    }
    Ok(ViewSlice { vndf, luminance: scaled(with_minimum(weights)), rgb })
}

/// Raises values to at least a thousandth of the mean, so that every reflecting direction can be sampled.
fn with_minimum(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let least = if mean > 0.0 { 1e-3 * mean } else { 1.0 };
    values.iter_mut().for_each(|value| *value = value.max(least));
    values
}

/// Scales values to a largest value of 1, as f32.
fn scaled(values: Vec<f64>) -> Vec<f32> {
    let largest = values.iter().copied().fold(0.0, f64::max);
    values.into_iter().map(|value| (value / largest) as f32).collect()
}
