//! Simulated measurements: points whose model is known, and the noise of a camera. Tests, measurements and `biscale rig` use
//! them.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::dual::blend;
use super::super::ellipse::{Ellipse, Profile};
use super::alpha::{FitSettings, Fitted, choose_smoothness, fit_point};
use super::fit::{Sample, View};
use super::lobe::{LobeOptics, PairTerms, PointModel, SlopeGrid};
use super::radiance::{DotLight, diffuse_part};
use super::svbtdf::Svbtdf;

/// Noise of the dark, in parts of the relative noise, of the brightest value.
const DARK_NOISE: f64 = 0.01;

/// Adds normal noise to values of one photograph: relative to each value, and a hundredth of it relative to the brightest.
pub fn add_noise(values: &mut [f64], noise: f64, rng: &mut impl Rng) {
    let brightest = values.iter().copied().fold(0.0, f64::max);
    // A sum of twelve even numbers is nearly normal.
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    for value in values {
        let (relative, dark) = (normal(), normal());
        *value += noise * (*value * relative + DARK_NOISE * brightest * dark);
    }
}

/// A slab that the model itself makes: Eq. 11 with a known α and distribution of slopes.
pub struct KnownPoint {
    density: Box<dyn Fn(DVec2) -> f64 + Sync>,
    pub alpha: f64,
    pub optics: LobeOptics,
}

/// A captured [`KnownPoint`].
#[derive(Debug, Clone)]
pub struct Recovered {
    pub fitted: Fitted,
    pub smooth: f64,
    /// Relative L2 of lobes for views at 0, 30 and 60°.
    pub error: f64,
}

/// Polar angles of new views [degrees], and points per side of the disc of the light.
const NEW_VIEWS_DEG: [f64; 3] = [0.0, 30.0, 60.0];
const DISC_SIDE: u32 = 64;
/// Squared cosine at 85°, up to which lobes are compared.
const LEAST_SQUARED_COSINE: f64 = 0.0076;
/// The diffuse part of the simulated sheet [1/sr].
const DIFFUSE: f64 = 0.02;

fn viewer(theta_deg: f64) -> DVec3 {
    let (sin, cos) = theta_deg.to_radians().sin_cos();
    DVec3::new(sin, 0.0, -cos)
}

impl KnownPoint {
    /// Beckmann or GGX slopes with a roughness along x, the plane of the cameras, and one along y. `None` if both are 0.
    pub fn analytic(profile: Profile, roughness: DVec2, alpha: f64) -> Option<Self> {
        let ellipse = Ellipse::new(profile, roughness, 0.0)?;
        Some(Self { density: Box::new(move |m| ellipse.density(m)), alpha, optics: LobeOptics::new(1.5, 0.2) })
    }

    /// Gentle and steep flanks of a sawtooth, blurred; the mean slope is 0.
    pub fn sawtooth(alpha: f64) -> Option<Self> {
        let blur = Ellipse::new(Profile::Beckmann, DVec2::splat(0.113), 0.0)?;
        let flanks = [(0.7, DVec2::new(-0.09, 0.0)), (0.3, DVec2::new(0.21, 0.0))];
        let density = move |m: DVec2| flanks.iter().map(|(mass, at)| mass * blur.density(m - *at)).sum();
        Some(Self { density: Box::new(density), alpha, optics: LobeOptics::new(1.5, 0.2) })
    }

    /// The BTDF [1/sr] at a pair.
    pub fn btdf(&self, terms: &PairTerms) -> f64 {
        let top = terms.ln_top.exp() * (self.density)(terms.slope_top);
        blend(top, terms.ln_bottom.exp() * (self.density)(terms.slope_bottom), self.alpha)
    }

    /// The samples of the middle of a sheet of 8 cm, 4 cm below a monitor that shows 40 x 40 dots over 9.6 cm, with noise and
    /// with a diffuse part of 0.02 that Eq. 14 removes.
    pub fn photographed(&self, theta_deg: f64, noise: f64) -> View {
        let o = viewer(theta_deg);
        let shift = 0.04 * theta_deg.to_radians().tan();
        let at = |k: u32| (f64::from(k) + 0.5) / 40.0 * 0.096 - 0.048;
        let dot = |k: u32| DVec2::new(at(k % 40) - shift, at(k / 40));
        let lights: Vec<DotLight> = (0..1600).map(|k| DotLight::new(dot(k), 0.04, DVec2::ZERO)).collect();
        let radiance = |light: &DotLight| {
            let lobe = self.optics.terms(light.i, o).map_or(0.0, |terms| self.btdf(&terms));
            (lobe + DIFFUSE) * light.irradiance
        };
        let mut radiances: Vec<f64> = lights.iter().map(radiance).collect();
        add_noise(&mut radiances, noise, &mut ChaCha8Rng::seed_from_u64(5));
        let sample = |(light, radiance): (&DotLight, &f64)| {
            let btdf = light.btdf(radiance.max(0.0), 1.0);
            Sample { i: light.i, irradiance: light.irradiance, btdf }
        };
        let mut samples: Vec<Sample> = lights.iter().zip(&radiances).map(sample).collect();
        let diffuse = diffuse_part(&[&samples]);
        samples.iter_mut().for_each(|sample| sample.btdf = (sample.btdf - diffuse).max(0.0));
        View { o, samples }
    }

    /// Relative L2 of lobes over the disc of the light, for views at 0, 30 and 60°.
    pub fn error_at_new_views(&self, found: impl Fn(&PairTerms) -> f64) -> f64 {
        let (mut difference, mut norm) = (0.0, 0.0);
        for theta in NEW_VIEWS_DEG {
            for k in 0..DISC_SIDE * DISC_SIDE {
                let cell = DVec2::new(f64::from(k % DISC_SIDE), f64::from(k / DISC_SIDE)) + 0.5;
                let at = cell * (2.0 / f64::from(DISC_SIDE)) - 1.0;
                let square = 1.0 - at.length_squared();
                if square < LEAST_SQUARED_COSINE {
                    continue;
                }
                let z = square.sqrt();
                let Some(terms) = self.optics.terms(at.extend(z), viewer(theta)) else { continue };
                let (a, b) = (found(&terms), self.btdf(&terms));
                difference += (a - b).powi(2) / z;
                norm += b * b / z;
            }
        }
        if norm > 0.0 { (difference / norm).sqrt() } else { 0.0 }
    }

    /// Photographs the point from cameras at polar angles [degrees], and captures it. `None` if no sample is usable.
    pub fn recovered(&self, cameras: &[f64], noise: f64) -> Option<Recovered> {
        let views: Vec<View> = cameras.iter().map(|theta| self.photographed(*theta, noise)).collect();
        let grid = SlopeGrid { side: 32, span: 1.0 };
        let settings = FitSettings { optics: self.optics.clone(), grid, smooth: 1.0, alpha: None, bounced: None };
        let smooth = choose_smoothness(std::slice::from_ref(&views), &settings);
        let fitted = fit_point(&views, &FitSettings { smooth, ..settings })?;
        let error = self.error_at_new_views(|terms| fitted.scale * fitted.model.btdf(terms));
        Some(Recovered { fitted, smooth, error })
    }
}

/// Roughnesses along x and y, and values of α, between which [`varying_sheet`] varies.
const ROUGHNESSES: [f64; 2] = [0.12, 0.28];
const ALPHAS: [f64; 2] = [0.2, 0.8];
/// Models along each of these axes.
const LATTICE: [usize; 3] = [9, 9, 5];

/// A sheet whose roughnesses and α vary smoothly, with a diffuse part of 0.02 and a tint. Eq. 20 interpolates between models on
/// a lattice.
pub fn varying_sheet(size: [usize; 2]) -> Svbtdf {
    let grid = SlopeGrid { side: 32, span: 1.0 };
    let [columns, rows, layers] = LATTICE;
    let between = |[low, high]: [f64; 2], k: usize, count: usize| low + (high - low) * k as f64 / (count - 1) as f64;
    let model = |k: usize| {
        let roughness =
            DVec2::new(between(ROUGHNESSES, k % columns, columns), between(ROUGHNESSES, k / columns % rows, rows));
        let ln = |node: usize| -(grid.node(node) / roughness).length_squared();
        let alpha = between(ALPHAS, k / (columns * rows), layers);
        let mut model = PointModel { grid, alpha, ln_density: (0..grid.side * grid.side).map(ln).collect() };
        model.normalise();
        model
    };
    let (mut index, mut weight) = (Vec::new(), Vec::new());
    for pixel in 0..size[0] * size[1] {
        let x = (pixel % size[0]) as f64 / size[0] as f64 * TAU;
        let y = (pixel / size[0]) as f64 / size[1] as f64 * TAU;
        let parts = [(2.0 * x).sin(), (x + 2.0 * y).cos(), y.sin()].map(|wave| 0.5 + 0.5 * wave);
        let at: Vec<f64> = parts.iter().zip(LATTICE).map(|(part, count)| part * (count - 1) as f64).collect();
        for corner in 0..8_usize {
            let (mut node, mut share, mut stride) = (0, 1.0, 1);
            for axis in 0..3 {
                let base = (at[axis] as usize).min(LATTICE[axis] - 2);
                let upper = corner >> axis & 1;
                let t = at[axis] - base as f64;
                share *= if upper == 1 { t } else { 1.0 - t };
                node += (base + upper) * stride;
                stride *= LATTICE[axis];
            }
            index.push(node as u32);
            weight.push(share as f32);
        }
    }
    let pixels = size[0] * size[1];
    Svbtdf {
        size,
        optics: LobeOptics::new(1.5, 0.2),
        grid,
        models: (0..columns * rows * layers).map(model).collect(),
        neighbours: 8,
        index,
        weight,
        scale: vec![Vec3::new(0.9, 0.8, 0.7); pixels],
        diffuse: vec![Vec3::splat(DIFFUSE as f32); pixels],
        bounced: None,
    }
}
