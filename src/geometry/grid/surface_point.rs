//! Points of the surface where rays meet it.

use glam::{Vec2, Vec3};

use super::nearest::Hit;
use super::ray_cast::LIFT;
use crate::geometry::TileMesh;

/// A point of the surface, with what its reflection depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Position in the first tile.
    pub position: Vec3,
    /// The origin of rays from this point, lifted off its upper side.
    pub origin: Vec3,
    /// The interpolated normal, or that of the triangle.
    pub normal: Vec3,
    pub geometric_normal: Vec3,
    pub triangle: u32,
    pub slot: u16,
}

impl TileMesh {
    /// The point of the surface that a ray meets.
    pub fn surface_point(&self, hit: &Hit) -> SurfacePoint {
        let triangle = hit.triangle as usize;
        let geometric_normal = self.geometric_normal(triangle);
        let [v, w] = hit.barycentric;
        let smooth = self.corner_normals.as_ref().and_then(|normals| {
            let [a, b, c] = normals[triangle];
            (a * (1.0 - v - w) + b * v + c * w).try_normalize()
        });
        let flat = hit.position.truncate();
        let position = (flat - self.size * (flat / self.size).floor()).clamp(Vec2::ZERO, self.size);
        let position = position.extend(hit.position.z);
        SurfacePoint {
            position,
            origin: position + geometric_normal * (LIFT * self.size.length()),
            normal: smooth.unwrap_or(geometric_normal),
            geometric_normal,
            triangle: hit.triangle,
            slot: self.slot_at(triangle, flat),
        }
    }
}
