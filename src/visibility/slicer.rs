//! What do the triangles of a cell cover in a vertical half-plane? Four at a time, as slopes seen from a point.

use glam::{BVec4A, IVec2, Vec2, Vec3, Vec4};

use super::PeriodicGrid;
use super::periodic_grid::CellEntry;
use super::scan::Known;
use crate::geometry::Facets;

/// Triangles worked on together.
pub(super) const WIDTH: usize = 4;

/// Four entries of a cell, where the tile copy of the cell has them. Lanes beyond a cell's entries lie lower than all.
#[derive(Debug, Clone)]
struct Block {
    x: [Vec4; 3],
    y: [Vec4; 3],
    z: [Vec4; 3],
    z_min: Vec4,
    z_max: Vec4,
}

/// A periodic grid made ready for vertical slices.
#[derive(Debug)]
pub(super) struct Slicer<'a> {
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

/// Four triangles of a cell by their distances across the slices: where each begins, bends and ends, and how its edges run
/// along a slice and up from there.
#[derive(Debug, Clone)]
pub(super) struct TurnedBlock {
    first: Vec4,
    middle: Vec4,
    /// From the first corner to the last; to the middle one; and from there to the last.
    edges: [Edge; 3],
}

/// What tells whether a slice meets four triangles at all: kept apart, so that more of it stays at hand.
#[derive(Debug, Clone)]
pub(super) struct Extent {
    first: Vec4,
    last: Vec4,
    z_min: Vec4,
    z_max: Vec4,
}

impl Extent {
    /// Lanes that a slice at a distance `across` meets, and that reach above the height `floor` and below `ceiling`.
    #[inline(always)]
    pub fn meets(&self, across: f32, [floor, ceiling]: [f32; 2]) -> BVec4A {
        let at = Vec4::splat(across);
        self.first.cmplt(at)
            & self.last.cmpge(at)
            & self.z_max.cmpgt(Vec4::splat(floor))
            & self.z_min.cmplt(Vec4::splat(ceiling))
    }
}

/// Four edges, from the corner that comes first across the slices: so that neighbours agree about the edge they share.
#[derive(Debug, Clone, Copy)]
struct Edge {
    along: Vec4,
    up: Vec4,
    /// Growth of both with the distance across.
    rates: [Vec4; 2],
}

/// A grid seen in slices of one direction.
#[derive(Debug)]
pub(super) struct TurnedSlicer<'a> {
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

    /// The triangles of a cell, four by four: their places among all, and where they lie.
    pub fn blocks(&self, cell: usize) -> (usize, &[Extent]) {
        let (first, end) = (self.starts[cell] as usize, self.starts[cell + 1] as usize);
        (first, &self.extents[first..end])
    }

    /// Four triangles by their place.
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

/// The slopes that four triangles cover. Lanes outside the mask hold nothing.
pub(super) struct Cut {
    low: Vec4,
    high: Vec4,
    lanes: u32,
}

impl Cut {
    /// Lanes that are cut, with their slopes `(low, high)`.
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
        let zero = [Vec4::ZERO; 3];
        let mut block = Self { x: zero, y: zero, z: zero, z_min: Vec4::INFINITY, z_max: Vec4::NEG_INFINITY };
        for (lane, &entry) in entries.iter().enumerate() {
            for (k, corner) in grid.copy_corners(entry, IVec2::ZERO).iter().enumerate() {
                block.x[k][lane] = corner.x;
                block.y[k][lane] = corner.y;
                block.z[k][lane] = corner.z;
                block.z_min[lane] = block.z_min[lane].min(corner.z);
                block.z_max[lane] = block.z_max[lane].max(corner.z);
            }
        }
        block
    }

    fn turned(&self, direction: Vec2) -> (Extent, TurnedBlock) {
        let mut corners: [Corner; 3] = std::array::from_fn(|k| Corner {
            across: direction.x * self.y[k] - direction.y * self.x[k],
            along: direction.x * self.x[k] + direction.y * self.y[k],
            up: self.z[k],
        });
        for (a, b) in [(0, 1), (1, 2), (0, 1)] {
            let in_order = corners[a].across.cmple(corners[b].across);
            (corners[a], corners[b]) =
                (Corner::select(in_order, corners[a], corners[b]), Corner::select(in_order, corners[b], corners[a]));
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

/// Corners of four triangles.
#[derive(Clone, Copy)]
struct Corner {
    across: Vec4,
    along: Vec4,
    up: Vec4,
}

impl Corner {
    fn select(mask: BVec4A, yes: Self, no: Self) -> Self {
        let of = |pick: fn(&Self) -> Vec4| Vec4::select(mask, pick(&yes), pick(&no));
        Self { across: of(|c| c.across), along: of(|c| c.along), up: of(|c| c.up) }
    }
}

impl Edge {
    fn between(from: Corner, to: Corner) -> Self {
        let width = to.across - from.across;
        // Edges without width are never met.
        let inverse = Vec4::select(width.cmpgt(Vec4::ZERO), width.recip(), Vec4::ZERO);
        Self { along: from.along, up: from.up, rates: [(to.along - from.along) * inverse, (to.up - from.up) * inverse] }
    }
}

impl TurnedBlock {
    /// What [`slice`] says of four triangles, of which those are `met`, from a point with distances across and along and a
    /// height. Lanes that tell nothing new are left out.
    #[inline(always)]
    pub fn cut(&self, origin: Vec3, met: BVec4A, known: Known) -> Cut {
        let at = Vec4::splat(origin.x);
        let (along, up) = (Vec4::splat(origin.y), Vec4::splat(origin.z));
        let [long, before, after] = &self.edges;
        let bent = self.middle.cmplt(at);
        let pick = |before: Vec4, after: Vec4| Vec4::select(bent, after, before);
        let t = [at - self.first, at - pick(self.first, self.middle)];
        let x = [
            long.along + t[0] * long.rates[0] - along,
            pick(before.along, after.along) + t[1] * pick(before.rates[0], after.rates[0]) - along,
        ];
        let z = [
            long.up + t[0] * long.rates[1] - up,
            pick(before.up, after.up) + t[1] * pick(before.rates[1], after.rates[1]) - up,
        ];
        let ahead = x.map(|x| x.cmpgt(Vec4::ZERO));
        // Where a segment begins behind the point, it passes above or below: at distance 0 its slope is infinite.
        let [p, q] = [z[1] * x[0], z[0] * x[1]];
        let [over, under] = [f32::INFINITY, f32::NEG_INFINITY].map(Vec4::splat);
        let slopes = [
            Vec4::select(ahead[0], z[0] / x[0], Vec4::select(p.cmplt(q), over, under)),
            Vec4::select(ahead[1], z[1] / x[1], Vec4::select(p.cmpgt(q), over, under)),
        ];
        let (low, high) = (slopes[0].min(slopes[1]).max(Vec4::ZERO), slopes[0].max(slopes[1]));
        let new = high.cmpgt(Vec4::splat(known.ground))
            & (low.cmplt(Vec4::splat(known.low)) | high.cmpgt(Vec4::splat(known.high)));
        Cut { low, high, lanes: (met & (ahead[0] | ahead[1]) & new).bitmask() }
    }
}

#[cfg(test)]
#[path = "slicer_tests.rs"]
mod tests;
