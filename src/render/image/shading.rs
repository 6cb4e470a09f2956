//! Deferred shading: `Σ_k E_k f̄(i_k, o)` at every shading point, and the average of the points of each pixel.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::shading_points::ShadingPoints;
use crate::effective::Reflectance;
use crate::render::shadow::LightVisibility;
use crate::render::{CameraView, DirectionalLight, Image};

/// Points per task.
const CHUNK: usize = 256;

/// Largest number of points over which interreflection is interpolated.
const RUN: usize = 8;
/// Bounds the angles between the normals, tangents and views of the ends of such a run: the cosine of 4°. The tables of
/// interreflection have steps of 5.6° and more.
const MIN_RUN_COSINE: f32 = 0.997_56;

/// Returns the radiance of each point towards the eye. Without `visibility`, every light is visible.
pub fn radiance(
    points: &ShadingPoints,
    lights: &[DirectionalLight],
    visibility: Option<&LightVisibility>,
    eye: Vec3,
    reflectance: &dyn Reflectance,
) -> Vec<Vec3> {
    let shading = Shading { points, lights, visibility, eye, reflectance };
    let mut radiance = vec![Vec3::ZERO; points.len()];
    radiance.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, radiance)| {
        let first = chunk * CHUNK;
        if shading.add_direct(first, radiance) {
            shading.add_bounced(first, radiance);
        }
    });
    radiance
}

/// The inputs of [`radiance`].
struct Shading<'a> {
    points: &'a ShadingPoints,
    lights: &'a [DirectionalLight],
    visibility: Option<&'a LightVisibility>,
    eye: Vec3,
    reflectance: &'a dyn Reflectance,
}

impl Shading<'_> {
    /// Adds what the points from `first` on reflect directly. Returns true if bounced light is missing.
    fn add_direct(&self, first: usize, radiance: &mut [Vec3]) -> bool {
        let (mut directions, mut irradiances) = (Vec::new(), Vec::new());
        let mut values = vec![Vec3::ZERO; self.lights.len()];
        let mut is_bounced_missing = false;
        for (point, radiance) in (first..).zip(radiance) {
            let frame = self.frame(point);
            directions.clear();
            irradiances.clear();
            for (k, light) in self.lights.iter().enumerate() {
                if self.is_lit(point, k) {
                    directions.push(frame.transpose() * light.direction);
                    irradiances.push(light.irradiance);
                }
            }
            if directions.is_empty() {
                continue;
            }
            let values = &mut values[..directions.len()];
            is_bounced_missing |= self.reflectance.eval_direct(&directions, self.view(point, frame), values);
            *radiance = values.iter().zip(&irradiances).map(|(f, e)| *f * *e).sum();
        }
        is_bounced_missing
    }

    /// Adds interreflection. It is evaluated at the ends of runs of similar points, and interpolated between them.
    fn add_bounced(&self, first: usize, radiance: &mut [Vec3]) {
        let end = first + radiance.len();
        let mut directions = Vec::with_capacity(self.lights.len());
        let mut values = [(); 2].map(|()| vec![Vec3::ZERO; self.lights.len()]);
        let mut eval = |point: usize, values: &mut Vec<Vec3>| {
            let frame = self.frame(point);
            directions.clear();
            directions.extend(self.lights.iter().map(|light| frame.transpose() * light.direction));
            self.reflectance.eval_bounced(&directions, self.view(point, frame), values);
        };
        let [at_start, at_last] = &mut values;
        let (mut start, mut is_known) = (first, false);
        while start < end {
            if !is_known {
                eval(start, at_start);
            }
            let longest = (start + 1..end.min(start + RUN + 1)).take_while(|point| self.is_similar(start, *point));
            let last = longest.last().unwrap_or(start);
            is_known = last > start;
            if is_known {
                eval(last, at_last);
            }
            // The last point begins the next run.
            for point in start..last.max(start + 1) {
                let t = (point - start) as f32 / (last - start).max(1) as f32;
                let lit = (0..self.lights.len()).filter(|k| self.is_lit(point, *k));
                radiance[point - first] +=
                    lit.map(|k| at_start[k].lerp(at_last[k], t) * self.lights[k].irradiance).sum::<Vec3>();
            }
            std::mem::swap(at_start, at_last);
            start = last.max(start + 1);
        }
    }

    fn is_similar(&self, a: usize, b: usize) -> bool {
        let points = self.points;
        let towards_eye = |point: usize| (self.eye - points.positions[point]).normalize_or_zero();
        points.pixels[b] - points.pixels[a] <= RUN as u32
            && points.normals[a].dot(points.normals[b]) >= MIN_RUN_COSINE
            && points.tangents[a].dot(points.tangents[b]) >= MIN_RUN_COSINE
            && towards_eye(a).dot(towards_eye(b)) >= MIN_RUN_COSINE
    }

    /// Returns whether a light reaches a point, on the side of its normal.
    fn is_lit(&self, point: usize, light: usize) -> bool {
        self.visibility.is_none_or(|visibility| visibility.is_lit(point, light))
            && self.lights[light].direction.dot(self.points.normals[point]) > 0.0
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
