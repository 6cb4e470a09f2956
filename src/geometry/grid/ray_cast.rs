//! Exact visibility in the endless tiling by any-hit rays, the reference of the visibility algorithms.

use glam::{Vec2, Vec3};

use crate::geometry::{Facets, PeriodicGrid};

impl PeriodicGrid {
    /// Returns whether any triangle but `own` blocks the ray from `origin` along the upward direction `to`.
    pub fn is_blocked(&self, origin: Vec3, to: Vec3, own: u32) -> bool {
        if to.z <= 0.0 {
            return true;
        }
        let clearance = self.top - origin.z;
        // The slack finds a ceiling that lies exactly at the top.
        clearance > 0.0 && self.rays().is_blocked(origin, to, own, clearance / to.z * (1.0 + 1e-5))
    }

    /// As [`lies_on`].
    pub(crate) fn lies_on(&self, origin: Vec3, corners: [Vec3; 3]) -> bool {
        lies_on(origin, corners, self.tile_size)
    }
}

/// Returns whether `origin` lies on this copy of its facet's triangle. Other copies block the facet.
pub(crate) fn lies_on(origin: Vec3, [a, b, c]: [Vec3; 3], tile_size: Vec2) -> bool {
    let normal = (b - a).cross(c - a);
    normal.dot(origin - a).abs() <= normal.length() * (10.0 * LIFT * tile_size.length())
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
pub fn lifted_origins(facets: &Facets, tile_size: Vec2) -> Vec<Vec3> {
    let diagonal = tile_size.length();
    (0..facets.len()).map(|s| lifted_origin(facets, s, diagonal)).collect()
}
