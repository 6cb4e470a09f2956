//! What stands in a table for each direction of the viewer.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::io;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::super::ExportResolution;
use crate::brdf::LUMINANCE;
use crate::brdf::rgl::table::{RglTable, direction_of_u, u_of_direction};
use crate::brdf::rgl::warp::{Grid, Warp};
use crate::effective::{EffectiveBrdf, Reflectance};

/// The last elevation stands for 90°, where nothing is defined.
const LAST_THETA: f64 = 89.9 / 90.0 * FRAC_PI_2;
/// Where the projected area vanishes, sigma ends at this part of the base area.
const MIN_SIGMA: f64 = 1e-3;
/// What is added to `ndf`, of its largest value: normals that no retro-reflection shows may still reflect.
const NDF_FLOOR: f64 = 1e-3;
/// What is added to the density of normals, times their cosine, of the largest: faint tails keep some samples.
const EVERYWHERE: f64 = 0.05;
/// What is added to the solid angle of a unit of the square, steradians: about the pole lie the half vectors of grazing
/// reflections, whose lobes are steep.
const POLE: f64 = 0.3;
/// How much of a warp depends on what its viewer sees of each normal. Readers blend the warps of neighbouring slices, so the
/// more these differ the worse: mean errors of V-grooves with Cook-Torrance 0.2 are 2.1, 1.8 and 1.8 % at 1, 0.3 and 0.
const VISIBLE: f64 = 0.3;
/// How many samples more there are for a grazing viewer where light grazes, too, and up to which cosine of the light: f̄ is
/// largest there, and facets turn away within a few degrees.
const GRAZING: f64 = 3.0;
const GRAZING_COSINE: f64 = 0.15;

/// Sizes of the file's grids.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    /// Elevations of the viewer from 0 to 90°.
    pub(super) thetas: usize,
    /// Azimuths of the viewer from -π to π, the seam twice; or 0 alone.
    pub(super) phis: usize,
    /// Of each slice: luminance and colours.
    pub(super) samples: Grid,
    /// Of each slice: the warp, which may be finer along the azimuth.
    pub(super) vndf: Grid,
    /// Of the functions of one direction.
    pub(super) ndf: Grid,
}

impl Sizes {
    pub(super) fn new(resolution: &ExportResolution, isotropic: bool) -> Self {
        let ExportResolution { theta_i, phi_i, theta_o, phi_o } = *resolution;
        // Mitsuba loads square grids only.
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
        // Denser towards the horizon, where most happens.
        let t = k as f64 / (self.thetas - 1) as f64;
        t * (1.0 + 0.9 * (1.0 - t)) * FRAC_PI_2
    }

    fn phi(&self, k: usize) -> f64 {
        if self.phis == 1 { 0.0 } else { k as f64 / (self.phis - 1) as f64 * TAU - PI }
    }

    /// The direction of a slice's viewer, just above the horizon at least.
    fn viewer(&self, slice: usize) -> DVec3 {
        let theta = self.theta(slice % self.thetas).min(LAST_THETA);
        let phi = self.phi(slice / self.thetas);
        DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    }
}

/// GridCoordinates of the vertices of a grid on the unit square, x fastest.
fn vertices(grid: Grid) -> impl Iterator<Item = [f64; 2]> + Clone {
    let at = |k: usize, n: usize| k as f64 / (n - 1) as f64;
    (0..grid.height).flat_map(move |y| (0..grid.width).map(move |x| [at(x, grid.width), at(y, grid.height)]))
}

/// `dω_h / du`: how much solid angle of half vectors a unit of the square holds.
fn solid_angle([x, _]: [f64; 2]) -> f64 {
    2.0 * PI * PI * x * (x * x * FRAC_PI_2).sin()
}

/// One viewer's part of the file.
pub(super) struct Slice {
    pub(super) vndf: Vec<f32>,
    pub(super) luminance: Vec<f32>,
    /// Three planes.
    pub(super) rgb: Vec<f32>,
}

/// `f̄` at the reflections of `viewer` about half vectors. Under the horizon it goes on as it is at the horizon: readers
/// take 0 there, and interpolate across.
fn reflect(brdf: &EffectiveBrdf, viewer: DVec3, halves: &[DVec3]) -> Vec<DVec3> {
    let lights: Vec<_> = halves.iter().map(|&h| above_horizon(reflected(viewer, h)).as_vec3()).collect();
    let mut values = vec![Vec3::ZERO; lights.len()];
    brdf.eval_lights(&lights, viewer.as_vec3(), &mut values);
    values.into_iter().map(|value| value.as_dvec3()).collect()
}

fn reflected(viewer: DVec3, half: DVec3) -> DVec3 {
    2.0 * viewer.dot(half) * half - viewer
}

/// The direction itself, or the nearest one that is not under the horizon.
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

/// The density of half vectors on the unit square that this viewer's warp is made of, times an arbitrary constant: the root
/// of the normals that `ndf` holds, as they are and as they are seen. `luminance` makes up for the rest when sampling.
fn visible_normals(viewer: DVec3, grid: Grid, ndf: &(Grid, Vec<f64>)) -> Vec<f64> {
    let grazing = GRAZING * (1.0 - viewer.z).powi(5);
    let density = |at: [f64; 2]| {
        let m = direction_of_u(at);
        let normals = ndf.0.eval(&ndf.1, at) + EVERYWHERE * m.z;
        let height = reflected(viewer, m).z / GRAZING_COSINE;
        let seen = (1.0 + VISIBLE * viewer.dot(m).max(0.0)) * (1.0 + grazing * (-height * height).exp());
        normals * (solid_angle(at) + POLE) * seen
    };
    vertices(grid).map(density).collect()
}

/// `ndf` from retro-reflection, the root of `G(m, m)` scaled to a largest value of 1, and `sigma`, the visible projected area.
/// The root spreads samples over the slopes of lobes, where reading between them errs: with `G` itself the relative L2 of
/// V-grooves with Cook-Torrance 0.2 is 5.2 % in place of 2.8 %.
pub(super) fn planes(brdf: &EffectiveBrdf, sizes: &Sizes) -> RglTable {
    let places: Vec<_> = vertices(sizes.ndf).collect();
    let at = |place: &[f64; 2]| {
        let m = above_horizon(direction_of_u(*place)).as_vec3();
        let area = f64::from(brdf.relative_projected_area(m));
        (luminance(brdf.eval(m, m).as_dvec3()) * area, area.max(MIN_SIGMA))
    };
    let (retro, sigma): (Vec<f64>, Vec<f64>) = places.par_iter().map(at).unzip();
    let largest = retro.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let ndf = retro.into_iter().map(|value| (value / largest).max(0.0).sqrt() + NDF_FLOOR).collect();
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

/// Rounded to the f32 that a reader will have.
fn as_stored(values: Vec<f64>) -> Vec<f64> {
    values.into_iter().map(|value| f64::from(value as f32)).collect()
}

pub(super) fn one_slice(brdf: &EffectiveBrdf, planes: &RglTable, sizes: &Sizes, slice: usize) -> io::Result<Slice> {
    let viewer = sizes.viewer(slice);
    // The warp must be of the numbers that a reader will have.
    let vndf = scaled(visible_normals(viewer, sizes.vndf, &planes.ndf));
    let density = vndf.iter().map(|&value| f64::from(value)).collect();
    let warp = Warp::new(sizes.vndf, density).map_err(io::Error::other)?;
    let drawn: Vec<([f64; 2], f64)> = vertices(sizes.samples).map(|at| warp.sample(0, at)).collect();
    let halves: Vec<_> = drawn.iter().map(|(at, _)| direction_of_u(*at)).collect();
    let values = reflect(brdf, viewer, &halves);
    // The last elevation stands for 90°: there G, which is bounded, is what is stored.
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
    Ok(Slice { vndf, luminance: scaled(floored(weights)), rgb })
}

/// No value less than a thousandth of the mean: what may be reflected may be sampled.
fn floored(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let least = if mean > 0.0 { 1e-3 * mean } else { 1.0 };
    values.iter_mut().for_each(|value| *value = value.max(least));
    values
}

/// As f32 with a largest value of 1.
fn scaled(values: Vec<f64>) -> Vec<f32> {
    let largest = values.iter().copied().fold(0.0, f64::max);
    values.into_iter().map(|value| (value / largest) as f32).collect()
}
