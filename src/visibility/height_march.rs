//! HorizonMap of a height-field by walking its samples: the highest slope is reached where the slice crosses a mesh edge.

use glam::{Vec2, Vec3};

use super::scan::FACING_MARGIN;
use crate::geometry::{Facets, HeightGrid};
use crate::math::simd::multiversion;

/// A height-field seen from points on it. Cells are split along the diagonal from (i, j) to (i+1, j+1).
#[derive(Debug)]
pub(crate) struct HeightMarch {
    /// Row by row, with the first column and row once more at the end.
    heights: Vec<f32>,
    /// Columns and rows of the tile.
    size: [usize; 2],
    samples_from_tile: Vec2,
    top: f32,
}

/// Edges of one family that any walk may cross, besides those of sixteen tiles: what lies beyond blocks only directions low
/// over the horizon, and only of height-fields that are many tiles high.
const MIN_LINES: usize = 8192;

/// Crossings worked on together. Of eight the compiler unrolls the loops, and makes vectors of half of them only.
const WIDTH: usize = 16;

multiversion! {
    /// [`HeightMarch::highest_slope`] of every facet.
    pub fn march_all(march: &HeightMarch, facets: &Facets, along: Vec2, slopes: &mut [f32]) {
        for ((position, normal), slope) in facets.positions.iter().zip(&facets.normals).zip(slopes) {
            *slope = march.highest_slope(*position, *normal, along);
        }
    }
}

/// Parallel edges of the mesh, one a sample apart from the next.
#[derive(Clone, Copy)]
enum Edges {
    /// On x = k, between rows.
    Columns,
    /// On y = k, between columns.
    Rows,
    /// On x - y = k.
    Diagonals,
}

/// A walk over one family of edges, in samples.
struct Walk {
    /// Where it begins, across the edges and along them, and how it goes on per unit of the plane.
    across: [f32; 2],
    along: [f32; 2],
    /// Edges that it crosses at most, or as many more as fill [`WIDTH`].
    most: usize,
}

/// A whole number modulo another: exact below 2²¹, where `(k + ½)/n` is further from whole numbers than its rounding; below the
/// other for whatever is given.
#[inline(always)]
fn wrapped(k: f32, n: f32) -> u32 {
    let rest = k - n * ((k + 0.5) * (1.0 / n)).floor();
    // Its mantissa, from 2²³ on: a cast looks out for what no whole number has, lane by lane.
    let rest = (rest + 8_388_608.0).to_bits() & 0x007f_ffff;
    rest.min(n as u32 - 1)
}

impl HeightMarch {
    pub fn new(grid: &HeightGrid, tile_size: Vec2) -> Self {
        let top = grid.heights.iter().fold(f32::NEG_INFINITY, |top, &z| top.max(z));
        let size = [grid.size.x as usize, grid.size.y as usize];
        let rows = (0..=size[1]).map(|y| &grid.heights[y % size[1] * size[0]..][..size[0]]);
        let heights = rows.flat_map(|row| row.iter().chain(&row[..1])).copied().collect();
        Self { heights, size, samples_from_tile: grid.size.as_vec2() / tile_size, top }
    }

    /// The tangent of the horizon's elevation along the unit plane direction, no lower than what a facet of this normal
    /// is well turned away from; 0 where nothing rises above `from`.
    #[inline(always)]
    pub fn highest_slope(&self, from: Vec3, normal: Vec3, along: Vec2) -> f32 {
        let mut slope = (-(normal.truncate().dot(along) + FACING_MARGIN) / normal.z.max(1e-6)).max(0.0);
        if self.top <= from.z {
            return slope;
        }
        let at = from.truncate() * self.samples_from_tile - 0.5;
        let speed = along * self.samples_from_tile;
        let (along_x, along_y) = (along.y.abs() < 1e-6, along.x.abs() < 1e-6);
        // Along an axis all comes back after one tile, only further away.
        let most = match (along_x, along_y) {
            (true, _) => self.size[0] + 1,
            (_, true) => self.size[1] + 1,
            _ => MIN_LINES + 16 * (self.size[0] + self.size[1]),
        };
        let [x, y] = [[at.x, speed.x], [at.y, speed.y]];
        if !along_y {
            slope = self.cross(Edges::Columns, Walk { across: x, along: y, most }, from.z, slope);
        }
        if !along_x {
            slope = self.cross(Edges::Rows, Walk { across: y, along: x, most }, from.z, slope);
        }
        let turning = speed.x - speed.y;
        if turning.abs() >= 1e-6 * self.samples_from_tile.max_element() {
            slope =
                self.cross(Edges::Diagonals, Walk { across: [at.x - at.y, turning], along: x, most }, from.z, slope);
        }
        slope
    }

    /// The highest slope, `slope` at least, at the crossings of one family of edges at increasing distance, until nothing
    /// further can rise higher.
    #[inline(always)]
    fn cross(&self, edges: Edges, walk: Walk, z: f32, mut slope: f32) -> f32 {
        /// Nothing below this slope is resolved.
        const LOWEST: f32 = 0.005;
        let ([at, speed], [beside, drift]) = (walk.across, walk.along);
        let step = 1.0 / speed.abs();
        let (mut first, turn) = if speed > 0.0 { (at.floor() + 1.0, 1.0) } else { (at.ceil() - 1.0, -1.0) };
        // At its own edge a point sees itself.
        if (first - at) * turn < 1e-6 {
            first += turn;
        }
        let start = (first - at) * turn * step;
        let stride = self.size[0] + 1;
        let [columns, rows] = self.size.map(|n| n as f32);
        let next = match edges {
            Edges::Columns => stride,
            Edges::Rows => 1,
            Edges::Diagonals => stride + 1,
        };
        for k in (0..walk.most).step_by(WIDTH) {
            let near = start + step * k as f32;
            if near * slope.max(LOWEST) >= self.top - z {
                break;
            }
            let line = first + turn * k as f32;
            let (mut distances, mut places, mut parts) = ([0.0_f32; WIDTH], [0_u32; WIDTH], [0.0_f32; WIDTH]);
            for l in 0..WIDTH {
                let line = line + turn * l as f32;
                distances[l] = near + step * l as f32;
                let place = beside + drift * distances[l];
                let low = place.floor();
                let (column, row) = match edges {
                    Edges::Columns => (line, low),
                    Edges::Rows => (low, line),
                    Edges::Diagonals => (low, low - line),
                };
                places[l] = wrapped(row, rows) * stride as u32 + wrapped(column, columns);
                parts[l] = place - low;
            }
            let mut ends = [[0.0_f32; WIDTH]; 2];
            for l in 0..WIDTH {
                let place = places[l] as usize;
                ends[0][l] = self.heights[place];
                ends[1][l] = self.heights[place + next];
            }
            let mut steepness = [0.0_f32; WIDTH];
            for l in 0..WIDTH {
                steepness[l] = (ends[0][l] + (ends[1][l] - ends[0][l]) * parts[l] - z) / distances[l];
            }
            let mut width = WIDTH;
            while width > 1 {
                width /= 2;
                for l in 0..width {
                    let [a, b] = [steepness[l], steepness[l + width]];
                    steepness[l] = if a > b { a } else { b };
                }
            }
            slope = slope.max(steepness[0]);
        }
        slope
    }
}
