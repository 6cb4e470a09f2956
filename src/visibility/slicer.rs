//! What do the triangles of a cell cover in a vertical half-plane? SimdF32x8 at a time, as slopes seen from a point.

use glam::{IVec2, Vec2, Vec3};

use super::scan::Known;
use crate::geometry::Facets;
use crate::geometry::PeriodicGrid;
use crate::geometry::grid::cell_lists::CellEntry;
use crate::math::simd::{F32x8Array, SimdF32x8};

/// Triangles worked on together.
pub(crate) const WIDTH: usize = 8;

/// SimdF32x8 entries of a cell, where the tile copy of the cell has them. Lanes beyond a cell's entries lie lower than all.
#[derive(Debug, Clone)]
struct Block {
    x: [F32x8Array; 3],
    y: [F32x8Array; 3],
    z: [F32x8Array; 3],
    z_min: F32x8Array,
    z_max: F32x8Array,
}

/// A periodic grid made ready for vertical slices.
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

    /// Ready for slices along the unit plane direction `along`.
    pub fn turned(&self, along: Vec2) -> TurnedSlicer<'_> {
        let (extents, blocks) = self.blocks.iter().map(|block| block.turned(along)).unzip();
        TurnedSlicer { grid: self.grid, along, starts: &self.starts, extents, blocks }
    }
}

/// SimdF32x8 triangles of a cell by their distances across the slices: where each begins, bends and ends, and how its edges run
/// along a slice and up from there.
#[derive(Debug, Clone)]
pub(crate) struct TurnedBlock {
    first: F32x8Array,
    middle: F32x8Array,
    /// From the first corner to the last; to the middle one; and from there to the last.
    edges: [Edge; 3],
}

/// What tells whether a slice meets eight triangles at all: kept apart, so that more of it stays at hand.
#[derive(Debug, Clone)]
pub(crate) struct Extent {
    first: F32x8Array,
    last: F32x8Array,
    z_min: F32x8Array,
    z_max: F32x8Array,
}

impl Extent {
    /// The height that nothing here, and nothing in later blocks of the cell, rises above.
    #[inline(always)]
    pub fn highest(&self) -> f32 {
        self.z_max.0[0].x
    }

    /// Lanes that a slice at a distance `across` meets, and that reach above the height `floor` and below `ceiling`: a bit each.
    #[inline(always)]
    pub fn meets<E: SimdF32x8>(&self, across: f32, [floor, ceiling]: [f32; 2]) -> u32 {
        let at = E::splat(across);
        let between = E::both(E::of(&self.first).less(at), E::of(&self.z_min).less(E::splat(ceiling)));
        let high = E::both(between, E::splat(floor).less(E::of(&self.z_max)));
        E::bits(high) & !E::bits(E::of(&self.last).less(at))
    }
}

/// SimdF32x8 edges, from the corner that comes first across the slices: so that neighbours agree about the edge they share.
#[derive(Debug, Clone, Copy)]
struct Edge {
    along: F32x8Array,
    up: F32x8Array,
    /// Growth of both with the distance across.
    rates: [F32x8Array; 2],
}

/// A grid seen in slices of one direction.
#[derive(Debug)]
pub(crate) struct TurnedSlicer<'a> {
    pub grid: &'a PeriodicGrid,
    pub along: Vec2,
    starts: &'a [u32],
    extents: Vec<Extent>,
    blocks: Vec<TurnedBlock>,
}

impl TurnedSlicer<'_> {
    /// The facets in an order in which neighbours walk over much the same cells.
    pub fn order(&self, facets: &Facets) -> Vec<u32> {
        let width = self.grid.cell_size.min_element();
        let mut order: Vec<(i32, u32)> = (0..facets.len() as u32)
            .map(|facet| ((self.along.perp_dot(facets.positions[facet as usize].truncate()) / width) as i32, facet))
            .collect();
        order.sort_unstable();
        order.into_iter().map(|(_, facet)| facet).collect()
    }

    /// The triangles of a cell, eight by eight: their places among all, and where they lie.
    pub fn blocks(&self, cell: usize) -> (usize, &[Extent]) {
        let (first, end) = (self.starts[cell] as usize, self.starts[cell + 1] as usize);
        (first, &self.extents[first..end])
    }

    /// SimdF32x8 triangles by their place.
    #[inline(always)]
    pub fn block(&self, place: usize) -> &TurnedBlock {
        &self.blocks[place]
    }

    /// What the lanes of a cell's blocks are.
    pub fn entries(&self, cell: usize) -> &[CellEntry] {
        self.grid.entries(cell)
    }

    /// A point as blocks see it: its distances across the slices and along them, and its height.
    pub fn seen(&self, point: Vec3) -> Vec3 {
        Vec3::new(self.along.perp_dot(point.truncate()), self.along.dot(point.truncate()), point.z)
    }
}

/// The slopes that eight triangles cover. Lanes outside the mask hold nothing.
pub(crate) struct Cut<E> {
    low: E,
    high: E,
    lanes: u32,
}

impl<E: SimdF32x8> Cut<E> {
    /// Lanes that are cut, with their slopes `(low, high)`.
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

    fn turned(&self, direction: Vec2) -> (Extent, TurnedBlock) {
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
        let extent = Extent { first: first.across, last: last.across, z_min: self.z_min, z_max: self.z_max };
        let block = TurnedBlock {
            first: first.across,
            middle: middle.across,
            edges: [Edge::between(first, last), Edge::between(first, middle), Edge::between(middle, last)],
        };
        (extent, block)
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
        // Edges without width are never met.
        let inverse = F32x8Array::select(zero.less(width), F32x8Array::splat(1.0) / width, zero);
        Self { along: from.along, up: from.up, rates: [(to.along - from.along) * inverse, (to.up - from.up) * inverse] }
    }
}

impl TurnedBlock {
    /// What [`slice`] says of eight triangles, of which those are `met`, from a point with distances across and along and a
    /// height. Lanes that tell nothing new are left out.
    #[inline(always)]
    pub fn cut<E: SimdF32x8>(&self, origin: Vec3, met: u32, known: Known) -> Cut<E> {
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
        // Where a segment begins behind the point, it passes above or below: at distance 0 its slope is infinite.
        let [p, q] = [z[1] * x[0], z[0] * x[1]];
        let [over, under] = [f32::INFINITY, f32::NEG_INFINITY].map(E::splat);
        let slopes = [
            E::select(ahead[0], z[0] / x[0], E::select(p.less(q), over, under)),
            E::select(ahead[1], z[1] / x[1], E::select(q.less(p), over, under)),
        ];
        let (low, high) = (slopes[0].min(slopes[1]).max(zero), slopes[0].max(slopes[1]));
        let beyond = E::either(low.less(E::splat(known.low)), E::splat(known.high).less(high));
        let new = E::both(E::splat(known.ground).less(high), beyond);
        Cut { low, high, lanes: met & E::bits(E::both(E::either(ahead[0], ahead[1]), new)) }
    }
}

#[cfg(test)]
#[path = "slicer_tests.rs"]
mod tests;
