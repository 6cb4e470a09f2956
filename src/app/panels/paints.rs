//! Materials that the user paints on the tile, in the slots `paint_1`, `paint_2` and so on.

use crate::geometry::image_file::MAX_SLOTS;
use crate::geometry::painted_slot;
use crate::scene::{BrdfSpec, MaterialSpec, Scene, TermSpec};
use glam::Vec3;

use super::materials::grey;

/// Initial colours of painted materials. Neighbouring entries differ clearly.
const PAINTS: [[f32; 3]; 6] =
    [[0.05, 0.2, 0.6], [0.75, 0.45, 0.05], [0.55, 0.05, 0.05], [0.1, 0.4, 0.1], [0.6, 0.6, 0.55], [0.3, 0.08, 0.4]];

/// Adds the material of a painted slot if the scene lacks it. Returns true if it was added.
pub fn add_painted(scene: &mut Scene, number: u8) -> bool {
    let name = painted_slot(number);
    if number == 0 || scene.materials.iter().any(|material| material.name == name) {
        return false;
    }
    if scene.materials.is_empty() {
        scene.materials.push(grey());
    }
    let albedo = Vec3::from_array(PAINTS[usize::from(number - 1) % PAINTS.len()]);
    let brdf = Some(BrdfSpec::One(TermSpec::Lambertian { albedo }));
    scene.materials.push(MaterialSpec { name, brdf, color: Vec3::ONE });
    true
}

/// Returns the painted slots for which the scene has materials.
pub fn painted(scene: &Scene) -> Vec<u8> {
    (1..=MAX_SLOTS).filter(|k| scene.materials.iter().any(|material| material.name == painted_slot(*k))).collect()
}
