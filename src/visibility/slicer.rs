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
    pub grid: &'a PeriodicGrid,
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

    /// Blocks of triangles that a cell holds.
    pub fn blocks_in(&self, cell: usize) -> usize {
        (self.starts[cell + 1] - self.starts[cell]) as usize
    }

    /// Calls `visit` with each entry of a cell that the half-plane from `origin` (seen from the cell's own tile copy) along
    /// `along` cuts, and with the slopes `(low, high)` it covers; triangles no higher than `floor` are left out.
    #[inline]
    pub fn for_each_cut(
        &self,
        cell: usize,
        origin: Vec3,
        along: Vec2,
        floor: f32,
        mut visit: impl FnMut(CellEntry, f32, f32),
    ) {
        let entries = self.grid.entries(cell);
        let blocks = &self.blocks[self.starts[cell] as usize..self.starts[cell + 1] as usize];
        for (block, entries) in blocks.iter().zip(entries.chunks(WIDTH)) {
            let Some(cut) = block.cut(origin, along, floor) else { continue };
            let mut lanes = cut.ahead | cut.over;
            let (low, high) = (cut.low.to_array(), cut.high.to_array());
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                if cut.over >> lane & 1 == 0 {
                    visit(entries[lane], low[lane], high[lane]);
                } else if let Some((low, high)) =
                    slice(origin, along, self.grid.copy_corners(entries[lane], IVec2::ZERO))
                {
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

    /// The twin of [`slice`] for four triangles; `None` where no lane is cut above `floor`.
    #[inline]
    fn cut(&self, origin: Vec3, along: Vec2, floor: f32) -> Option<Cut> {
        let seen = |k: usize| Seen::new(self.x[k], self.y[k], self.z[k], origin, along);
        let (a, b, c) = (seen(0), seen(1), seen(2));
        let apart = (a.left() ^ b.left()) | (b.left() ^ c.left());
        let met = apart & self.z_max.cmpgt(Vec4::splat(floor));
        if !met.any() {
            return None;
        }
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
    fn new(x: Vec4, y: Vec4, z: Vec4, origin: Vec3, along: Vec2) -> Self {
        let (x, y) = (x - origin.x, y - origin.y);
        Self { across: along.x * y - along.y * x, along: along.x * x + along.y * y, up: z - origin.z }
    }

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
