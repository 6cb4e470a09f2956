//! Rasterization: the visible triangle of each image sample. Rules, shared with the GPU:
//!
//! - Sample (x, y) of an image with `s` samples per pixel side is at pixel coordinates `((x+½)/s, (y+½)/s)`.
//! - Vertices are snapped to 1/256 of a sample. Edge functions are exact integers, and the top-left rule decides ties.
//!   Triangles that share an edge therefore neither overlap nor leave a gap.
//! - The nearest triangle is visible; of equally near triangles, the first.
//! - Back faces are culled unless the surface is two-sided.
//! - Triangles are clipped at the camera's near plane.

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use crate::render::{CameraView, ObjectMesh};

/// The triangle index of a sample that no triangle covers.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// Snapped coordinates per sample.
const SUBSTEPS: f64 = 256.0;
/// Bounds snapped coordinates, so that products of differences fit in 63 bits.
const MAX_COORDINATE: f64 = (1i64 << 29) as f64;
/// Triangles per projection task.
const CHUNK: usize = 2048;

/// The visible triangle of a sample, and the point on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RasterSample {
    /// Index into the mesh's triangles, or [`NO_TRIANGLE`].
    pub triangle: u32,
    /// Barycentric weights (perspective-correct) of the triangle's second and third corner.
    pub barycentric: [f32; 2],
    /// One over the depth along the view direction; 0 if the sample is not covered.
    pub inverse_depth: f32,
}

const EMPTY: RasterSample = RasterSample { triangle: NO_TRIANGLE, barycentric: [0.0; 2], inverse_depth: 0.0 };

/// A projected triangle, or a clipped piece of one, wound so that its area is positive with y down.
struct Projected {
    triangle: u32,
    /// Snapped coordinates.
    corners: [[i64; 2]; 3],
    inverse_depths: [f32; 3],
    /// Barycentric coordinates of each corner in the mesh triangle.
    barycentric: [Vec3; 3],
    /// Half-open range of sample rows that the piece may cover.
    rows: [usize; 2],
}

/// A mesh projected into an image, with its triangles sorted into bands of rows.
pub struct Projection {
    /// Samples per row, and rows: the image size times the samples per pixel side.
    size: [usize; 2],
    rows_per_band: usize,
    pieces: Vec<Projected>,
    /// The pieces that each band may show.
    bands: Vec<Vec<u32>>,
}

impl Projection {
    pub fn new(mesh: &ObjectMesh, view: &CameraView, size: [usize; 2], rows_per_band: usize) -> Self {
        let pieces = project(mesh, view, size[0], size[1]);
        let mut bands = vec![Vec::new(); size[1].div_ceil(rows_per_band)];
        for (k, piece) in pieces.iter().enumerate() {
            for band in &mut bands[piece.rows[0] / rows_per_band..piece.rows[1].div_ceil(rows_per_band)] {
                band.push(k as u32);
            }
        }
        Self { size, rows_per_band, pieces, bands }
    }

    pub fn band_count(&self) -> usize {
        self.bands.len()
    }

    /// The samples of a band, row by row. The last band may have fewer rows.
    pub fn samples(&self, band: usize) -> Vec<RasterSample> {
        let ([width, height], first_row) = (self.size, band * self.rows_per_band);
        let mut samples = vec![EMPTY; width * self.rows_per_band.min(height - first_row)];
        for &piece in &self.bands[band] {
            fill(&self.pieces[piece as usize], &mut samples, width, first_row);
        }
        samples
    }
}

fn project(mesh: &ObjectMesh, view: &CameraView, width: usize, height: usize) -> Vec<Projected> {
    let in_view: Vec<Vec3> = mesh.positions.iter().map(|p| view.view_from_world(*p)).collect();
    let scale = DVec2::new(width as f64 / view.size[0] as f64, height as f64 / view.size[1] as f64) * SUBSTEPS;
    let snap = |p: Vec3| {
        let at = view.pixel_from_view(p).as_dvec2() * scale;
        at.to_array().map(|x| x.round().clamp(-MAX_COORDINATE, MAX_COORDINATE) as i64)
    };
    let snapped: Vec<[i64; 2]> = in_view.iter().map(|p| snap(*p)).collect();
    let pieces_of = |(first, triangles): (usize, &[[u32; 3]])| {
        let mut pieces = Vec::with_capacity(triangles.len());
        for (k, triangle) in triangles.iter().enumerate() {
            let triangle_index = (first * CHUNK + k) as u32;
            let corners = triangle.map(|v| in_view[v as usize]);
            if corners.iter().all(|p| p.z >= view.near) {
                let corners = [(corners[0], Vec3::X), (corners[1], Vec3::Y), (corners[2], Vec3::Z)];
                let snapped = triangle.map(|v| snapped[v as usize]);
                pieces.extend(project_piece(triangle_index, corners, snapped, mesh.two_sided, height));
                continue;
            }
            let polygon = clip_near(corners, view.near);
            for fan in 2..polygon.len() {
                let corners = [polygon[0], polygon[fan - 1], polygon[fan]];
                let snapped = corners.map(|(p, _)| snap(p));
                pieces.extend(project_piece(triangle_index, corners, snapped, mesh.two_sided, height));
            }
        }
        pieces
    };
    let chunks: Vec<Vec<Projected>> = mesh.triangles.par_chunks(CHUNK).enumerate().map(pieces_of).collect();
    chunks.into_iter().flatten().collect()
}

/// Culls and winds a piece and computes its rows.
fn project_piece(
    triangle: u32,
    mut corners: [(Vec3, Vec3); 3],
    mut snapped: [[i64; 2]; 3],
    two_sided: bool,
    height: usize,
) -> Option<Projected> {
    let area = edge(snapped[0], snapped[1], snapped[2]);
    // Front faces are counter-clockwise with y up, so their area is negative with y down.
    if area == 0 || (area > 0 && !two_sided) {
        return None;
    }
    if area < 0 {
        corners.swap(1, 2);
        snapped.swap(1, 2);
    }
    let ys = snapped.map(|c| c[1]);
    let (top, bottom) = (ys[0].min(ys[1]).min(ys[2]), ys[0].max(ys[1]).max(ys[2]));
    // Rows whose centres (at y + ½) lie between top and bottom.
    let row = |y: i64| (y + 127).div_euclid(256).clamp(0, height as i64) as usize;
    let rows = [row(top), row(bottom + 1)];
    (rows[0] < rows[1]).then(|| Projected {
        triangle,
        corners: snapped,
        inverse_depths: corners.map(|(p, _)| 1.0 / p.z),
        barycentric: corners.map(|(_, b)| b),
        rows,
    })
}

/// Returns the part of a triangle beyond the near plane as a convex polygon of (view position, barycentric
/// coordinates).
fn clip_near(corners: [Vec3; 3], near: f32) -> Vec<(Vec3, Vec3)> {
    let all = [(corners[0], Vec3::X), (corners[1], Vec3::Y), (corners[2], Vec3::Z)];
    let inside = corners.map(|p| p.z >= near);
    let mut polygon = Vec::new();
    for k in 0..3 {
        let (from, to) = (all[k], all[(k + 1) % 3]);
        if inside[k] {
            polygon.push(from);
        }
        if inside[k] != inside[(k + 1) % 3] {
            let t = (near - from.0.z) / (to.0.z - from.0.z);
            let mut cut = from.0.lerp(to.0, t);
            cut.z = near;
            polygon.push((cut, from.1.lerp(to.1, t)));
        }
    }
    polygon
}

/// Returns twice the signed area of a, b, p; positive to the right of a→b with y down.
fn edge(a: [i64; 2], b: [i64; 2], p: [i64; 2]) -> i64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

/// Returns 0 for top and left edges, which cover the points exactly on them, and -1 for the others.
fn bias(a: [i64; 2], b: [i64; 2]) -> i64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    if dy < 0 || (dy == 0 && dx > 0) { 0 } else { -1 }
}

fn fill(piece: &Projected, samples: &mut [RasterSample], width: usize, first_row: usize) {
    let [a, b, c] = piece.corners;
    let rows = first_row.max(piece.rows[0])..piece.rows[1].min(first_row + samples.len() / width);
    let xs = [a[0], b[0], c[0]];
    let column = |x: i64| (x + 127).div_euclid(256).clamp(0, width as i64) as usize;
    let columns = column(xs[0].min(xs[1]).min(xs[2]))..column(xs[0].max(xs[1]).max(xs[2]) + 1);
    let area = edge(a, b, c) as f64;
    let edges = [(b, c), (c, a), (a, b)];
    let biases = edges.map(|(from, to)| bias(from, to));
    let steps = edges.map(|(from, to)| -256 * (to[1] - from[1]));
    for row in rows {
        let start = [columns.start as i64 * 256 + 128, row as i64 * 256 + 128];
        let mut values = edges.map(|(from, to)| edge(from, to, start));
        let line = &mut samples[(row - first_row) * width..][columns.clone()];
        for sample in line {
            if (values[0] + biases[0]) | (values[1] + biases[1]) | (values[2] + biases[2]) >= 0 {
                depth_test(piece, values, area, sample);
            }
            for (value, step) in values.iter_mut().zip(steps) {
                *value += step;
            }
        }
    }
}

/// Stores the piece in the sample if it is nearer than the stored one.
fn depth_test(piece: &Projected, values: [i64; 3], area: f64, sample: &mut RasterSample) {
    let weights: [f32; 3] = std::array::from_fn(|k| (values[k] as f64 / area) as f32 * piece.inverse_depths[k]);
    let inverse_depth = weights[0] + weights[1] + weights[2];
    if inverse_depth > sample.inverse_depth {
        let sum: Vec3 = (0..3).map(|k| piece.barycentric[k] * weights[k]).sum();
        let barycentric = sum / inverse_depth;
        *sample = RasterSample { triangle: piece.triangle, barycentric: [barycentric.y, barycentric.z], inverse_depth };
    }
}

#[cfg(test)]
#[path = "raster_tests.rs"]
mod tests;
