//! All blocked elevations of one facet along one azimuth, exactly: a vertical half-plane slices the tile.

use glam::{IVec2, Vec2, Vec3};

use super::slicer::{TurnedSlicer, WIDTH};
use crate::geometry::Facets;
use crate::geometry::grid::periodic_grid::CellWalk;
use crate::math::simd::{InSimdF32x8, SimdF32x8, eight};

/// Blocked slopes (tangents of the elevation), sorted and disjoint, within `[0, ∞]`.
#[derive(Debug, Default, Clone)]
pub(crate) struct BlockedSlopes {
    /// Everything below this slope is blocked.
    pub ground: f32,
    /// Further blocked intervals above it.
    pub floating: Vec<(f32, f32)>,
    /// From this slope on the facet looks down on what comes: turned away, not blocked.
    overhead: f32,
    /// Cells and triangles looked at since this was made.
    pub work: u64,
    /// Walks that ended before all was known, since this was made.
    pub truncated: usize,
}

impl BlockedSlopes {
    /// The highest blocked slope: the horizon of a surface without overhangs.
    pub fn highest(&self) -> f32 {
        self.floating.last().map_or(self.ground, |interval| interval.1)
    }

    /// The floating intervals, without what the facet is merely turned away from.
    pub fn floating_unfaced(&self) -> impl Iterator<Item = (f32, f32)> {
        self.floating.iter().copied().filter(|interval| interval.0 < self.overhead)
    }

    /// What a triangle must rise above, or hang outside of, to matter: the ground, and the first floating interval.
    pub(crate) fn known(&self) -> Known {
        let (low, high) = self.floating.first().copied().unwrap_or((f32::INFINITY, f32::NEG_INFINITY));
        Known { ground: self.ground, low, high }
    }

    /// The highest slope up to `reach` that is still open, `ground` or less where none is (one floating interval is looked at).
    fn open_below(&self, reach: f32) -> f32 {
        match self.floating.first() {
            Some(&(low, high)) if high >= reach => low.min(reach),
            _ => reach,
        }
    }

    /// What a facet is turned away from: nothing else about it needs to be known, so walks end early. Directions within
    /// [`FACING_MARGIN`] behind the facet still count as faced: what is interpolated there must not jump.
    fn start_from_facing(&mut self, normal: Vec3, along: Vec2) {
        self.floating.clear();
        self.overhead = f32::INFINITY;
        let ahead = normal.truncate().dot(along) + FACING_MARGIN;
        self.ground = if ahead >= 0.0 {
            if normal.z < -1e-5 {
                self.overhead = ahead / -normal.z;
                self.floating.push((self.overhead, f32::INFINITY));
            }
            0.0
        } else if normal.z > 1e-5 {
            -ahead / normal.z
        } else {
            f32::INFINITY
        };
    }

    #[inline(never)]
    fn insert(&mut self, mut low: f32, mut high: f32) {
        if high <= self.ground {
            return;
        }
        // Facing surfaces share edges: a gap of rounding size is no gap.
        let reach = |slope: f32| slope + 1e-5 * (1.0 + slope * slope);
        if low <= reach(self.ground) {
            self.ground = high;
        } else {
            let first = self.floating.iter().take_while(|&&(_, b)| reach(b) < low).count();
            let mut end = first;
            while let Some(&(a, b)) = self.floating.get(end).filter(|&&(a, _)| a <= reach(high)) {
                (low, high) = (low.min(a), high.max(b));
                end += 1;
            }
            if end == first {
                self.floating.insert(first, (low, high));
            } else {
                self.floating[first] = (low, high);
                self.floating.drain(first + 1..end);
            }
        }
        let mut absorbed = 0;
        while let Some(&(_, b)) = self.floating.get(absorbed).filter(|&&(a, _)| a <= reach(self.ground)) {
            self.ground = self.ground.max(b);
            absorbed += 1;
        }
        if absorbed > 0 {
            self.floating.drain(..absorbed);
        }
    }
}

/// Slopes of which nothing new can be learned: up to `ground`, and from `low` to `high`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    pub ground: f32,
    pub low: f32,
    pub high: f32,
}

/// Sine of how far behind a facet its visibility is still computed: more than the step between azimuths.
pub(crate) const FACING_MARGIN: f32 = 0.3;

/// The lowest elevation that is resolved: a walk ends where what is left could block no more than this slope.
const LOWEST_SLOPE: f32 = 0.005;

/// Cells and blocks of triangles that any walk may look at, besides the cells of sixteen tiles: on tiles a hundred times as
/// high as they are long a walk that nothing stops would take millions. What lies beyond blocks only directions low over
/// the horizon (2° for pyramids of 100 tiles) and is left out; [`BlockedSlopes::truncated`] counts such walks.
const MIN_LOOKS: usize = 16_384;

/// Scans every facet along the slicer's direction from its lifted origin, and hands each with what blocks it to `found`;
/// returns how many walks ended before all was known.
pub(crate) fn scan_all(
    slicer: &TurnedSlicer,
    facets: &Facets,
    origins: &[Vec3],
    found: &mut dyn FnMut(u32, &BlockedSlopes),
) -> usize {
    eight(Scan { slicer, facets, origins, found })
}

/// The arguments of [`scan_all`].
struct Scan<'a> {
    slicer: &'a TurnedSlicer<'a>,
    facets: &'a Facets,
    origins: &'a [Vec3],
    found: &'a mut dyn FnMut(u32, &BlockedSlopes),
}

impl InSimdF32x8 for Scan<'_> {
    type Output = usize;

    #[inline(always)]
    fn with<E: SimdF32x8>(self) -> usize {
        let mut blocked = BlockedSlopes::default();
        for facet in self.slicer.order(self.facets) {
            let at = facet as usize;
            self.slicer.scan::<E>(self.origins[at], self.facets.normals[at], self.facets.triangles[at], &mut blocked);
            (self.found)(facet, &blocked);
        }
        blocked.truncated
    }
}

impl TurnedSlicer<'_> {
    /// Fills `blocked` with what a facet does not see along the slicer's direction; its `own` triangle is ignored.
    #[inline(always)]
    pub(crate) fn scan<E: SimdF32x8>(&self, origin: Vec3, normal: Vec3, own: u32, blocked: &mut BlockedSlopes) {
        let (grid, along) = (self.grid, self.along);
        blocked.start_from_facing(normal, along);
        if blocked.ground == f32::INFINITY || grid.cancel.is_set() {
            return;
        }
        let clearance = grid.top - origin.z;
        if clearance <= 0.0 {
            return;
        }
        let mut walk = CellWalk::new(grid, origin.truncate(), along);
        let period = grid.period_along(along);
        let mut looks = MIN_LOOKS + 16 * (grid.cells.x + grid.cells.y) as usize;
        loop {
            // What a cell at distance r can block at most: clearance / r.
            let open = blocked.open_below(clearance / walk.entered);
            if open <= blocked.ground.max(LOWEST_SLOPE) {
                return;
            }
            // Along an axis all comes back after one tile, only further away: what did not rise above the ground never will.
            if walk.entered > period && blocked.floating_unfaced().next().is_none() {
                return;
            }
            let (cell, tile) = walk.cell();
            let (first, extents) = self.blocks(cell);
            let costs = 1 + extents.len();
            if looks < costs {
                blocked.truncated += 1;
                return;
            }
            looks -= costs;
            blocked.work += 1;
            let (entered, left) = (walk.entered, walk.advance());
            let mut floor = origin.z + entered * blocked.ground;
            if grid.z_max[cell] <= floor {
                continue;
            }
            // What stands higher throughout blocks nothing in this cell that is still open.
            let ceiling = origin.z + left * open;
            let home = origin - (tile.as_vec2() * grid.tile_size).extend(0.0);
            let eye = self.seen(home);
            for (k, extent) in extents.iter().enumerate() {
                if extent.highest() <= floor {
                    break;
                }
                let met = extent.meets::<E>(eye.x, [floor, ceiling]);
                if met == 0 {
                    continue;
                }
                for (lane, low, high) in self.block(first + k).cut::<E>(eye, met, blocked.known()).lanes() {
                    blocked.work += 1;
                    let entry = self.entries(cell)[WIDTH * k + lane];
                    if entry.triangle != own || !grid.lies_on(home, grid.copy_corners(entry, IVec2::ZERO)) {
                        blocked.insert(low, high);
                    }
                }
                if blocked.ground == f32::INFINITY {
                    return;
                }
                floor = origin.z + entered * blocked.ground;
            }
        }
    }
}
