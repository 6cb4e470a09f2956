//! Shading of one visible point of the tile.

use glam::Vec3;

use super::{ShadedMaterials, TileScene, TileShading};
use crate::brdf::Material;
use crate::geometry::Hit;
use crate::math::directions::half_vector;

/// Height of the start of a ray above the surface, as a fraction of the tile's size.
const LIFT: f32 = 1e-4;

/// Reflectance of clay.
const CLAY: f32 = 0.5;

/// The material of a slot.
fn material_of<'a>(materials: &ShadedMaterials<'a>, slot: u16) -> Option<&'a Material> {
    materials.materials.get(*materials.material_of_slot.get(usize::from(slot))?)
}

impl TileScene {
    /// Returns the unit normal that reflects and the unit geometric normal, both on the viewer's side.
    pub fn normals(&self, hit: &Hit, to_viewer: Vec3) -> (Vec3, Vec3) {
        let index = hit.triangle as usize;
        let geometric = self.mesh.geometric_normal(index);
        let [v, w] = hit.barycentric;
        let smooth = self.mesh.corner_normals.as_ref().and_then(|normals| {
            let [a, b, c] = normals[index];
            (a * (1.0 - v - w) + b * v + c * w).try_normalize()
        });
        let side = if geometric.dot(to_viewer) < 0.0 { -1.0 } else { 1.0 };
        (smooth.unwrap_or(geometric) * side, geometric * side)
    }

    /// Returns whether a direction above the horizon is visible from a point.
    pub fn is_visible(&self, hit: &Hit, geometric: Vec3, to: Vec3) -> bool {
        let origin = hit.position + geometric * (LIFT * self.mesh.size.max_element());
        to.z > 0.0 && geometric.dot(to) > 0.0 && !self.grid.is_blocked(origin, to, hit.triangle)
    }

    pub(super) fn shade(
        &self,
        hit: &Hit,
        to_viewer: Vec3,
        shading: &TileShading,
        materials: &ShadedMaterials<'_>,
    ) -> Vec3 {
        let (normal, geometric) = self.normals(hit, to_viewer);
        let weight = self.mesh.color.at(hit.position, normal, self.mesh.size);
        let slot = self.mesh.slot_at(hit.triangle as usize, hit.position.truncate());
        let material = || material_of(materials, slot);
        match shading {
            TileShading::Clay => Vec3::splat(CLAY * self.clay_irradiance(hit, normal, geometric)),
            TileShading::Materials(lights) => {
                let Some(material) = material() else { return Vec3::ZERO };
                let shade = |light: &crate::render::DirectionalLight| {
                    let i = light.direction;
                    if normal.dot(i) <= 0.0 || !self.is_visible(hit, geometric, i) {
                        return Vec3::ZERO;
                    }
                    let angles = crate::brdf::LobeAngles::new(normal, i, to_viewer, half_vector(i, to_viewer));
                    let cosine = normal.dot(to_viewer).max(1e-3);
                    light.irradiance * material.brdf.f_cos(&angles) / cosine
                };
                lights.iter().map(shade).sum::<Vec3>() * material.color * weight
            }
            TileShading::Contribution { i, o, scale } => {
                let grey = Vec3::splat(0.05 + 0.1 * normal.z.max(0.0));
                let Some(material) = material() else { return grey };
                if normal.dot(*i) <= 0.0 || normal.dot(*o) <= 0.0 {
                    return grey;
                }
                if !self.is_visible(hit, geometric, *i) || !self.is_visible(hit, geometric, *o) {
                    return grey;
                }
                let value = material.brdf.f(normal, *i, *o) * material.color * weight;
                let heat = (value.dot(crate::brdf::LUMINANCE) / scale.max(1e-9)).sqrt().min(1.0);
                grey + Vec3::new(heat, 0.55 * heat * heat, 0.2 * heat.powi(4))
            }
            TileShading::Normals => (normal + 1.0) * 0.5,
            TileShading::Visibility(to) => {
                let tone = if geometric.dot(*to) <= 0.0 {
                    Vec3::splat(0.25)
                } else if self.is_visible(hit, geometric, *to) {
                    Vec3::new(0.18, 0.72, 0.3)
                } else {
                    Vec3::new(0.8, 0.16, 0.12)
                };
                tone * (0.45 + 0.55 * normal.z.max(0.0))
            }
        }
    }

    /// Returns the irradiance over π of a shadowed light from the upper left, a weak fill light and a sky.
    fn clay_irradiance(&self, hit: &Hit, normal: Vec3, geometric: Vec3) -> f32 {
        let key = Vec3::new(-0.68, 0.52, 0.517);
        let fill = Vec3::new(0.6, -0.2, 0.775);
        let lit = if normal.dot(key) > 0.0 && self.is_visible(hit, geometric, key) { normal.dot(key) } else { 0.0 };
        1.25 * lit + 0.16 * normal.dot(fill).max(0.0) + 0.14 * (0.5 + 0.5 * normal.z)
    }
}
