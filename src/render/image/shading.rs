//! Deferred shading: `Σ_k E_k f̄(i_k, o)` at every shading point, and the average of the points of each pixel.

use std::borrow::Cow;

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::interpolated;
use super::shading_points::ShadingPoints;
use crate::effective::Reflectance;
use crate::render::shadow::LightVisibility;
use crate::render::{CameraView, DirectionalLight, Image};

/// Points per task.
const CHUNK: usize = 256;

/// Which part of the reflected light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    All,
    /// As [`Reflectance::eval_direct`].
    Direct,
    /// As [`Reflectance::eval_bounced`].
    Bounced,
}

/// Returns the radiance of each point towards the eye of the view. Without `visibility`, every light is visible. If
/// `tolerance` is 0, the material is evaluated at every point. Otherwise it is evaluated at some and interpolated between
/// them, with about that relative error.
pub fn radiance(
    points: &ShadingPoints,
    lights: &[DirectionalLight],
    visibility: Option<&LightVisibility>,
    view: &CameraView,
    reflectance: &dyn Reflectance,
    tolerance: f32,
) -> Vec<Vec3> {
    let visibility = match visibility {
        Some(visibility) => Cow::Borrowed(visibility),
        None => Cow::Owned(LightVisibility::above_horizon(points, lights)),
    };
    let shading = Shading { points, lights, visibility, eye: view.eye, reflectance };
    if tolerance > 0.0 { interpolated::radiance(&shading, view.size, tolerance) } else { shading.at_every_point() }
}

/// The inputs of [`radiance`].
pub(super) struct Shading<'a> {
    pub points: &'a ShadingPoints,
    pub lights: &'a [DirectionalLight],
    pub visibility: Cow<'a, LightVisibility>,
    eye: Vec3,
    reflectance: &'a dyn Reflectance,
}

impl Shading<'_> {
    /// The simple version: the radiance of each point, from the material there.
    fn at_every_point(&self) -> Vec<Vec3> {
        let mut radiance = vec![Vec3::ZERO; self.points.len()];
        radiance.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, radiance)| {
            let mut evaluator = Evaluator::new(self);
            for (point, radiance) in (chunk * CHUNK..).zip(radiance) {
                evaluator.eval(Part::All, point, |k| self.visibility.is_lit(point, k));
                *radiance = evaluator.terms().map(|(_, value)| value).sum();
            }
        });
        radiance
    }

    /// The axes of the tangent frame.
    fn frame(&self, point: usize) -> Mat3 {
        let (z, x) = (self.points.normals[point], self.points.tangents[point]);
        Mat3::from_cols(x, z.cross(x), z)
    }

    /// The direction towards the eye in the tangent frame.
    fn view(&self, point: usize, frame: Mat3) -> Vec3 {
        let to_eye = (self.eye - self.points.positions[point]).try_normalize().unwrap_or(frame.z_axis);
        frame.transpose() * to_eye
    }
}

/// Evaluates the material at points. It keeps its buffers.
pub(super) struct Evaluator<'a> {
    shading: &'a Shading<'a>,
    sources: Vec<usize>,
    directions: Vec<Vec3>,
    values: Vec<Vec3>,
}

impl<'a> Evaluator<'a> {
    pub fn new(shading: &'a Shading<'a>) -> Self {
        Self { shading, sources: Vec::new(), directions: Vec::new(), values: vec![Vec3::ZERO; shading.lights.len()] }
    }

    /// Evaluates a part of the light of the sources that count; those below the horizon are lifted to it. Returns true if bounced
    /// light is missing in it.
    pub fn eval(&mut self, part: Part, point: usize, counts: impl Fn(usize) -> bool) -> bool {
        let (lights, reflectance) = (self.shading.lights, self.shading.reflectance);
        let frame = self.shading.frame(point);
        self.sources.clear();
        self.sources.extend((0..lights.len()).filter(|k| counts(*k)));
        if self.sources.is_empty() {
            return false;
        }
        self.directions.clear();
        self.directions.extend(self.sources.iter().map(|k| lifted(frame.transpose() * lights[*k].direction)));
        let (view, values) = (self.shading.view(point, frame), &mut self.values[..self.sources.len()]);
        match part {
            Part::All => reflectance.eval_lights(&self.directions, view, values),
            Part::Direct => return reflectance.eval_direct(&self.directions, view, values),
            Part::Bounced => reflectance.eval_bounced(&self.directions, view, values),
        }
        false
    }

    /// The sources of the last call of [`Evaluator::eval`], and the radiance that each causes.
    pub fn terms(&self) -> impl Iterator<Item = (usize, Vec3)> {
        self.sources.iter().zip(&self.values).map(|(k, value)| (*k, *value * self.shading.lights[*k].irradiance))
    }
}

/// A direction above the horizon as it is; others are lifted to little above it.
fn lifted(direction: Vec3) -> Vec3 {
    const MIN_Z: f32 = 1e-4;
    if direction.z > 0.0 { direction } else { direction.with_z(MIN_Z).normalize_or(Vec3::Z) }
}

/// The background of an image.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum ImageBackground {
    /// A grey studio wall, lighter behind the object.
    #[default]
    Wall,
    /// The same radiance everywhere.
    Uniform(Vec3),
}

impl ImageBackground {
    /// Returns the radiance at the centre of a pixel.
    fn at(&self, pixel: usize, [width, height]: [usize; 2]) -> Vec3 {
        match self {
            Self::Uniform(radiance) => *radiance,
            Self::Wall => {
                let shorter = width.min(height) as f32;
                let x = ((pixel % width) as f32 + 0.5 - 0.5 * width as f32) / shorter;
                let y = ((pixel / width) as f32 + 0.5 - 0.55 * height as f32) / shorter;
                let glow = (-3.2 * (x * x + y * y)).exp();
                Vec3::new(0.97, 1.0, 1.05) * (0.025 + 0.095 * glow)
            }
        }
    }
}

/// Averages the points of each pixel over the background, in linear radiance.
pub fn gather(points: &ShadingPoints, radiance: &[Vec3], view: &CameraView, background: &ImageBackground) -> Image {
    gather_over(points, radiance, view.size, |pixel| background.at(pixel, view.size))
}

/// As [`gather`]; `background` is the radiance behind a pixel.
pub fn gather_over(
    points: &ShadingPoints,
    radiance: &[Vec3],
    [width, height]: [usize; 2],
    background: impl Fn(usize) -> Vec3 + Sync,
) -> Image {
    let mut coverage = vec![0f32; width * height];
    let mut pixels = vec![Vec3::ZERO; width * height];
    for ((&pixel, &weight), radiance) in points.pixels.iter().zip(&points.weights).zip(radiance) {
        coverage[pixel as usize] += weight;
        pixels[pixel as usize] += *radiance * weight;
    }
    pixels.par_iter_mut().zip(coverage).enumerate().with_min_len(CHUNK).for_each(|(k, (pixel, covered))| {
        if covered < 1.0 {
            *pixel += background(k) * (1.0 - covered);
        }
    });
    Image { width, height, pixels }
}
