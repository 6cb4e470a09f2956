//! The points of an image that are shaded: one per pixel in smooth regions, one per sample at edges.

use glam::Vec3;

use super::gbuffer::perpendicular;
use super::raster::NO_TRIANGLE;
use crate::render::{CameraView, GBuffer, ObjectMesh};

/// Bounds the angles between the normals of a pixel's first and other samples that share one evaluation: the cosine of 3°.
const MIN_NORMAL_COSINE: f32 = 0.998_63;
/// Bounds the angles between their tangents, which vary fast near poles: the cosine of 5°.
const MIN_TANGENT_COSINE: f32 = 0.996_2;

/// Points to shade, ordered by pixel; every array has one entry per point.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ShadingPoints {
    /// Index of the pixel that a point belongs to.
    pub pixels: Vec<u32>,
    /// Fraction of the pixel that a point covers; the rest of the pixel is background.
    pub weights: Vec<f32>,
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec3>,
    /// Index of the mesh triangle that a point lies on.
    pub triangles: Vec<u32>,
}

impl ShadingPoints {
    /// The points that a mesh shows with `samples_per_side²` samples per pixel of `view`.
    pub fn new(mesh: &ObjectMesh, view: &CameraView, samples_per_side: usize) -> Self {
        let of_band = |first_row, buffer| Self::of_band(first_row, &buffer, view, samples_per_side);
        let bands = GBuffer::map_bands(mesh, view, samples_per_side, of_band);
        bands.into_iter().fold(Self::default(), Self::followed_by)
    }

    fn of_band(first_row: usize, buffer: &GBuffer, view: &CameraView, samples_per_side: usize) -> Self {
        let width = view.size[0];
        let mut points = Self::default();
        let mut samples = Vec::with_capacity(samples_per_side * samples_per_side);
        for row in 0..buffer.height / samples_per_side {
            for column in 0..width {
                samples.clear();
                for k in 0..samples_per_side * samples_per_side {
                    let (x, y) = (
                        column * samples_per_side + k % samples_per_side,
                        row * samples_per_side + k / samples_per_side,
                    );
                    samples.push(y * buffer.width + x);
                }
                points.add_pixel(((first_row + row) * width + column) as u32, buffer, view, &samples);
            }
        }
        points
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
        if samples.len() > 1 && can_share_evaluation(buffer, view, samples) {
            let mean = |values: &[Vec3]| samples.iter().map(|&k| values[k]).sum::<Vec3>() * share;
            let normal = mean(&buffer.normals).try_normalize().unwrap_or(buffer.normals[first]);
            let tangent = perpendicular(mean(&buffer.tangents), normal);
            // A sample's position, not their mean: across a concave edge the mean lies inside the object, in shadow.
            self.add(pixel, 1.0, buffer.positions[first], normal, tangent, buffer.triangles[first]);
            return;
        }
        for &k in samples.iter().filter(|&&k| buffer.triangles[k] != NO_TRIANGLE) {
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

/// Returns whether all samples lie on one smooth piece of surface. All must be covered, with similar normals and
/// tangents, and the steps in depth must be at most the extent of the pixel there.
fn can_share_evaluation(buffer: &GBuffer, view: &CameraView, samples: &[usize]) -> bool {
    let first = samples[0];
    if samples.iter().any(|&k| buffer.triangles[k] == NO_TRIANGLE) {
        return false;
    }
    let (position, normal, tangent) = (buffer.positions[first], buffer.normals[first], buffer.tangents[first]);
    let step = view.pixel_extent() * (position - view.eye).length();
    samples[1..].iter().all(|&k| {
        buffer.normals[k].dot(normal) >= MIN_NORMAL_COSINE
            && buffer.tangents[k].dot(tangent) >= MIN_TANGENT_COSINE
            && (buffer.positions[k] - position).dot(normal).abs() <= step
    })
}
