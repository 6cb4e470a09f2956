//! Selection of the lights that can change an image of an object.

use glam::Vec3;
use rayon::prelude::*;

use crate::brdf::LUMINANCE;
use crate::plan::FAINT_FRACTION;
use crate::render::{DirectionalLight, ObjectMesh};

/// Returns the lights that are worth shading. A light that no part of the object faces changes no pixel. The faint
/// lights that are left out hold at most [`FAINT_FRACTION`] of the light.
pub fn significant_lights(mesh: &ObjectMesh, lights: &[DirectionalLight]) -> Vec<DirectionalLight> {
    let luminance = |light: &DirectionalLight| light.irradiance.dot(LUMINANCE).max(0.0);
    let total: f32 = lights.iter().map(luminance).sum();
    let mut order: Vec<usize> = (0..lights.len()).collect();
    order.sort_by(|a, b| luminance(&lights[*a]).total_cmp(&luminance(&lights[*b])).then(a.cmp(b)));
    let mut selected = vec![true; lights.len()];
    let mut dropped = 0.0;
    for k in order {
        dropped += luminance(&lights[k]);
        if dropped > FAINT_FRACTION * total {
            break;
        }
        selected[k] = false;
    }
    if !mesh.two_sided {
        let faced: Vec<bool> = lights.par_iter().map(|light| faces(mesh, light.direction)).collect();
        selected.iter_mut().zip(faced).for_each(|(selected, faced)| *selected &= faced);
    }
    lights.iter().zip(selected).filter(|(_, selected)| *selected).map(|(light, _)| *light).collect()
}

/// Returns whether any vertex normal points to the light's side; shading normals lie between vertex normals.
fn faces(mesh: &ObjectMesh, light: Vec3) -> bool {
    mesh.normals.iter().any(|normal| normal.dot(light) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::object;

    fn light(direction: Vec3, irradiance: f32) -> DirectionalLight {
        DirectionalLight { direction, irradiance: Vec3::splat(irradiance) }
    }

    #[test]
    fn lights_that_nothing_faces_and_the_faintest_are_left_out() {
        let sphere = object::build(&crate::scene::Object::default(), std::path::Path::new("")).unwrap();
        let lights = [light(Vec3::Y, 10.0), light(Vec3::NEG_Y, 10.0), light(Vec3::X, 0.006), light(Vec3::Z, 0.02)];
        // A sphere faces every light. The faintest light has 0.006 of 20, which is below a thousandth; two have 0.026.
        assert_eq!(significant_lights(&sphere, &lights), [lights[0], lights[1], lights[3]]);
        let roof = ObjectMesh { normals: vec![Vec3::Y; sphere.normals.len()], two_sided: false, ..sphere.clone() };
        assert_eq!(significant_lights(&roof, &lights[..2]), [lights[0]]);
        let sheet = ObjectMesh { two_sided: true, ..roof };
        assert_eq!(significant_lights(&sheet, &lights[..2]).len(), 2);
        assert!(significant_lights(&sphere, &[]).is_empty());
    }
}
