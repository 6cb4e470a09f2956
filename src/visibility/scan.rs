//! All blocked elevations of one facet along one azimuth, exactly: a vertical half-plane slices the tile.

use glam::{Vec2, Vec3};

use super::PeriodicGrid;
use super::periodic_grid::CellWalk;

/// Blocked slopes (tangents of the elevation), sorted and disjoint, within `[0, ∞]`.
#[derive(Debug, Default, Clone)]
pub(super) struct BlockedSlopes {
    /// Everything below this slope is blocked.
    pub ground: f32,
    /// Further blocked intervals above it.
    pub floating: Vec<(f32, f32)>,
    /// Cells and triangles looked at since this was made.
    pub work: u64,
}

impl BlockedSlopes {
    /// The highest blocked slope: the horizon of a surface without overhangs.
    pub fn highest(&self) -> f32 {
        self.floating.last().map_or(self.ground, |interval| interval.1)
    }

    /// Is this slope blocked?
    pub fn contains(&self, slope: f32) -> bool {
        slope <= self.ground || self.floating.iter().any(|&(low, high)| low <= slope && slope <= high)
    }

    /// What a facet is turned away from: nothing else about it needs to be known, so walks end early. Directions within
    /// [`FACING_MARGIN`] behind the facet still count as faced: what is interpolated there must not jump.
    fn start_from_facing(&mut self, normal: Vec3, along: Vec2) {
        self.floating.clear();
        let ahead = normal.truncate().dot(along) + FACING_MARGIN;
        self.ground = if ahead >= 0.0 {
            if normal.z < -1e-5 {
                self.floating.push((ahead / -normal.z, f32::INFINITY));
            }
            0.0
        } else if normal.z > 1e-5 {
            -ahead / normal.z
        } else {
            f32::INFINITY
        };
    }

    fn insert(&mut self, mut low: f32, mut high: f32) {
        if high <= self.ground {
            return;
        }
        // Facing surfaces share edges: a gap of rounding size is no gap.
        let reach = |slope: f32| slope + 1e-5 * (1.0 + slope * slope);
        if low <= reach(self.ground) {
            self.ground = high;
        } else {
            self.floating.retain(|&(a, b)| {
                let apart = a > reach(high) || low > reach(b);
                if !apart {
                    low = low.min(a);
                    high = high.max(b);
                }
                apart
            });
            let at = self.floating.partition_point(|&(a, _)| a < low);
            self.floating.insert(at, (low, high));
        }
        while let Some(&(a, b)) = self.floating.first() {
            if a > reach(self.ground) {
                break;
            }
            self.ground = self.ground.max(b);
            self.floating.remove(0);
        }
    }
}

/// Sine of how far behind a facet its visibility is still computed: more than the step between azimuths.
pub(super) const FACING_MARGIN: f32 = 0.3;

/// The lowest elevation that is resolved: a walk ends where what is left could block no more than this slope.
const LOWEST_SLOPE: f32 = 0.005;

impl PeriodicGrid {
    /// Fills `blocked` with what a facet does not see along the unit plane direction `along`; `own` is ignored.
    pub(super) fn scan(&self, origin: Vec3, normal: Vec3, along: Vec2, own: u32, blocked: &mut BlockedSlopes) {
        blocked.start_from_facing(normal, along);
        if blocked.ground == f32::INFINITY || self.cancel.is_set() {
            return;
        }
        let clearance = self.top - origin.z;
        if clearance <= 0.0 {
            return;
        }
        let mut walk = CellWalk::new(self, origin.truncate(), along);
        // What a cell at distance r can block at most: clearance / r.
        while walk.entered * blocked.ground.max(LOWEST_SLOPE) < clearance {
            let (cell, tile) = walk.cell();
            blocked.work += 1;
            if self.z_max[cell] - origin.z > walk.entered * blocked.ground {
                blocked.work += self.entries(cell).len() as u64;
                for &entry in self.entries(cell) {
                    let corners = self.copy_corners(entry, tile);
                    if entry.triangle == own && self.lies_on(origin, corners) {
                        continue;
                    }
                    if let Some((low, high)) = slice(origin, along, corners) {
                        blocked.insert(low, high);
                    }
                }
                if blocked.ground == f32::INFINITY {
                    return;
                }
            }
            walk.advance();
        }
    }
}

/// The slopes that a triangle covers in the vertical half-plane from `origin` along `along`; none below the horizon.
fn slice(origin: Vec3, along: Vec2, corners: [Vec3; 3]) -> Option<(f32, f32)> {
    let across = along.perp();
    // (distance across the plane, distance along it, height above the origin)
    let [a, b, c] = corners.map(|p| {
        let q = p - origin;
        Vec3::new(across.dot(q.truncate()), along.dot(q.truncate()), q.z)
    });
    let side = |p: Vec3| p.x >= 0.0;
    if side(a) == side(b) && side(b) == side(c) {
        return None;
    }
    // The corner alone on its side; the two edges from it cross the plane.
    let (apex, p, q) = if side(b) == side(c) {
        (a, b, c)
    } else if side(a) == side(c) {
        (b, c, a)
    } else {
        (c, a, b)
    };
    let cross = |to: Vec3| {
        let t = apex.x / (apex.x - to.x);
        Vec2::new(apex.y + (to.y - apex.y) * t, apex.z + (to.z - apex.z) * t)
    };
    let (mut near, mut far) = (cross(p), cross(q));
    if near.x > far.x {
        std::mem::swap(&mut near, &mut far);
    }
    if far.x <= 0.0 {
        return None;
    }
    let slope = |p: Vec2| p.y / p.x;
    let first = if near.x > 0.0 {
        slope(near)
    } else {
        // The segment passes above or below the origin: at distance 0 its slope is infinite.
        let over = near.y + (far.y - near.y) * (-near.x / (far.x - near.x));
        if over > 0.0 { f32::INFINITY } else { f32::NEG_INFINITY }
    };
    let last = slope(far);
    let (low, high) = if first <= last { (first, last) } else { (last, first) };
    (high > 0.0).then_some((low.max(0.0), high))
}
