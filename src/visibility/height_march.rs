//! Horizons of a height-field by walking its samples: the highest slope is reached where the slice crosses a mesh edge.

use glam::{Vec2, Vec3};

use super::scan::FACING_MARGIN;
use crate::geometry::{Facets, HeightGrid};
use crate::simd::multiversion;

/// A height-field seen from points on it. Cells are split along the diagonal from (i, j) to (i+1, j+1).
#[derive(Debug)]
pub(super) struct HeightMarch<'a> {
    heights: &'a HeightGrid,
    samples_from_tile: Vec2,
    top: f32,
}

/// Edges of one family that any walk may cross, besides those of sixteen tiles: what lies beyond blocks only directions low
/// over the horizon, and only of height-fields that are many tiles high.
const LEAST_LINES: usize = 8192;

multiversion! {
    /// [`HeightMarch::highest_slope`] of every facet.
    pub fn march_all(march: &HeightMarch, facets: &Facets, along: Vec2, slopes: &mut [f32]) {
        for ((position, normal), slope) in facets.positions.iter().zip(&facets.normals).zip(slopes) {
            *slope = march.highest_slope(*position, *normal, along);
        }
    }
}

/// `k` modulo `n`, without a division for what lies in the next tile.
#[inline(always)]
fn wrapped(k: i32, n: i32) -> i32 {
    let near = k + n * (i32::from(k < 0) - i32::from(k >= n));
    if (0..n).contains(&near) { near } else { near.rem_euclid(n) }
}

impl<'a> HeightMarch<'a> {
    pub fn new(heights: &'a HeightGrid, tile_size: Vec2) -> Self {
        let top = heights.heights.iter().fold(f32::NEG_INFINITY, |top, &z| top.max(z));
        Self { heights, samples_from_tile: heights.size.as_vec2() / tile_size, top }
    }

    #[inline(always)]
    fn sample(&self, x: i32, y: i32) -> f32 {
        let (w, h) = (self.heights.size.x as i32, self.heights.size.y as i32);
        self.heights.heights[(wrapped(y, h) * w + wrapped(x, w)) as usize]
    }

    /// The tangent of the horizon's elevation along the unit plane direction, no lower than what a facet of this normal
    /// is well turned away from; 0 where nothing rises above `from`.
    #[inline(always)]
    pub fn highest_slope(&self, from: Vec3, normal: Vec3, along: Vec2) -> f32 {
        let clearance = self.top - from.z;
        let mut slope = (-(normal.truncate().dot(along) + FACING_MARGIN) / normal.z.max(1e-6)).max(0.0);
        if clearance <= 0.0 {
            return slope;
        }
        let at = from.truncate() * self.samples_from_tile - 0.5;
        let speed = along * self.samples_from_tile;
        // Edges x = k, where heights lie between rows; y = k, between columns; x - y = k, along the diagonals.
        let [columns, rows] = [self.heights.size.x, self.heights.size.y];
        let (along_x, along_y) = (along.y.abs() < 1e-6, along.x.abs() < 1e-6);
        // Along an axis all comes back after one tile, only further away.
        let most = match (along_x, along_y) {
            (true, _) => columns as usize + 1,
            (_, true) => rows as usize + 1,
            _ => LEAST_LINES + 16 * (columns + rows) as usize,
        };
        self.cross([at.x, speed.x], along_y, most, [from.z, clearance], &mut slope, |line, r| {
            let y = at.y + speed.y * r;
            let low = y.floor();
            let (a, b) = (self.sample(line, low as i32), self.sample(line, low as i32 + 1));
            a + (b - a) * (y - low)
        });
        self.cross([at.y, speed.y], along_x, most, [from.z, clearance], &mut slope, |line, r| {
            let x = at.x + speed.x * r;
            let low = x.floor();
            let (a, b) = (self.sample(low as i32, line), self.sample(low as i32 + 1, line));
            a + (b - a) * (x - low)
        });
        let turning = speed.x - speed.y;
        let parallel = turning.abs() < 1e-6 * self.samples_from_tile.max_element();
        self.cross([at.x - at.y, turning], parallel, most, [from.z, clearance], &mut slope, |line, r| {
            let x = at.x + speed.x * r;
            let low = x.floor();
            let (i, j) = (low as i32, low as i32 - line);
            let (a, b) = (self.sample(i, j), self.sample(i + 1, j + 1));
            a + (b - a) * (x - low)
        });
        slope
    }

    /// Visits the crossings of one family of edges at increasing distance `r`, `most` of them, until nothing further can rise
    /// higher. `parallel`: the walk follows these edges and crosses none.
    #[inline(always)]
    fn cross(
        &self,
        [at, speed]: [f32; 2],
        parallel: bool,
        most: usize,
        [z, clearance]: [f32; 2],
        slope: &mut f32,
        height: impl Fn(i32, f32) -> f32,
    ) {
        /// Nothing below this slope is resolved.
        const LOWEST: f32 = 0.005;
        if parallel || speed == 0.0 {
            return;
        }
        let step = 1.0 / speed.abs();
        let (mut line, turn) = if speed > 0.0 { (at.floor() as i32 + 1, 1) } else { (at.ceil() as i32 - 1, -1) };
        let mut r = (line as f32 - at) / speed;
        for _ in 0..most {
            if r * slope.max(LOWEST) >= clearance {
                return;
            }
            // At its own edge a point sees itself.
            if r > 1e-6 * step {
                let rise = height(line, r) - z;
                if rise > *slope * r {
                    *slope = rise / r;
                }
            }
            r += step;
            line += turn;
        }
    }
}
