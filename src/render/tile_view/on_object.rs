//! The transition from the object to its tiles: where a tile is many pixels wide, its own geometry replaces the
//! effective BRDF. Both have the same radiance on average over a tile, so the transition does not change the
//! brightness.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::filtered::Corrections;
use super::{ShadedMaterials, TileScene};
use crate::base::{Cancel, Result};
use crate::geometry::Hit;
use crate::math::directions::half_vector;
use crate::render::image::shading_points::ShadingPoints;
use crate::render::{CameraView, Image, ObjectMesh, RenderInput};

/// A tile's shorter side, in radii of the object: so small that no tile is visible if the whole object fits the image.
pub const TILE_RADII: f32 = 0.012;
/// Size of a tile in pixels at which its geometry starts to blend in, and at which it replaces the effective BRDF.
const BLEND_PIXELS: [f32; 2] = [10.0, 28.0];
/// Size of a tile in pixels below which no colour map leaves structure in a pixel.
const LEAST_FILTERED: f32 = 0.125;

/// Returns the blend weight (0 to 1) of the tile's geometry for a tile of this size in pixels.
fn weight(pixels: f32) -> f32 {
    let t = ((pixels - BLEND_PIXELS[0]) / (BLEND_PIXELS[1] - BLEND_PIXELS[0])).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Returns whether the nearest tiles that an object can have in a view are large enough to be visible. Under a colour map
/// they are so from much further away, because every pixel filters them.
pub fn tiles_are_visible(view: &CameraView, mesh: &ObjectMesh, has_color_map: bool) -> bool {
    let radius = mesh.bounds.radius;
    let nearest = ((view.eye - mesh.bounds.center).length() - radius).max(view.near);
    let pixels = TILE_RADII * radius / (view.pixel_extent() * nearest);
    if has_color_map { pixels > LEAST_FILTERED } else { weight(pixels) > 0.0 }
}

impl TileScene {
    /// Blends the tile's own geometry into an image rendered from `input`. It returns at once if no tile is large
    /// enough to be visible. Under a colour map, every pixel shows the low-passed tile instead
    /// ([`FilteredTile::shade_into`](super::filtered::FilteredTile::shade_into)), with these corrections.
    ///
    /// # Errors
    /// An invalid camera, or [`crate::base::Error::Cancelled`].
    pub fn blend_into(
        &self,
        image: &mut Image,
        input: &RenderInput,
        materials: ShadedMaterials<'_>,
        corrections: Corrections,
        cancel: &Cancel,
    ) -> Result<()> {
        if let Some(filtered) = self.filtered() {
            return filtered.shade_into(image, input, materials, corrections, cancel);
        }
        let view = CameraView::new(input.camera, input.mesh, input.size)?;
        if !tiles_are_visible(&view, input.mesh, false) {
            return Ok(());
        }
        let radius = input.mesh.bounds.radius;
        let points = ShadingPoints::new(input.mesh, &view, 1);
        let Some(anchor) = anchor(input, &view, &points) else { return Ok(()) };
        let visibility = input
            .occluder
            .map(|occluder| occluder.visible_lights(input.mesh, &points, input.lights, view.eye, input.shadow_cache));
        let scale = self.mesh.size.min_element() / (TILE_RADII * radius);
        let shaded: Vec<(f32, Vec3)> = (0..points.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|point| {
                let (position, z, x) = (points.positions[point], points.normals[point], points.tangents[point]);
                let depth = (view.eye - position).length();
                let weight = weight(TILE_RADII * radius / (view.pixel_extent() * depth));
                if weight == 0.0 || cancel.is_set() {
                    return (0.0, Vec3::ZERO);
                }
                let y = z.cross(x);
                let local = |d: Vec3| Vec3::new(d.dot(x), d.dot(y), d.dot(z));
                let o = local((view.eye - position) / depth);
                let Some(hit) = self.visible_through(anchor.tile_coordinates(position) * scale, o) else {
                    return (weight, Vec3::ZERO);
                };
                let visible_lights = input.lights.iter().enumerate().filter(|(k, light)| {
                    light.direction.dot(z) > 0.0
                        && visibility.as_ref().is_none_or(|visibility| visibility.is_lit(point, *k))
                });
                let (directions, irradiances): (Vec<Vec3>, Vec<Vec3>) =
                    visible_lights.map(|(_, light)| (local(light.direction), light.irradiance)).unzip();
                // Light that facets send to each other is soft: it has its mean over the tile everywhere.
                let mut bounced = vec![Vec3::ZERO; directions.len()];
                input.reflectance.eval_bounced(&directions, o, &mut bounced);
                let radiance = directions
                    .iter()
                    .zip(bounced.iter().zip(&irradiances))
                    .map(|(i, (bounced, irradiance))| (self.reflected(&hit, *i, o, materials) + *bounced) * *irradiance)
                    .sum();
                (weight, radiance)
            })
            .collect();
        cancel.check()?;
        for (&pixel, (weight, radiance)) in points.pixels.iter().zip(shaded) {
            let pixel = &mut image.pixels[pixel as usize];
            *pixel = pixel.lerp(radiance, weight);
        }
        Ok(())
    }

    /// Returns the surface point that is visible from `o` through a point of the plane z = 0.
    pub(super) fn visible_through(&self, point: Vec2, o: Vec3) -> Option<Hit> {
        let o = Vec3::new(o.x, o.y, o.z.max(0.02)).try_normalize()?;
        // Small coordinates keep rays accurate.
        let inside = point - (point / self.mesh.size).floor() * self.mesh.size;
        let start = inside.extend(0.0) + o * ((self.grid.top() + 1e-4) / o.z);
        self.grid.nearest(start, -o, self.bottom)
    }

    /// Returns `f_r (n·i)+ V(i)` of a point [1/sr].
    pub(super) fn reflected(&self, hit: &Hit, i: Vec3, o: Vec3, materials: ShadedMaterials<'_>) -> Vec3 {
        let (normal, geometric) = self.normals(hit, o);
        let slot = usize::from(self.mesh.slot_at(hit.triangle as usize, hit.position.truncate()));
        let material = materials.material_of_slot.get(slot).and_then(|index| materials.materials.get(*index));
        let Some(material) = material else { return Vec3::ZERO };
        if normal.dot(i) <= 0.0 || !self.is_visible(hit, geometric, i) {
            return Vec3::ZERO;
        }
        let angles = crate::brdf::LobeAngles::new(normal, i, o, half_vector(i, o));
        let weight = self.mesh.color.at(hit.position, normal, self.mesh.size) * material.color;
        material.brdf.f_cos(&angles) / normal.dot(o).max(1e-3) * weight
    }
}

/// The vertex nearest to the middle of the image; tiles are laid out on its tangent plane.
pub(super) struct Anchor {
    origin: Vec3,
    x: Vec3,
    y: Vec3,
}

impl Anchor {
    fn tile_coordinates(&self, position: Vec3) -> Vec2 {
        let offset = position - self.origin;
        Vec2::new(offset.dot(self.x), offset.dot(self.y))
    }

    /// As [`Anchor::tile_coordinates`], as long as the distance of the point: it stretches a curved surface less.
    pub(super) fn along_surface(&self, position: Vec3) -> Vec2 {
        self.tile_coordinates(position).normalize_or_zero() * position.distance(self.origin)
    }
}

pub(super) fn anchor(input: &RenderInput, view: &CameraView, points: &ShadingPoints) -> Option<Anchor> {
    let [width, height] = view.size.map(|side| side as f32);
    let from_middle = |point: &usize| {
        let pixel = points.pixels[*point] as usize;
        let at = Vec2::new((pixel % view.size[0]) as f32, (pixel / view.size[0]) as f32);
        at.distance_squared(Vec2::new(width, height) / 2.0)
    };
    let middle = (0..points.len()).min_by(|a, b| from_middle(a).total_cmp(&from_middle(b)))?;
    let triangle = input.mesh.triangles[points.triangles[middle] as usize];
    let vertex = triangle.into_iter().min_by(|a, b| {
        let distance = |vertex: &u32| input.mesh.positions[*vertex as usize].distance_squared(points.positions[middle]);
        distance(a).total_cmp(&distance(b))
    })? as usize;
    let (z, x) = (input.mesh.normals[vertex], input.mesh.tangents[vertex]);
    Some(Anchor { origin: input.mesh.positions[vertex], x, y: z.cross(x) })
}
