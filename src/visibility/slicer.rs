//! Slopes that the triangles of a cell cover in a vertical half plane, as seen from a point, eight triangles at a time.

use glam::{IVec2, Vec2, Vec3};

use super::scan::KnownSlopes;
use crate::geometry::Facets;
use crate::geometry::PeriodicGrid;
use crate::geometry::grid::cell_lists::CellEntry;
use crate::math::simd::{F32x8Array, SimdF32x8};

/// Number of triangles per block.
pub(crate) const WIDTH: usize = 8;

/// A packet of eight entries of a cell, in the coordinates of the cell's tile copy. Lanes without an entry are below any height.
#[derive(Debug, Clone)]
struct Block {
    x: [F32x8Array; 3],
    y: [F32x8Array; 3],
    z: [F32x8Array; 3],
    z_min: F32x8Array,
    z_max: F32x8Array,
}

/// A periodic grid with its triangles in blocks, for vertical slices.
#[derive(Debug)]
pub(crate) struct Slicer<'a> {
    grid: &'a PeriodicGrid,
    starts: Vec<u32>,
    blocks: Vec<Block>,
}

impl<'a> Slicer<'a> {
    pub fn new(grid: &'a PeriodicGrid) -> Self {
        let cells = grid.z_max.len();
        let (mut starts, mut blocks) = (Vec::with_capacity(cells + 1), Vec::new());
        starts.push(0);
        for cell in 0..cells {
            blocks.extend(grid.entries(cell).chunks(WIDTH).map(|entries| Block::new(grid, entries)));
            starts.push(blocks.len() as u32);
        }
        Self { grid, starts, blocks }
    }

    /// Prepares slices along the unit plane direction `along`.
    pub fn rotated(&self, along: Vec2) -> RotatedSlicer<'_> {
        let (bounds, blocks) = self.blocks.iter().map(|block| block.rotated(along)).unzip();
        RotatedSlicer { grid: self.grid, along, starts: &self.starts, bounds, blocks }
    }
}

/// A packet of eight triangles of a cell, with their corners in order of distance across the slices, and the edges between these as
/// functions of that distance.
#[derive(Debug, Clone)]
pub(crate) struct RotatedBlock {
    first: F32x8Array,
    middle: F32x8Array,
    /// Edges from the first corner to the last, from the first to the middle one, and from the middle one to the last.
    edges: [Edge; 3],
}

/// Bounds of eight triangles, for a test whether a slice meets them. They are stored apart so that more fit in caches.
#[derive(Debug, Clone)]
pub(crate) struct BlockBounds {
    first: F32x8Array,
    last: F32x8Array,
    z_min: F32x8Array,
    z_max: F32x8Array,
}

impl BlockBounds {
    /// The highest z of this block and of the later blocks of the cell.
    #[inline(always)]
    pub fn highest(&self) -> f32 {
        self.z_max.0[0].x
    }

    /// Bit mask of the lanes that a slice at a distance `across` meets and that reach above the height `floor` and
    /// below `ceiling`.
    #[inline(always)]
    pub fn meets<E: SimdF32x8>(&self, across: f32, [floor, ceiling]: [f32; 2]) -> u32 {
        let at = E::splat(across);
        let between = E::both(E::of(&self.first).less(at), E::of(&self.z_min).less(E::splat(ceiling)));
        let high = E::both(between, E::splat(floor).less(E::of(&self.z_max)));
        E::bits(high) & !E::bits(E::of(&self.last).less(at))
    }
}

/// A packet of eight edges. Each begins at the corner that comes first across the slices, so neighbours compute the same edge.
#[derive(Debug, Clone, Copy)]
struct Edge {
    along: F32x8Array,
    up: F32x8Array,
    /// Derivatives of both with the distance across.
    rates: [F32x8Array; 2],
}

/// A grid prepared for slices along one direction.
#[derive(Debug)]
pub(crate) struct RotatedSlicer<'a> {
    pub grid: &'a PeriodicGrid,
    pub along: Vec2,
    starts: &'a [u32],
    bounds: Vec<BlockBounds>,
    blocks: Vec<RotatedBlock>,
}

impl RotatedSlicer<'_> {
    /// Orders the facets so that consecutive ones walk over nearly the same cells.
    pub fn order(&self, facets: &Facets) -> Vec<u32> {
        let width = self.grid.cell_size.min_element();
        let mut order: Vec<(i32, u32)> = (0..facets.len() as u32)
            .map(|facet| ((self.along.perp_dot(facets.positions[facet as usize].truncate()) / width) as i32, facet))
            .collect();
        order.sort_unstable();
        order.into_iter().map(|(_, facet)| facet).collect()
    }

    /// The blocks of a cell: the index of the first one, and the bounds of all.
    pub fn blocks(&self, cell: usize) -> (usize, &[BlockBounds]) {
        let (first, end) = (self.starts[cell] as usize, self.starts[cell + 1] as usize);
        (first, &self.bounds[first..end])
    }

    /// The block with an index.
    #[inline(always)]
    pub fn block(&self, index: usize) -> &RotatedBlock {
        &self.blocks[index]
    }

    /// The entries of a cell, which are the lanes of its blocks.
    pub fn entries(&self, cell: usize) -> &[CellEntry] {
        self.grid.entries(cell)
    }

    /// Slice coordinates of a point: distance across the slices, distance along them, and height.
    pub fn in_slice(&self, point: Vec3) -> Vec3 {
        Vec3::new(self.along.perp_dot(point.truncate()), self.along.dot(point.truncate()), point.z)
    }
}

/// Slopes that eight triangles cover. Lanes outside the mask are undefined.
pub(crate) struct CoveredSlopes<E> {
    low: E,
    high: E,
    lanes: u32,
}

impl<E: SimdF32x8> CoveredSlopes<E> {
    /// Lanes that cover slopes, as `(lane, low, high)`.
    #[inline(always)]
    pub fn lanes(self) -> impl Iterator<Item = (usize, f32, f32)> {
        let (low, high) = (self.low.to_array(), self.high.to_array());
        let mut lanes = self.lanes;
        std::iter::from_fn(move || {
            let lane = lanes.trailing_zeros() as usize;
            (lanes != 0).then(|| {
                lanes &= lanes - 1;
                (lane, low[lane], high[lane])
            })
        })
    }
}

impl Block {
    fn new(grid: &PeriodicGrid, entries: &[CellEntry]) -> Self {
        let zero = [F32x8Array::splat(0.0); 3];
        let (z_min, z_max) = (F32x8Array::splat(f32::INFINITY), F32x8Array::splat(f32::NEG_INFINITY));
        let mut block = Self { x: zero, y: zero, z: zero, z_min, z_max };
        for (lane, &entry) in entries.iter().enumerate() {
            let corners = grid.copy_corners(entry, IVec2::ZERO);
            for (k, corner) in corners.iter().enumerate() {
                block.x[k].set(lane, corner.x);
                block.y[k].set(lane, corner.y);
                block.z[k].set(lane, corner.z);
            }
            let [a, b, c] = corners.map(|corner| corner.z);
            block.z_min.set(lane, a.min(b).min(c));
            block.z_max.set(lane, a.max(b).max(c));
        }
        block
    }

    fn rotated(&self, direction: Vec2) -> (BlockBounds, RotatedBlock) {
        let [dx, dy] = direction.to_array().map(F32x8Array::splat);
        let mut corners: [Corner; 3] = std::array::from_fn(|k| Corner {
            across: dx * self.y[k] - dy * self.x[k],
            along: dx * self.x[k] + dy * self.y[k],
            up: self.z[k],
        });
        for (a, b) in [(0, 1), (1, 2), (0, 1)] {
            let swapped = corners[b].across.less(corners[a].across);
            (corners[a], corners[b]) =
                (Corner::select(swapped, corners[b], corners[a]), Corner::select(swapped, corners[a], corners[b]));
        }
        let [first, middle, last] = corners;
        let bounds = BlockBounds { first: first.across, last: last.across, z_min: self.z_min, z_max: self.z_max };
        let block = RotatedBlock {
            first: first.across,
            middle: middle.across,
            edges: [Edge::between(first, last), Edge::between(first, middle), Edge::between(middle, last)],
        };
        (bounds, block)
    }
}

/// Corners of eight triangles.
#[derive(Clone, Copy)]
struct Corner {
    across: F32x8Array,
    along: F32x8Array,
    up: F32x8Array,
}

impl Corner {
    fn select(mask: <F32x8Array as SimdF32x8>::Mask, yes: Self, no: Self) -> Self {
        let of = |pick: fn(&Self) -> F32x8Array| F32x8Array::select(mask, pick(&yes), pick(&no));
        Self { across: of(|c| c.across), along: of(|c| c.along), up: of(|c| c.up) }
    }
}

impl Edge {
    fn between(from: Corner, to: Corner) -> Self {
        let width = to.across - from.across;
        let zero = F32x8Array::splat(0.0);
        // A slice never meets an edge without width.
        let inverse = F32x8Array::select(zero.less(width), F32x8Array::splat(1.0) / width, zero);
        Self { along: from.along, up: from.up, rates: [(to.along - from.along) * inverse, (to.up - from.up) * inverse] }
    }
}

impl RotatedBlock {
    /// Computes the slopes that the lanes `met` cover as seen from `origin`, in slice coordinates. Lanes within the
    /// known slopes are left out.
    #[inline(always)]
    pub fn covered_slopes<E: SimdF32x8>(&self, origin: Vec3, met: u32, known: KnownSlopes) -> CoveredSlopes<E> {
        let [at, along, up] = origin.to_array().map(E::splat);
        let [long, before, after] = &self.edges;
        let (first, middle) = (E::of(&self.first), E::of(&self.middle));
        let bent = middle.less(at);
        let pick = |before: &F32x8Array, after: &F32x8Array| E::select(bent, E::of(after), E::of(before));
        let t = [at - first, at - E::select(bent, middle, first)];
        let x = [
            E::of(&long.along) + t[0] * E::of(&long.rates[0]) - along,
            pick(&before.along, &after.along) + t[1] * pick(&before.rates[0], &after.rates[0]) - along,
        ];
        let z = [
            E::of(&long.up) + t[0] * E::of(&long.rates[1]) - up,
            pick(&before.up, &after.up) + t[1] * pick(&before.rates[1], &after.rates[1]) - up,
        ];
        let zero = E::splat(0.0);
        let ahead = x.map(|x| zero.less(x));
        // A segment that begins behind the point passes above or below it, so its slope at distance 0 is infinite.
        let [p, q] = [z[1] * x[0], z[0] * x[1]];
        let [over, under] = [f32::INFINITY, f32::NEG_INFINITY].map(E::splat);
        let slopes = [
            E::select(ahead[0], z[0] / x[0], E::select(p.less(q), over, under)),
            E::select(ahead[1], z[1] / x[1], E::select(q.less(p), over, under)),
        ];
        let (low, high) = (slopes[0].min(slopes[1]).max(zero), slopes[0].max(slopes[1]));
        let beyond = E::either(low.less(E::splat(known.low)), E::splat(known.high).less(high));
        let new = E::both(E::splat(known.ground).less(high), beyond);
        CoveredSlopes { low, high, lanes: met & E::bits(E::both(E::either(ahead[0], ahead[1]), new)) }
    }
}

#[cfg(test)]
#[path = "slicer_tests.rs"]
mod tests;
