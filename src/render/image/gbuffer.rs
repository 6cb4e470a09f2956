//! The G-buffer: what each sample of the picture shows, as plain arrays. The CPU's twin of the wgpu pass; rules:
//!
//! - coverage as in [`super::raster`];
//! - position, normal and tangent are interpolated perspective-correctly, then normal and tangent made unit and
//!   perpendicular; the frame's y is `normal × tangent`;
//! - where the back of a two-sided surface shows, its normal is turned over;
//! - a normal that leans away from the viewer (smooth normals do, at silhouettes) is bent towards the viewer, in the plane of
//!   both, just until `n · o` is [`MIN_COSINE`]: the least change that keeps the material's answer defined, so that no
//!   black fringe appears.

use glam::Vec3;
use rayon::prelude::*;

use super::raster;
use super::raster::{NOTHING, Sample};
use crate::render::{CameraView, ObjectMesh};

/// Smallest cosine between a shading normal and the direction to the viewer (88.85°).
pub const MIN_COSINE: f32 = 0.02;

/// One entry a sample in every array, row by row. Where `triangles` is [`NOTHING`] the others are zero.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GBuffer {
    /// Samples across and down: the picture's size times the samples a side.
    pub width: usize,
    pub height: usize,
    /// Index into the mesh's triangles.
    pub triangles: Vec<u32>,
    /// World positions.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, world frame, on the viewer's side.
    pub normals: Vec<Vec3>,
    /// Unit tangents (tile x), perpendicular to the normals.
    pub tangents: Vec<Vec3>,
}

impl GBuffer {
    /// Rasterises the mesh with `samples_per_side²` samples a pixel.
    pub fn new(mesh: &ObjectMesh, view: &CameraView, samples_per_side: usize) -> Self {
        let [width, height] = view.size.map(|n| n * samples_per_side);
        let samples = raster::rasterize(mesh, view, width, height);
        let count = samples.len();
        let mut buffer = Self {
            width,
            height,
            triangles: vec![NOTHING; count],
            positions: vec![Vec3::ZERO; count],
            normals: vec![Vec3::ZERO; count],
            tangents: vec![Vec3::ZERO; count],
        };
        let places = (&mut buffer.triangles, &mut buffer.positions, &mut buffer.normals, &mut buffer.tangents);
        (samples.par_iter(), places.0, places.1, places.2, places.3).into_par_iter().with_min_len(1024).for_each(
            |(sample, triangle, position, normal, tangent)| {
                if sample.triangle != NOTHING {
                    *triangle = sample.triangle;
                    (*position, *normal, *tangent) = resolve(mesh, view, sample);
                }
            },
        );
        buffer
    }
}

/// Position, normal and tangent of a covered sample.
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

/// The unit vector nearest to the unit `normal` whose cosine with the unit `viewer` is at least [`MIN_COSINE`].
pub fn bent_towards(normal: Vec3, viewer: Vec3) -> Vec3 {
    let cosine = normal.dot(viewer);
    if cosine >= MIN_COSINE {
        return normal;
    }
    let across = (normal - viewer * cosine).try_normalize().unwrap_or_else(|| viewer.any_orthonormal_vector());
    viewer * MIN_COSINE + across * (1.0 - MIN_COSINE * MIN_COSINE).sqrt()
}

/// The part of `tangent` perpendicular to the unit `normal`, of unit length; any perpendicular where there is none.
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
            let covered: Vec<_> = (0..buffer.triangles.len()).filter(|&k| buffer.triangles[k] != NOTHING).collect();
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
    fn a_sphere_shows_its_own_normals_but_at_the_rim() {
        let (mesh, view) = view_of("sphere");
        let buffer = GBuffer::new(&mesh, &view, 1);
        for k in (0..buffer.triangles.len()).filter(|&k| buffer.triangles[k] != NOTHING) {
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
