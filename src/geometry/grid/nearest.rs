//! First hits of rays in the endless tiling, for images of the tile and for interreflection.

use glam::{IVec2, Vec3};

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
        if to.truncate().length_squared() < 1e-16 * to.length_squared() {
            return self.nearest_below(origin, to, bottom);
        }
        // Nothing is above the top, so the ray starts there. It starts a little earlier, because the surface may be there.
        let lift = 1e-5 * self.tile_size.max_element();
        let above = (self.top - origin.z) / to.z;
        let mut start = origin + to * above.max(0.0);
        if above > 0.0 {
            start.z = self.top;
        }
        let end = (bottom - start.z) / to.z * (1.0 + 1e-5) + 2.0 * lift;
        (end > 0.0).then(|| self.rays().first_hit(start - to * lift, to, u32::MAX, end))?
    }

    /// [`PeriodicGrid::nearest`] for a vertical ray, which stays in one cell.
    fn nearest_below(&self, origin: Vec3, to: Vec3, bottom: f32) -> Option<Hit> {
        let origin = origin + to * ((self.top - origin.z) / to.z).max(0.0);
        let max_distance = (bottom - origin.z) / to.z;
        if max_distance < 0.0 {
            return None;
        }
        let slack = 1e-6 * self.tile_size.max_element();
        let allowed = -slack..=max_distance * (1.0 + 1e-5) + slack;
        let cell = (origin.truncate() / self.cell_size).floor().as_ivec2();
        let tile = IVec2::new(cell.x.div_euclid(self.cells.x), cell.y.div_euclid(self.cells.y));
        let local = cell - tile * self.cells;
        let mut best: Option<(f32, Hit)> = None;
        for &entry in self.entries((local.y * self.cells.x + local.x) as usize) {
            if let Some((t, v, w)) = intersect(origin, to, self.copy_corners(entry, tile))
                && allowed.contains(&t)
                && best.is_none_or(|(nearest, _)| t < nearest)
            {
                let hit = Hit { triangle: entry.triangle, position: origin + to * t, barycentric: [v, w] };
                best = Some((t, hit));
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
        self.rays().first_hit(origin, to, own, max_distance)
    }
}

/// Maximum horizontal distance of a ray, in tiles.
const MAX_TILES: f32 = 64.0;

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
