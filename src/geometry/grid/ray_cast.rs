//! Exact visibility in the endless tiling by any-hit rays, the reference of the visibility algorithms.

use glam::Vec3;

use super::periodic_grid::CellWalk;
use crate::geometry::{Facets, PeriodicGrid};

impl PeriodicGrid {
    /// Returns whether any triangle but `own` blocks the ray from `origin` along the upward direction `to`.
    pub fn is_blocked(&self, origin: Vec3, to: Vec3, own: u32) -> bool {
        if to.z <= 0.0 {
            return true;
        }
        let plane = to.truncate();
        let speed = plane.length();
        let rise = to.z;
        let clearance = self.top - origin.z;
        if clearance <= 0.0 {
            return false;
        }
        let max_distance = clearance / rise;
        let mut walk = CellWalk::new(self, origin.truncate(), plane);
        for _ in 0..MIN_CELLS + 16 * (self.cells.x + self.cells.y) {
            if walk.entered > max_distance {
                return false;
            }
            let (cell, tile) = walk.cell();
            if self.z_max[cell] > origin.z + walk.entered * rise {
                for &entry in self.entries(cell) {
                    let corners = self.copy_corners(entry, tile);
                    if meets(origin, to, corners) && !(entry.triangle == own && self.lies_on(origin, corners)) {
                        return true;
                    }
                }
            }
            // A vertical ray stays in one cell.
            if speed < 1e-12 {
                return false;
            }
            walk.advance();
        }
        false
    }
}

/// Number of cells, in addition to those of sixteen tiles, after which a ray counts as unblocked. The limit bounds the
/// time of nearly horizontal rays.
const MIN_CELLS: i32 = 16_384;

impl PeriodicGrid {
    /// Returns whether `origin` lies on this copy of its facet's triangle. Other copies block the facet.
    pub(crate) fn lies_on(&self, origin: Vec3, [a, b, c]: [Vec3; 3]) -> bool {
        let normal = (b - a).cross(c - a);
        normal.dot(origin - a).abs() <= normal.length() * (10.0 * LIFT * self.tile_size.length())
    }
}

/// Returns whether the ray meets the triangle, from either side, in front of its origin. The signs of exact edge
/// functions of the sheared corners decide. Neighbours compute these from the same numbers, so no ray passes between.
fn meets(origin: Vec3, to: Vec3, corners: [Vec3; 3]) -> bool {
    // The shear makes the ray the z axis (`to.z > 0` always).
    let shear = to.truncate() / to.z;
    let [a, b, c] = corners.map(|p| {
        let q = p - origin;
        (q.truncate() - q.z * shear, q.z)
    });
    let edge = |p: glam::Vec2, q: glam::Vec2| f64::from(p.x) * f64::from(q.y) - f64::from(p.y) * f64::from(q.x);
    let (u, v, w) = (edge(b.0, c.0), edge(c.0, a.0), edge(a.0, b.0));
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return false;
    }
    let determinant = u + v + w;
    if determinant == 0.0 {
        return false;
    }
    let height = (u * f64::from(a.1) + v * f64::from(b.1) + w * f64::from(c.1)) / determinant;
    height > 0.0
}

/// Distance of ray origins from their facet, in units of the tile's diagonal.
pub(crate) const LIFT: f32 = 2e-6;

/// Ray origin of a facet, lifted off the reflecting side so that coplanar neighbours do not block it.
pub(crate) fn lifted_origin(facets: &Facets, facet: usize, tile_diagonal: f32) -> Vec3 {
    let geometric = facets.geometric_normals[facet];
    let side = if geometric.dot(facets.normals[facet]) < 0.0 { -geometric } else { geometric };
    facets.positions[facet] + side * (LIFT * tile_diagonal)
}

/// Returns whether a facet is visible along `to`: it faces the direction, and nothing blocks it. Exact.
pub fn is_facet_visible(grid: &PeriodicGrid, facets: &Facets, facet: usize, to: Vec3) -> bool {
    to.z > 0.0
        && facets.normals[facet].dot(to) > 0.0
        && !grid.is_blocked(lifted_origin(facets, facet, grid.tile_size.length()), to, facets.triangles[facet])
}

/// Ray origins of all facets, lifted off the reflecting side.
pub fn lifted_origins(facets: &Facets, tile_size: glam::Vec2) -> Vec<Vec3> {
    let diagonal = tile_size.length();
    (0..facets.len()).map(|s| lifted_origin(facets, s, diagonal)).collect()
}
