//! Lights that no picture of an object can show: none of its parts faces them, or others outshine them.

use glam::Vec3;
use rayon::prelude::*;

use crate::brdf::LUMINANCE;
use crate::render::{DirectionalLight, ObjectMesh};

/// Of the power of all lights, what the faintest may have together and still be left out: a quarter of a step of 8 bits.
pub const FAINT_PART: f32 = 1e-3;

/// The lights worth shading. Those left out because nothing faces them change no pixel; the faint ones less than
/// [`FAINT_PART`] of the light.
pub fn worth_shading(mesh: &ObjectMesh, lights: &[DirectionalLight]) -> Vec<DirectionalLight> {
    let power = |light: &DirectionalLight| light.irradiance.dot(LUMINANCE).max(0.0);
    let total: f32 = lights.iter().map(power).sum();
    let mut order: Vec<usize> = (0..lights.len()).collect();
    order.sort_by(|a, b| power(&lights[*a]).total_cmp(&power(&lights[*b])).then(a.cmp(b)));
    let mut keep = vec![true; lights.len()];
    let mut dropped = 0.0;
    for k in order {
        dropped += power(&lights[k]);
        if dropped > FAINT_PART * total {
            break;
        }
        keep[k] = false;
    }
    if !mesh.two_sided {
        let faced: Vec<bool> = lights.par_iter().map(|light| faces(mesh, light.direction)).collect();
        keep.iter_mut().zip(faced).for_each(|(keep, faced)| *keep &= faced);
    }
    lights.iter().zip(keep).filter(|(_, keep)| *keep).map(|(light, _)| *light).collect()
}

/// Does any normal, of a vertex or of a triangle, point to the light's side? Shading normals lie between those of the vertices.
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
        // A sphere faces all; 0.006 of 20 is below a thousandth, 0.026 is not.
        assert_eq!(worth_shading(&sphere, &lights), [lights[0], lights[1], lights[3]]);
        let roof = ObjectMesh { normals: vec![Vec3::Y; sphere.normals.len()], two_sided: false, ..sphere.clone() };
        assert_eq!(worth_shading(&roof, &lights[..2]), [lights[0]]);
        let sheet = ObjectMesh { two_sided: true, ..roof };
        assert_eq!(worth_shading(&sheet, &lights[..2]).len(), 2);
        assert!(worth_shading(&sphere, &[]).is_empty());
    }
}
