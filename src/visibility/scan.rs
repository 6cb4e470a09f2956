//! Exact blocked slopes of one facet along one azimuth, from the slice of the tiling by a vertical half plane.

use glam::{IVec2, Vec2, Vec3};

use super::MIN_SLOPE;
use super::slicer::{RotatedSlicer, WIDTH};
use crate::geometry::Facets;
use crate::geometry::grid::periodic_grid::CellWalk;
use crate::math::simd::{SimdF32x8, SimdTask, with_simd_f32x8};

/// Blocked slopes (tangents of the elevation), sorted and disjoint, within `[0, ∞]`.
#[derive(Debug, Default, Clone)]
pub(crate) struct BlockedSlopes {
    /// Everything below this slope is blocked.
    pub ground: f32,
    /// Blocked intervals above the ground.
    pub floating: Vec<(f32, f32)>,
    /// The slope from which on directions are behind the facet.
    behind_from: f32,
    /// Cells and triangles visited so far, over all scans.
    pub steps: u64,
    /// Number of truncated walks so far, over all scans.
    pub truncated: usize,
}

impl BlockedSlopes {
    /// The highest blocked slope: the horizon of a surface without overhangs.
    pub fn highest(&self) -> f32 {
        self.floating.last().map_or(self.ground, |interval| interval.1)
    }

    /// The floating intervals that begin in front of the facet.
    pub fn floating_faced(&self) -> impl Iterator<Item = (f32, f32)> {
        self.floating.iter().copied().filter(|interval| interval.0 < self.behind_from)
    }

    /// The slopes that need no further triangles: those below the ground, and the first floating interval.
    pub(crate) fn known(&self) -> KnownSlopes {
        let (low, high) = self.floating.first().copied().unwrap_or((f32::INFINITY, f32::NEG_INFINITY));
        KnownSlopes { ground: self.ground, low, high }
    }

    /// The highest slope up to `limit` that is not known to be blocked, or at most `ground` if none is. Only the first
    /// floating interval is considered.
    fn open_below(&self, limit: f32) -> f32 {
        match self.floating.first() {
            Some(&(low, high)) if high >= limit => low.min(limit),
            _ => limit,
        }
    }

    /// Starts with the directions behind the facet as blocked, so that walks end early. Directions within
    /// [`FACING_MARGIN`] behind the facet count as in front of it, because interpolated visibility must not jump there.
    fn start_from_facing(&mut self, normal: Vec3, along: Vec2) {
        self.floating.clear();
        self.behind_from = f32::INFINITY;
        let ahead = normal.truncate().dot(along) + FACING_MARGIN;
        self.ground = if ahead >= 0.0 {
            if normal.z < -1e-5 {
                self.behind_from = ahead / -normal.z;
                self.floating.push((self.behind_from, f32::INFINITY));
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
        // Neighbouring surfaces share edges, so gaps of the size of rounding errors are closed.
        let with_slack = |slope: f32| slope + 1e-5 * (1.0 + slope * slope);
        if low <= with_slack(self.ground) {
            self.ground = high;
            let mut absorbed = 0;
            while let Some(&(_, b)) = self.floating.get(absorbed).filter(|&&(a, _)| a <= with_slack(self.ground)) {
                self.ground = self.ground.max(b);
                absorbed += 1;
            }
            if absorbed > 0 {
                self.floating.drain(..absorbed);
            }
            return;
        }
        let first = self.floating.iter().take_while(|&&(_, b)| with_slack(b) < low).count();
        let mut end = first;
        while let Some(&(a, b)) = self.floating.get(end).filter(|&&(a, _)| a <= with_slack(high)) {
            (low, high) = (low.min(a), high.max(b));
            end += 1;
        }
        if end == first {
            self.floating.insert(first, (low, high));
        } else {
            self.floating[first] = (low, high);
            if end > first + 1 {
                self.floating.drain(first + 1..end);
            }
        }
    }
}

/// Slopes that are known to be blocked: up to `ground`, and from `low` to `high`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct KnownSlopes {
    pub ground: f32,
    pub low: f32,
    pub high: f32,
}

/// Sine of the angle behind a facet up to which its visibility is computed. It exceeds the step between azimuths.
pub(crate) const FACING_MARGIN: f32 = 0.3;

/// Minimum of the number of steps (cells and blocks of triangles) that a walk may take, besides the cells of sixteen
/// tiles. It bounds the time on tiles that are much higher than long, on which an unblocked walk would take millions of
/// steps. Farther triangles block only directions near the horizon. [`BlockedSlopes::truncated`] counts such walks.
const MIN_STEPS: usize = 16_384;

/// Scans every facet along the slicer's direction from its lifted origin and passes its blocked slopes to `found`.
/// Returns the number of truncated walks.
pub(crate) fn scan_all(
    slicer: &RotatedSlicer,
    facets: &Facets,
    origins: &[Vec3],
    found: &mut dyn FnMut(u32, &BlockedSlopes),
) -> usize {
    with_simd_f32x8(Scan { slicer, facets, origins, found })
}

/// The arguments of [`scan_all`].
struct Scan<'a> {
    slicer: &'a RotatedSlicer<'a>,
    facets: &'a Facets,
    origins: &'a [Vec3],
    found: &'a mut dyn FnMut(u32, &BlockedSlopes),
}

impl SimdTask for Scan<'_> {
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

impl RotatedSlicer<'_> {
    /// Fills `blocked` with the slopes that are blocked for a facet along the slicer's direction, and ignores the
    /// facet's `own` triangle.
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
        let (mut period_end, mut lowest_before) = (period, None);
        let mut steps_left = MIN_STEPS + 16 * (grid.cells.x + grid.cells.y) as usize;
        loop {
            // A cell at distance r blocks no slope above clearance / r.
            let open = blocked.open_below(clearance / walk.entered);
            if open <= blocked.ground.max(MIN_SLOPE) {
                blocked.insert(0.0, open);
                return;
            }
            // Along an axis or a diagonal the same surface returns after each period, farther away, and cannot rise above the
            // ground.
            if walk.entered > period_end {
                let Some((low, high)) = blocked.floating_faced().next() else { return };
                // If the copies of one period lower the interval without a gap, all farther ones do: they follow each other
                // at smaller relative distances.
                if open == low && lowest_before.is_some_and(|before| low < before && before <= high) {
                    blocked.insert(0.0, low);
                    return;
                }
                (period_end, lowest_before) = (period_end + period, Some(low));
            }
            let (cell, tile) = walk.cell();
            let (first, bounds) = self.blocks(cell);
            let steps = 1 + bounds.len();
            if steps_left < steps {
                blocked.truncated += 1;
                return;
            }
            steps_left -= steps;
            blocked.steps += 1;
            let (entered, left) = (walk.entered, walk.advance());
            let mut floor = origin.z + entered * blocked.ground;
            if grid.z_max[cell] <= floor {
                continue;
            }
            // Triangles entirely above this height block no slope that is still open.
            let ceiling = origin.z + left * open;
            let local_origin = origin - (tile.as_vec2() * grid.tile_size).extend(0.0);
            let eye = self.in_slice(local_origin);
            for (k, bounds) in bounds.iter().enumerate() {
                if bounds.highest() <= floor {
                    break;
                }
                let met = bounds.meets::<E>(eye.x, [floor, ceiling]);
                if met == 0 {
                    continue;
                }
                for (lane, low, high) in self.block(first + k).covered_slopes::<E>(eye, met, blocked.known()).lanes() {
                    blocked.steps += 1;
                    let entry = self.entries(cell)[WIDTH * k + lane];
                    if entry.triangle != own || !grid.lies_on(local_origin, grid.copy_corners(entry, IVec2::ZERO)) {
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
