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

use super::raster;
use super::raster::{NO_TRIANGLE, Sample};
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

impl GBuffer {
    /// Rasterises the mesh with `samples_per_side²` samples per pixel.
    pub fn new(mesh: &ObjectMesh, view: &CameraView, samples_per_side: usize) -> Self {
        let [width, height] = view.size.map(|n| n * samples_per_side);
        let samples = raster::rasterize(mesh, view, width, height);
        let count = samples.len();
        let mut buffer = Self {
            width,
            height,
            triangles: vec![NO_TRIANGLE; count],
            positions: vec![Vec3::ZERO; count],
            normals: vec![Vec3::ZERO; count],
            tangents: vec![Vec3::ZERO; count],
        };
        let arrays = (&mut buffer.triangles, &mut buffer.positions, &mut buffer.normals, &mut buffer.tangents);
        (samples.par_iter(), arrays.0, arrays.1, arrays.2, arrays.3).into_par_iter().with_min_len(1024).for_each(
            |(sample, triangle, position, normal, tangent)| {
                if sample.triangle != NO_TRIANGLE {
                    *triangle = sample.triangle;
                    (*position, *normal, *tangent) = resolve(mesh, view, sample);
                }
            },
        );
        buffer
    }
}

/// Returns position, normal and tangent of a covered sample.
fn resolve(mesh: &ObjectMesh, view: &CameraView, sample: &Sample) -> (Vec3, Vec3, Vec3) {
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
mod tests {
    use super::*;
    use crate::render::object;
    use crate::scene;

    fn view_of(kind: &str) -> (ObjectMesh, CameraView) {
        let mesh =
            object::build(&scene::Object { kind: kind.to_owned(), path: None }, std::path::Path::new(".")).unwrap();
        let view = CameraView::new(&scene::Camera::default(), &mesh, [96, 96]).unwrap();
        (mesh, view)
    }

    #[test]
    fn every_covered_sample_has_a_frame_that_faces_the_viewer() {
        for kind in ["sphere", "skirt", "teapot"] {
            let (mesh, view) = view_of(kind);
            let buffer = GBuffer::new(&mesh, &view, 2);
            assert_eq!((buffer.width, buffer.height), (192, 192));
            let covered: Vec<_> = (0..buffer.triangles.len()).filter(|&k| buffer.triangles[k] != NO_TRIANGLE).collect();
            assert!(covered.len() > 6000, "{kind}: {}", covered.len());
            for k in covered {
                let (n, t) = (buffer.normals[k], buffer.tangents[k]);
                let viewer = (view.eye - buffer.positions[k]).normalize();
                assert!(n.dot(viewer) >= MIN_COSINE - 1e-5, "{kind}");
                assert!(
                    (n.length() - 1.0).abs() < 1e-5 && (t.length() - 1.0).abs() < 1e-5 && n.dot(t).abs() < 1e-5,
                    "{kind}"
                );
            }
        }
    }

    #[test]
    fn a_sphere_has_its_exact_normals_except_at_the_rim() {
        let (mesh, view) = view_of("sphere");
        let buffer = GBuffer::new(&mesh, &view, 1);
        for k in (0..buffer.triangles.len()).filter(|&k| buffer.triangles[k] != NO_TRIANGLE) {
            let radial = buffer.positions[k].normalize();
            let viewer = (view.eye - buffer.positions[k]).normalize();
            if radial.dot(viewer) > 0.1 {
                assert!((radial - buffer.normals[k]).length() < 2e-3);
                assert!((buffer.positions[k].length() - 1.0).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn bending_is_the_least_that_reaches_the_cosine() {
        let viewer = Vec3::Z;
        let away = Vec3::new(0.8, 0.0, -0.6);
        let bent = bent_towards(away, viewer);
        assert!((bent.dot(viewer) - MIN_COSINE).abs() < 1e-6 && bent.y == 0.0 && bent.x > 0.0);
        let facing = Vec3::new(0.0, 0.6, 0.8);
        assert_eq!(bent_towards(facing, viewer), facing);
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let (mesh, view) = view_of("teapot");
        let with_threads = |n| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| GBuffer::new(&mesh, &view, 2))
        };
        assert_eq!(with_threads(1), with_threads(3));
    }
}
