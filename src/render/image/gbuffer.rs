//! The G-buffer: triangle, position, normal and tangent of each image sample. It is the CPU twin of a GPU pass. Rules:
//!
//! - Coverage is as in [`super::raster`].
//! - Position, normal and tangent are interpolated perspective-correctly. Normal and tangent are then normalized and
//!   made perpendicular. The frame's y is `normal × tangent`.
//! - If the back of a two-sided surface is visible, its normal is flipped.
//! - At silhouettes a smooth normal may point away from the viewer. Such a normal is bent towards the viewer, in the
//!   plane of both, until `n · o` is [`MIN_COSINE`]. This is the least change that keeps the effective BRDF defined, so
//!   that no black fringe appears.

use glam::Vec3;
use rayon::prelude::*;

use super::raster::{NO_TRIANGLE, Projection, RasterSample};
use crate::render::{CameraView, ObjectMesh};

/// Smallest cosine between a shading normal and the view direction (88.85°).
pub const MIN_COSINE: f32 = 0.02;

/// Arrays with one entry per sample, row by row. If a sample's triangle is [`NO_TRIANGLE`], its other entries are zero.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GBuffer {
    /// Samples per row: the image width times the samples per pixel side; `height` likewise.
    pub width: usize,
    pub height: usize,
    /// Index into the mesh's triangles.
    pub triangles: Vec<u32>,
    /// World positions.
    pub positions: Vec<Vec3>,
    /// Unit shading normals in the world frame, on the viewer's side.
    pub normals: Vec<Vec3>,
    /// Unit tangents (tile x), perpendicular to the normals.
    pub tangents: Vec<Vec3>,
}

/// Most rows of samples per band, rounded up to whole pixels.
const BAND: usize = 16;
/// Bands of a small image, so that all processors have some.
const MIN_BANDS: usize = 64;

impl GBuffer {
    /// Rasterises the mesh with `samples_per_side²` samples per pixel.
    pub fn new(mesh: &ObjectMesh, view: &CameraView, samples_per_side: usize) -> Self {
        let bands = Self::map_bands(mesh, view, samples_per_side, |_, band| band);
        bands.into_iter().fold(Self::default(), Self::above)
    }

    /// Calls `of` with the first row of pixels and the G-buffer of each band of rows, in parallel, and returns the results
    /// in order. Less memory is written than for a whole image.
    pub fn map_bands<T: Send>(
        mesh: &ObjectMesh,
        view: &CameraView,
        samples_per_side: usize,
        of: impl Fn(usize, Self) -> T + Sync,
    ) -> Vec<T> {
        let size = view.size.map(|n| n * samples_per_side);
        let pixel_rows = BAND.min(size[1].div_ceil(MIN_BANDS)).div_ceil(samples_per_side);
        let projection = Projection::new(mesh, view, size, pixel_rows * samples_per_side);
        let of_band = |band: usize| {
            let buffer = Self::of_samples(mesh, view, size[0], &projection.samples(band));
            of(band * pixel_rows, buffer)
        };
        (0..projection.band_count()).into_par_iter().map(of_band).collect()
    }

    fn of_samples(mesh: &ObjectMesh, view: &CameraView, width: usize, samples: &[RasterSample]) -> Self {
        let empty = || Vec::with_capacity(samples.len());
        let mut buffer = Self {
            width,
            height: samples.len() / width.max(1),
            triangles: samples.iter().map(|sample| sample.triangle).collect(),
            positions: empty(),
            normals: empty(),
            tangents: empty(),
        };
        for sample in samples {
            let (position, normal, tangent) = match sample.triangle {
                NO_TRIANGLE => (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO),
                _ => resolve(mesh, view, sample),
            };
            buffer.positions.push(position);
            buffer.normals.push(normal);
            buffer.tangents.push(tangent);
        }
        buffer
    }

    /// This buffer with the rows of another below it.
    fn above(mut self, below: Self) -> Self {
        self.width = below.width;
        self.height += below.height;
        self.triangles.extend(below.triangles);
        self.positions.extend(below.positions);
        self.normals.extend(below.normals);
        self.tangents.extend(below.tangents);
        self
    }
}

/// Returns position, normal and tangent of a covered sample.
fn resolve(mesh: &ObjectMesh, view: &CameraView, sample: &RasterSample) -> (Vec3, Vec3, Vec3) {
    let triangle = mesh.triangles[sample.triangle as usize];
    let [v, w] = sample.barycentric;
    let mix = |values: &[Vec3]| {
        let [a, b, c] = triangle.map(|k| values[k as usize]);
        a * (1.0 - v - w) + b * v + c * w
    };
    let position = mix(&mesh.positions);
    let [a, b, c] = mesh.corners(sample.triangle as usize);
    let outside = (b - a).cross(c - a);
    let side = if outside.dot(view.eye - a) < 0.0 { -1.0 } else { 1.0 };
    let flat = outside.try_normalize().unwrap_or(view.back);
    let normal = mix(&mesh.normals).try_normalize().unwrap_or(flat) * side;
    let viewer = (view.eye - position).try_normalize().unwrap_or(view.back);
    let normal = bent_towards(normal, viewer);
    (position, normal, perpendicular(mix(&mesh.tangents), normal))
}

/// Returns the unit vector nearest to the unit `normal` whose cosine with the unit `viewer` is at least [`MIN_COSINE`].
pub fn bent_towards(normal: Vec3, viewer: Vec3) -> Vec3 {
    let cosine = normal.dot(viewer);
    if cosine >= MIN_COSINE {
        return normal;
    }
    let across = (normal - viewer * cosine).try_normalize().unwrap_or_else(|| viewer.any_orthonormal_vector());
    viewer * MIN_COSINE + across * (1.0 - MIN_COSINE * MIN_COSINE).sqrt()
}

/// Returns the normalized component of `tangent` perpendicular to the unit `normal`; any perpendicular if it vanishes.
pub fn perpendicular(tangent: Vec3, normal: Vec3) -> Vec3 {
    let across = tangent - normal * tangent.dot(normal);
    if across.length_squared() > 1e-10 { across.normalize_or(Vec3::X) } else { normal.any_orthonormal_vector() }
}

#[cfg(test)]
#[path = "gbuffer_tests.rs"]
mod tests;
