//! Where the material is evaluated: one point a pixel inside smooth regions, one a sample at edges.

use glam::Vec3;
use rayon::prelude::*;

use super::gbuffer::perpendicular;
use super::raster::NOTHING;
use crate::render::{CameraView, GBuffer};

/// Samples of a pixel whose normals differ less (cosine of 2°) may share one evaluation.
const SAME_NORMAL: f32 = 0.999_39;
/// The same for tangents (5°), which turn fast about poles.
const SAME_TANGENT: f32 = 0.996_2;

/// Points to shade, ordered by pixel; one entry a point in every array.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ShadingPoints {
    /// Pixel of the picture each point belongs to.
    pub pixels: Vec<u32>,
    /// Share of its pixel; the rest of a pixel is background.
    pub weights: Vec<f32>,
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec3>,
    /// Mesh triangle each lies on.
    pub triangles: Vec<u32>,
}

impl ShadingPoints {
    /// Gathers a G-buffer of `samples_per_side²` samples a pixel of `view`.
    pub fn new(buffer: &GBuffer, view: &CameraView, samples_per_side: usize) -> Self {
        let [width, height] = view.size;
        let rows: Vec<Self> = (0..height)
            .into_par_iter()
            .map(|row| {
                let mut points = Self::default();
                let mut samples = Vec::with_capacity(samples_per_side * samples_per_side);
                for column in 0..width {
                    samples.clear();
                    for k in 0..samples_per_side * samples_per_side {
                        let (x, y) = (
                            column * samples_per_side + k % samples_per_side,
                            row * samples_per_side + k / samples_per_side,
                        );
                        samples.push(y * buffer.width + x);
                    }
                    points.add_pixel((row * width + column) as u32, buffer, view, &samples);
                }
                points
            })
            .collect();
        rows.into_iter().fold(Self::default(), Self::followed_by)
    }

    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    fn add_pixel(&mut self, pixel: u32, buffer: &GBuffer, view: &CameraView, samples: &[usize]) {
        let Some(&first) = samples.first() else {
            return;
        };
        let share = 1.0 / samples.len() as f32;
        if samples.len() > 1 && are_alike(buffer, view, samples) {
            let mean = |values: &[Vec3]| samples.iter().map(|&k| values[k]).sum::<Vec3>() * share;
            let normal = mean(&buffer.normals).try_normalize().unwrap_or(buffer.normals[first]);
            let tangent = perpendicular(mean(&buffer.tangents), normal);
            // A place on the surface, not the mean: across a concave edge that lies inside the object, in the dark.
            self.add(pixel, 1.0, buffer.positions[first], normal, tangent, buffer.triangles[first]);
            return;
        }
        for &k in samples.iter().filter(|&&k| buffer.triangles[k] != NOTHING) {
            self.add(pixel, share, buffer.positions[k], buffer.normals[k], buffer.tangents[k], buffer.triangles[k]);
        }
    }

    fn add(&mut self, pixel: u32, weight: f32, position: Vec3, normal: Vec3, tangent: Vec3, triangle: u32) {
        self.pixels.push(pixel);
        self.weights.push(weight);
        self.positions.push(position);
        self.normals.push(normal);
        self.tangents.push(tangent);
        self.triangles.push(triangle);
    }

    fn followed_by(mut self, next: Self) -> Self {
        self.pixels.extend(next.pixels);
        self.weights.extend(next.weights);
        self.positions.extend(next.positions);
        self.normals.extend(next.normals);
        self.tangents.extend(next.tangents);
        self.triangles.extend(next.triangles);
        self
    }
}

/// Whether all samples show the same piece of smooth surface: covered, normals and tangents alike, and no step in depth
/// larger than the pixel's own extent there.
fn are_alike(buffer: &GBuffer, view: &CameraView, samples: &[usize]) -> bool {
    let first = samples[0];
    if samples.iter().any(|&k| buffer.triangles[k] == NOTHING) {
        return false;
    }
    let (position, normal, tangent) = (buffer.positions[first], buffer.normals[first], buffer.tangents[first]);
    let step = view.pixel_extent() * (position - view.eye).length();
    samples[1..].iter().all(|&k| {
        buffer.normals[k].dot(normal) >= SAME_NORMAL
            && buffer.tangents[k].dot(tangent) >= SAME_TANGENT
            && (buffer.positions[k] - position).dot(normal).abs() <= step
    })
}
