//! Deferred shading: `Σ_k E_k f̄(i_k, o)` at every shading point, and the average of the points of each pixel.

use glam::Vec3;
use rayon::prelude::*;

use super::shading_points::ShadingPoints;
use crate::effective::Reflectance;
use crate::render::shadow::LightVisibility;
use crate::render::{CameraView, DirectionalLight, Image};

/// Points per task.
const CHUNK: usize = 256;

/// Returns the radiance of each point towards the eye. Without `visibility`, every light is visible.
pub fn radiance(
    points: &ShadingPoints,
    lights: &[DirectionalLight],
    visibility: Option<&LightVisibility>,
    eye: Vec3,
    reflectance: &dyn Reflectance,
) -> Vec<Vec3> {
    let mut radiance = vec![Vec3::ZERO; points.len()];
    radiance.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, radiance)| {
        let (mut directions, mut irradiances) = (Vec::with_capacity(lights.len()), Vec::with_capacity(lights.len()));
        let mut values = vec![Vec3::ZERO; lights.len()];
        for (k, radiance) in radiance.iter_mut().enumerate() {
            let point = chunk * CHUNK + k;
            let (z, x) = (points.normals[point], points.tangents[point]);
            let y = z.cross(x);
            let in_tangent = |d: Vec3| Vec3::new(d.dot(x), d.dot(y), d.dot(z));
            directions.clear();
            irradiances.clear();
            for (k, light) in lights.iter().enumerate() {
                if visibility.is_none_or(|visibility| visibility.is_lit(point, k)) && light.direction.dot(z) > 0.0 {
                    directions.push(in_tangent(light.direction));
                    irradiances.push(light.irradiance);
                }
            }
            if directions.is_empty() {
                continue;
            }
            let o = in_tangent((eye - points.positions[point]).try_normalize().unwrap_or(z));
            let values = &mut values[..directions.len()];
            reflectance.eval_lights(&directions, o, values);
            *radiance = values.iter().zip(&irradiances).map(|(f, e)| *f * *e).sum();
        }
    });
    radiance
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
