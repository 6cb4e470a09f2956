//! The camera: a perspective view that orbits the object and frames it automatically.

use glam::{Vec2, Vec3};

use crate::base::{InputError, Result};
use crate::render::ObjectMesh;
use crate::scene;

/// Size of the view relative to the object if it is framed automatically.
const MARGIN: f32 = 1.08;
/// Distance of the near plane from the eye, in radii of the object.
const NEAR: f32 = 0.02;

/// A perspective view. `right`, `up` and `back` are orthonormal; pixels are square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraView {
    pub eye: Vec3,
    pub right: Vec3,
    pub up: Vec3,
    /// From the scene to the eye.
    pub back: Vec3,
    /// Tangents of half the horizontal and vertical field of view.
    pub tan_half_fov: Vec2,
    /// Depth of the near plane.
    pub near: f32,
    /// Image size in pixels.
    pub size: [usize; 2],
}

impl CameraView {
    /// Computes the view of a scene's camera. `fov_deg` spans the shorter side of the image.
    pub fn new(camera: &scene::Camera, mesh: &ObjectMesh, size: [usize; 2]) -> Result<Self> {
        check(camera)?;
        let [width, height] = size.map(|n| n.max(1) as f32);
        let tan = (0.5 * camera.fov_deg).to_radians().tan();
        let tan_half_fov = Vec2::new(width, height) / width.min(height) * tan;
        let (sin_azimuth, cos_azimuth) = camera.azimuth_deg.to_radians().sin_cos();
        let (sin_elevation, cos_elevation) = camera.elevation_deg.to_radians().sin_cos();
        let back = Vec3::new(sin_azimuth * cos_elevation, sin_elevation, cos_azimuth * cos_elevation);
        let right = Vec3::new(cos_azimuth, 0.0, -sin_azimuth);
        let up = back.cross(right);
        let radius = mesh.bounds.radius;
        let distance = if camera.distance > 0.0 {
            camera.distance * radius
        } else {
            framing_distance(mesh, sin_elevation, cos_elevation, tan_half_fov / MARGIN)
        };
        let center = mesh.bounds.center + (right * camera.pan.x + up * camera.pan.y) * radius;
        Ok(Self { eye: center + back * distance, right, up, back, tan_half_fov, near: NEAR * radius, size })
    }

    /// Returns the coordinates of a world point along right, up and forwards from the eye.
    pub fn view_from_world(&self, point: Vec3) -> Vec3 {
        let offset = point - self.eye;
        Vec3::new(offset.dot(self.right), offset.dot(self.up), -offset.dot(self.back))
    }

    /// Returns the pixel coordinates of view coordinates in front of the eye: x to the right, y down, pixel centres at
    /// halves.
    pub fn pixel_from_view(&self, view: Vec3) -> Vec2 {
        let ndc = Vec2::new(view.x, -view.y) / (self.tan_half_fov * view.z);
        (ndc + 1.0) * 0.5 * Vec2::new(self.size[0] as f32, self.size[1] as f32)
    }

    /// Returns the extent of a pixel at unit depth.
    pub fn pixel_extent(&self) -> f32 {
        2.0 * self.tan_half_fov.y / self.size[1].max(1) as f32
    }
}

/// Returns the distance from which the object just fits at any azimuth, so that orbiting does not change it. With the
/// cylindrical coordinates ρ, y of a vertex and the elevation e, the vertex's depth towards the eye is
/// `ρ cos ψ cos e + y sin e`. The worst azimuth ψ for each side of the image therefore has a closed form.
fn framing_distance(mesh: &ObjectMesh, sin_elevation: f32, cos_elevation: f32, tan_half_fov: Vec2) -> f32 {
    let distance_for = |p: &Vec3| {
        let offset = *p - mesh.bounds.center;
        let rho = offset.x.hypot(offset.z);
        let sideways = offset.y * sin_elevation + rho * cos_elevation.hypot(1.0 / tan_half_fov.x);
        let vertical = [rho, -rho].map(|towards| {
            let height = offset.y * cos_elevation - towards * sin_elevation;
            towards * cos_elevation + offset.y * sin_elevation + height.abs() / tan_half_fov.y
        });
        sideways.max(vertical[0]).max(vertical[1])
    };
    mesh.positions.iter().map(distance_for).fold(mesh.bounds.radius * 1e-3, f32::max)
}

fn check(camera: &scene::Camera) -> Result<()> {
    let input_error = |field: &str, value: f32, expected: &str| {
        Err(InputError::new(format!("camera.{field}"), value, expected).into())
    };
    if !camera.azimuth_deg.is_finite() {
        return input_error("azimuth_deg", camera.azimuth_deg, "a finite angle in degrees");
    }
    if !camera.elevation_deg.is_finite() {
        return input_error("elevation_deg", camera.elevation_deg, "a finite angle in degrees");
    }
    if !camera.pan.is_finite() {
        return Err(InputError::new("camera.pan", camera.pan, "finite numbers").into());
    }
    if !(camera.distance == 0.0 || (0.01..=1e4).contains(&camera.distance)) {
        return input_error("distance", camera.distance, "0 (automatic), or 0.01 to 10000 radii of the object");
    }
    if !(1.0..=150.0).contains(&camera.fov_deg) {
        return input_error("fov_deg", camera.fov_deg, "1 to 150 degrees");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::object;
    use std::path::Path;

    fn object(kind: &str) -> ObjectMesh {
        object::build(&scene::Object { kind: kind.to_owned(), path: None }, Path::new(".")).unwrap()
    }

    #[test]
    fn the_framed_object_stays_inside_the_image_from_everywhere_and_nearly_fills_it() {
        for kind in ["sphere", "teapot", "skirt"] {
            let mesh = object(kind);
            for size in [[300, 200], [200, 300]] {
                for elevation_deg in [-60.0, 0.0, 20.0, 85.0] {
                    let mut fullest = 0f32;
                    for k in 0..24 {
                        let camera =
                            scene::Camera { azimuth_deg: k as f32 * 15.0, elevation_deg, ..scene::Camera::default() };
                        let view = CameraView::new(&camera, &mesh, size).unwrap();
                        for p in &mesh.positions {
                            let half = Vec2::new(size[0] as f32, size[1] as f32) / 2.0;
                            let offset = (view.pixel_from_view(view.view_from_world(*p)) - half).abs() / half;
                            fullest = fullest.max(offset.max_element());
                        }
                    }
                    assert!((0.9 / MARGIN..=1.0).contains(&fullest), "{kind} {size:?} {elevation_deg}: {fullest}");
                }
            }
        }
    }

    #[test]
    fn the_axes_are_right_handed_and_azimuth_zero_views_along_minus_z() {
        let camera = scene::Camera { azimuth_deg: 0.0, elevation_deg: 0.0, distance: 4.0, ..scene::Camera::default() };
        let view = CameraView::new(&camera, &object("sphere"), [100, 100]).unwrap();
        assert!((view.eye - Vec3::new(0.0, 0.0, 4.0)).length() < 1e-5);
        assert_eq!((view.right, view.up, view.back), (Vec3::X, Vec3::Y, Vec3::Z));
        // A point one unit right of the centre at depth 4 and 30 degrees of view: 50 (1 + 1/(4 tan 15°)).
        let pixel = view.pixel_from_view(view.view_from_world(Vec3::X));
        assert!((pixel - Vec2::new(50.0 * (1.0 + 0.25 / 15f32.to_radians().tan()), 50.0)).length() < 1e-3);
    }

    #[test]
    fn bad_cameras_are_named() {
        let good = scene::Camera::default();
        let cases = [
            (scene::Camera { fov_deg: 180.0, ..good.clone() }, "camera.fov_deg"),
            (scene::Camera { distance: -1.0, ..good.clone() }, "camera.distance"),
            (scene::Camera { azimuth_deg: f32::NAN, ..good.clone() }, "camera.azimuth_deg"),
            (scene::Camera { elevation_deg: f32::INFINITY, ..good }, "camera.elevation_deg"),
        ];
        for (camera, place) in cases {
            let error = CameraView::new(&camera, &object("sphere"), [10, 10]).unwrap_err();
            assert!(error.to_string().contains(place), "{error}");
        }
    }
}
