//! Walks over the copies of the tile that a line through the endless tiling may meet.

use glam::{IVec2, Vec2};

use super::TileHierarchy;

/// A walk along a plane direction over the columns of copies: all copies with one index along the axis that the line
/// follows more closely. It never ends; the caller stops.
#[derive(Debug)]
pub(crate) struct CopyWalk {
    /// Axis across the columns.
    major: usize,
    from: Vec2,
    along: Vec2,
    size: Vec2,
    /// Bounds of the mesh of one copy.
    low: Vec2,
    high: Vec2,
    column: i32,
    step: i32,
    /// Distance at which the line enters the current column, in lengths of the direction.
    pub entered: f32,
}

/// Slack of the indices of columns and rows, so that rounding does not lose a copy [tiles].
const SLACK: f32 = 1e-4;

impl CopyWalk {
    /// Starts a walk from a point. `along` must not be zero.
    #[inline]
    pub fn new(tiling: &TileHierarchy, from: Vec2, along: Vec2) -> Self {
        let (size, low, high) = (tiling.tile_size, tiling.bounds.low.truncate(), tiling.bounds.high.truncate());
        let tiles = (along / size).abs();
        let major = usize::from(tiles.y > tiles.x);
        let forward = along[major] > 0.0;
        let (column, step) = if forward {
            ((((from[major] - high[major]) / size[major] - SLACK).floor() as i32).saturating_add(1), 1)
        } else {
            ((((from[major] - low[major]) / size[major] + SLACK).ceil() as i32).saturating_sub(1), -1)
        };
        let mut walk = Self { major, from, along, size, low, high, column, step, entered: 0.0 };
        walk.entered = walk.distance(forward).max(0.0);
        walk
    }

    /// Distance to the low or the high side of the current column.
    fn distance(&self, low: bool) -> f32 {
        let side = if low { self.low } else { self.high }[self.major];
        (self.column as f32 * self.size[self.major] + side - self.from[self.major]) / self.along[self.major]
    }

    #[inline]
    pub fn advance(&mut self) {
        self.column = self.column.saturating_add(self.step);
        self.entered = self.distance(self.step > 0).max(0.0);
    }

    /// The copies of the current column that the line may meet, as shifts in tiles, from near to far.
    pub fn copies(&self) -> impl Iterator<Item = IVec2> + use<> {
        let minor = 1 - self.major;
        let at = |distance: f32| self.from[minor] + distance * self.along[minor];
        let (near, far) = (at(self.entered), at(self.distance(self.step < 0)));
        let size = self.size[minor];
        let first = ((near.min(far) - self.high[minor]) / size - SLACK).ceil() as i32;
        let last = ((near.max(far) - self.low[minor]) / size + SLACK).floor() as i32;
        let (column, major, forward) = (self.column, self.major, far >= near);
        (first..=last).map(move |row| {
            let row = if forward { row } else { first.wrapping_add(last).wrapping_sub(row) };
            if major == 0 { IVec2::new(column, row) } else { IVec2::new(row, column) }
        })
    }
}
