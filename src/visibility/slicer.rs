//! What do the triangles of a cell cover in a vertical half-plane? Four at a time, as slopes seen from a point.

use glam::{BVec4A, IVec2, Vec2, Vec3, Vec4};

use super::PeriodicGrid;
use super::periodic_grid::CellEntry;

/// Triangles worked on together.
const WIDTH: usize = 4;

/// Four entries of a cell, where the tile copy of the cell has them. Lanes beyond a cell's entries lie lower than all.
#[derive(Debug, Clone)]
struct Block {
    x: [Vec4; 3],
    y: [Vec4; 3],
    z: [Vec4; 3],
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
        let blocks = self.blocks.iter().map(|block| block.turned(along)).collect();
        TurnedSlicer { grid: self.grid, along, starts: &self.starts, blocks }
    }
}

/// Four entries of a cell by their distances across the slices and along them: what lies beside a slice is told by two
/// comparisons.
#[derive(Debug, Clone)]
struct TurnedBlock {
    across: [Vec4; 3],
    along: [Vec4; 3],
    z: [Vec4; 3],
    first: Vec4,
    last: Vec4,
    z_max: Vec4,
}

/// A grid seen in slices of one direction.
#[derive(Debug)]
pub(super) struct TurnedSlicer<'a> {
    pub grid: &'a PeriodicGrid,
    pub along: Vec2,
    starts: &'a [u32],
    blocks: Vec<TurnedBlock>,
}

impl TurnedSlicer<'_> {
    /// Blocks of triangles that a cell holds.
    pub fn blocks_in(&self, cell: usize) -> usize {
        (self.starts[cell + 1] - self.starts[cell]) as usize
    }

    /// Calls `visit` with each entry of a cell that the half-plane from `origin` (seen from the cell's own tile copy) cuts,
    /// and with the slopes `(low, high)` it covers; triangles no higher than `floor` are left out.
    #[inline]
    pub fn for_each_cut(&self, cell: usize, origin: Vec3, floor: f32, mut visit: impl FnMut(CellEntry, f32, f32)) {
        let entries = self.grid.entries(cell);
        let blocks = &self.blocks[self.starts[cell] as usize..self.starts[cell + 1] as usize];
        let origin = Vec3::new(self.along.perp_dot(origin.truncate()), self.along.dot(origin.truncate()), origin.z);
        for (block, entries) in blocks.iter().zip(entries.chunks(WIDTH)) {
            let Some(cut) = block.cut(origin, floor) else { continue };
            let mut lanes = cut.ahead | cut.over;
            let (low, high) = (cut.low.to_array(), cut.high.to_array());
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                if cut.over >> lane & 1 == 0 {
                    visit(entries[lane], low[lane], high[lane]);
                } else if let Some((low, high)) = slice(block.corners(lane).map(|corner| corner - origin)) {
                    visit(entries[lane], low, high);
                }
            }
        }
    }
}

/// The slopes that four triangles cover. Lanes outside the masks hold nothing.
struct Cut {
    low: Vec4,
    high: Vec4,
    /// Lanes that are cut ahead of the point, and only there.
    ahead: u32,
    /// Lanes that are cut both ahead of the point and behind it: their slopes need care.
    over: u32,
}

impl Block {
    fn new(grid: &PeriodicGrid, entries: &[CellEntry]) -> Self {
        let below = Vec4::splat(f32::NEG_INFINITY);
        let mut block = Self { x: [Vec4::ZERO; 3], y: [Vec4::ZERO; 3], z: [Vec4::ZERO; 3], z_max: below };
        for (lane, &entry) in entries.iter().enumerate() {
            for (k, corner) in grid.copy_corners(entry, IVec2::ZERO).iter().enumerate() {
                block.x[k][lane] = corner.x;
                block.y[k][lane] = corner.y;
                block.z[k][lane] = corner.z;
                block.z_max[lane] = block.z_max[lane].max(corner.z);
            }
        }
        block
    }

    fn turned(&self, direction: Vec2) -> TurnedBlock {
        let across: [Vec4; 3] = std::array::from_fn(|k| direction.x * self.y[k] - direction.y * self.x[k]);
        let along = std::array::from_fn(|k| direction.x * self.x[k] + direction.y * self.y[k]);
        let first = across[0].min(across[1]).min(across[2]);
        let last = across[0].max(across[1]).max(across[2]);
        TurnedBlock { across, along, z: self.z, first, last, z_max: self.z_max }
    }
}

impl TurnedBlock {
    /// Corners of one triangle: across, along, up.
    fn corners(&self, lane: usize) -> [Vec3; 3] {
        std::array::from_fn(|k| Vec3::new(self.across[k][lane], self.along[k][lane], self.z[k][lane]))
    }

    /// The twin of [`slice`] for four triangles, from a point with distances across and along and a height; `None` where no
    /// lane is cut above `floor`.
    #[inline]
    fn cut(&self, origin: Vec3, floor: f32) -> Option<Cut> {
        let at = Vec4::splat(origin.x);
        let met = self.first.cmplt(at) & self.last.cmpge(at) & self.z_max.cmpgt(Vec4::splat(floor));
        if !met.any() {
            return None;
        }
        let seen =
            |k: usize| Seen { across: self.across[k] - at, along: self.along[k] - origin.y, up: self.z[k] - origin.z };
        let (a, b, c) = (seen(0), seen(1), seen(2));
        let mut covered =
            Covered { low: Vec4::INFINITY, high: Vec4::NEG_INFINITY, ahead: BVec4A::FALSE, behind: BVec4A::FALSE };
        covered.cross_edge(&a, &b);
        covered.cross_edge(&b, &c);
        covered.cross_edge(&c, &a);
        let Covered { low, high, ahead, behind } = covered;
        Some(Cut {
            low: low.max(Vec4::ZERO),
            high,
            ahead: (met & ahead & !behind & high.cmpgt(Vec4::ZERO)).bitmask(),
            over: (met & ahead & behind).bitmask(),
        })
    }
}

/// Corners of four triangles as the half-plane sees them.
struct Seen {
    across: Vec4,
    along: Vec4,
    up: Vec4,
}

impl Seen {
    #[inline]
    fn left(&self) -> BVec4A {
        self.across.cmpge(Vec4::ZERO)
    }
}

/// What the edges of four triangles cover so far.
struct Covered {
    low: Vec4,
    high: Vec4,
    ahead: BVec4A,
    behind: BVec4A,
}

impl Covered {
    #[inline]
    fn cross_edge(&mut self, p: &Seen, q: &Seen) {
        let crosses = p.left() ^ q.left();
        // The crossing, times the distance between the corners across the plane.
        let (x, z) = (p.along * q.across - q.along * p.across, p.up * q.across - q.up * p.across);
        let same_sign = !(x.cmpgt(Vec4::ZERO) ^ q.across.cmpgt(p.across));
        let ahead = crosses & same_sign & x.cmpne(Vec4::ZERO);
        let slope = z / x;
        self.low = Vec4::select(ahead, self.low.min(slope), self.low);
        self.high = Vec4::select(ahead, self.high.max(slope), self.high);
        self.ahead |= ahead;
        self.behind |= crosses & !ahead;
    }
}

/// The slopes that a triangle covers in the vertical half-plane from a point: its corners are seen from there, as distances
/// across the plane, along it and up; none below the horizon.
fn slice([a, b, c]: [Vec3; 3]) -> Option<(f32, f32)> {
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
