//! First hits of rays in the endless tiling, for images of the tile and for interreflection.

use glam::Vec3;

use super::periodic_grid::CellWalk;
use crate::geometry::PeriodicGrid;

/// The point at which a ray meets the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub triangle: u32,
    /// Position, not wrapped into the first tile.
    pub position: Vec3,
    /// Weights of the triangle's second and third corner.
    pub barycentric: [f32; 2],
}

impl PeriodicGrid {
    /// Highest z of the tile.
    pub fn top(&self) -> f32 {
        self.top
    }

    /// The first hit along the downward direction `to` from `origin`, or `None` if there is none down to `bottom`.
    pub fn nearest(&self, origin: Vec3, to: Vec3, bottom: f32) -> Option<Hit> {
        if to.z >= 0.0 {
            return None;
        }
        // Nothing is above the top, so the walk starts there.
        let start = ((self.top - origin.z) / to.z).max(0.0);
        let origin = origin + to * start;
        let max_distance = (bottom - origin.z) / to.z;
        let mut walk = CellWalk::new(self, origin.truncate(), to.truncate());
        let mut best: Option<(f32, Hit)> = None;
        let nearest_allowed = -1e-6 * self.tile_size.max_element();
        for _ in 0..MAX_CELLS {
            if walk.entered > max_distance {
                break;
            }
            let (cell, tile) = walk.cell();
            if self.z_max[cell] >= origin.z + max_distance * to.z {
                for &entry in self.entries(cell) {
                    let corners = self.copy_corners(entry, tile);
                    if let Some((t, v, w)) = intersect(origin, to, corners)
                        && t >= nearest_allowed
                        && best.is_none_or(|(nearest, _)| t < nearest)
                    {
                        let hit = Hit { triangle: entry.triangle, position: origin + to * t, barycentric: [v, w] };
                        best = Some((t, hit));
                    }
                }
            }
            if to.truncate().length_squared() < 1e-16 {
                break;
            }
            walk.advance();
            if best.is_some_and(|(nearest, _)| nearest <= walk.entered) {
                break;
            }
        }
        best.map(|(_, hit)| hit)
    }

    /// The first hit along any direction `to` from a point on the surface. The triangle `own` is ignored if the point
    /// lies on it. `bottom` is the lowest z of the tile. `None` if the ray leaves the tiling, or is nearly horizontal
    /// and far away.
    pub fn first_hit(&self, origin: Vec3, to: Vec3, own: u32, bottom: f32) -> Option<Hit> {
        let speed = to.truncate().length();
        let end = if to.z > 0.0 { self.top } else { bottom };
        let slab = if to.z == 0.0 { f32::INFINITY } else { ((end - origin.z) / to.z).max(0.0) };
        let limit = if speed > 1e-8 { MAX_TILES * self.tile_size.max_element() / speed } else { f32::INFINITY };
        // The slack finds a floor that lies exactly at the bottom.
        let max_distance = slab.min(limit) * (1.0 + 1e-4) + 1e-5 * self.tile_size.max_element();
        let mut walk = CellWalk::new(self, origin.truncate(), to.truncate());
        let mut best: Option<(f32, Hit)> = None;
        while walk.entered <= max_distance {
            let (cell, tile) = walk.cell();
            let lowest = if to.z > 0.0 { origin.z + walk.entered * to.z } else { f32::NEG_INFINITY };
            if self.z_max[cell] >= lowest {
                for &entry in self.entries(cell) {
                    let corners = self.copy_corners(entry, tile);
                    if let Some((t, v, w)) = intersect(origin, to, corners)
                        && t > 0.0
                        && best.is_none_or(|(nearest, _)| t < nearest)
                        && !(entry.triangle == own && self.lies_on(origin, corners))
                    {
                        let hit = Hit { triangle: entry.triangle, position: origin + to * t, barycentric: [v, w] };
                        best = Some((t, hit));
                    }
                }
            }
            if speed < 1e-8 {
                break;
            }
            walk.advance();
            if best.is_some_and(|(nearest, _)| nearest <= walk.entered) {
                break;
            }
        }
        best.map(|(_, hit)| hit)
    }
}

/// Maximum horizontal distance of a ray, in tiles.
const MAX_TILES: f32 = 64.0;
/// Maximum number of cells that a ray visits.
const MAX_CELLS: usize = 1 << 16;

/// Intersects a ray with a triangle from either side: distance along the ray and weights of the second and third corner
/// (Möller and Trumbore 1997).
fn intersect(origin: Vec3, to: Vec3, [a, b, c]: [Vec3; 3]) -> Option<(f32, f32, f32)> {
    let (ab, ac) = (b - a, c - a);
    let p = to.cross(ac);
    let determinant = ab.dot(p);
    let offset = origin - a;
    let v = offset.dot(p) / determinant;
    let q = offset.cross(ab);
    let w = to.dot(q) / determinant;
    // Triangles overlap slightly, so that no ray passes between neighbours.
    let inside = v >= -1e-5 && w >= -1e-5 && v + w <= 1.0 + 1e-5;
    // Excludes rays in the triangle's plane, for any unit of length. This test is last because square roots are slow.
    if !inside || determinant.abs() <= 1e-8 * ab.length() * ac.length() {
        return None;
    }
    Some((ac.dot(q) / determinant, v, w))
}
