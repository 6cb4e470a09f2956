//! Picking on the object: view direction and strongest light, in the tangent frame of the point under the pointer.

use crate::render::image::gbuffer::{bent_towards, perpendicular};
use crate::render::{CameraView, DirectionalLight, ObjectMesh};
use glam::{Vec2, Vec3};

/// Directions at a point of the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picked {
    /// View direction in the tangent frame.
    pub viewer: Vec3,
    /// Direction of the light with the largest irradiance at the point, in the tangent frame.
    pub light: Option<Vec3>,
}

/// The point at pixel coordinates of a view.
pub fn pick(mesh: &ObjectMesh, lights: &[DirectionalLight], view: &CameraView, at: Vec2) -> Option<Picked> {
    let half = Vec2::new(view.size[0] as f32, view.size[1] as f32) / 2.0;
    let ndc = (at - half) / half * view.tan_half_fov;
    let towards = (view.right * ndc.x - view.up * ndc.y - view.back).try_normalize()?;
    let mut nearest: Option<(f32, usize, [f32; 2])> = None;
    for triangle in 0..mesh.triangles.len() {
        if let Some((t, weights)) = intersect(view.eye, towards, mesh.corners(triangle), mesh.two_sided)
            && nearest.is_none_or(|(best, ..)| t < best)
        {
            nearest = Some((t, triangle, weights));
        }
    }
    let (_, triangle, [v, w]) = nearest?;
    let mix = |values: &[Vec3]| {
        let [a, b, c] = mesh.triangles[triangle].map(|k| values[k as usize]);
        a * (1.0 - v - w) + b * v + c * w
    };
    let [a, b, c] = mesh.corners(triangle);
    let side = if (b - a).cross(c - a).dot(towards) > 0.0 { -1.0 } else { 1.0 };
    let normal = bent_towards(mix(&mesh.normals).try_normalize()? * side, -towards);
    let tangent = perpendicular(mix(&mesh.tangents), normal);
    let across = normal.cross(tangent);
    let local = |d: Vec3| Vec3::new(d.dot(tangent), d.dot(across), d.dot(normal));
    let irradiance = |light: &DirectionalLight| light.irradiance.element_sum() * light.direction.dot(normal);
    let light = lights
        .iter()
        .filter(|light| light.direction.dot(normal) > 0.0)
        .max_by(|a, b| irradiance(a).total_cmp(&irradiance(b)))
        .map(|light| local(light.direction));
    Some(Picked { viewer: local(-towards), light })
}

fn intersect(origin: Vec3, to: Vec3, [a, b, c]: [Vec3; 3], two_sided: bool) -> Option<(f32, [f32; 2])> {
    let (ab, ac) = (b - a, c - a);
    let p = to.cross(ac);
    let determinant = ab.dot(p);
    if determinant.abs() < 1e-14 || !two_sided && determinant < 0.0 {
        return None;
    }
    let offset = origin - a;
    let v = offset.dot(p) / determinant;
    let q = offset.cross(ab);
    let w = to.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    (v >= 0.0 && w >= 0.0 && v + w <= 1.0 && t > 0.0).then_some((t, [v, w]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::object;
    use crate::scene;

    #[test]
    fn the_centre_of_a_sphere_is_viewed_along_its_normal_and_the_corner_shows_nothing() {
        let object = scene::Object { kind: "sphere".to_owned(), path: None };
        let mesh = object::build(&object, std::path::Path::new("")).unwrap();
        let view = CameraView::new(&scene::Camera::default(), &mesh, [200, 100]).unwrap();
        let light = DirectionalLight { direction: view.back, irradiance: Vec3::ONE };
        let picked = pick(&mesh, &[light], &view, Vec2::new(100.0, 50.0)).unwrap();
        assert!(picked.viewer.z > 0.999 && picked.light.unwrap().z > 0.999, "{picked:?}");
        assert_eq!(pick(&mesh, &[light], &view, Vec2::new(1.0, 1.0)), None);
        // Near the silhouette the view direction is far from the normal, and still a unit vector.
        let edge = pick(&mesh, &[], &view, Vec2::new(140.0, 50.0)).unwrap();
        assert!(edge.viewer.z < 0.75 && (edge.viewer.length() - 1.0).abs() < 1e-4 && edge.light.is_none(), "{edge:?}");
    }
}
