//! The horizon map of a height field from its samples. The highest slope along a direction is at a crossing with a mesh edge.

use glam::{Vec2, Vec3};

use super::MIN_SLOPE;
use super::scan::FACING_MARGIN;
use crate::geometry::{Facets, HeightGrid};
use crate::math::simd::multiversion;

/// Computes the horizons of a height field. Its cells are split along their lower diagonals. These are valleys, so that no
/// horizon lies on them.
#[derive(Debug)]
pub(crate) struct HeightMarch {
    /// Heights row by row. The first column and the first row are repeated at the end.
    heights: Vec<f32>,
    /// Numbers of columns and rows of the tile.
    size: [usize; 2],
    samples_from_tile: Vec2,
    top: f32,
}

/// Minimum of the number of edges of one family that a walk may cross, besides those of sixteen tiles.
/// Farther edges block only directions near the horizon, and only if the height field is many tiles high.
const MIN_EDGES: usize = 8192;

/// Number of crossings per block. With eight, the compiler unrolls the loops and vectorizes only half of them.
const WIDTH: usize = 16;

multiversion! {
    /// Computes [`HeightMarch::highest_slope`] of every facet.
    pub fn march_all(march: &HeightMarch, facets: &Facets, along: Vec2, slopes: &mut [f32]) {
        for ((position, normal), slope) in facets.positions.iter().zip(&facets.normals).zip(slopes) {
            *slope = march.highest_slope(*position, *normal, along);
        }
    }
}

/// A family of parallel mesh edges, one sample apart.
#[derive(Clone, Copy)]
enum Edges {
    /// Edges on x = k, between rows.
    Columns,
    /// Edges on y = k, between columns.
    Rows,
}

/// A walk over one family of edges. Coordinates are in samples.
struct Walk {
    /// Start across the edges, and its change per unit of distance in the plane.
    across: [f32; 2],
    /// Start along the edges, and its change per unit of distance in the plane.
    along: [f32; 2],
    /// Maximum number of edges to cross, rounded up to a multiple of [`WIDTH`].
    max_edges: usize,
    /// The smallest slope that is resolved.
    min_slope: f32,
}

/// Returns the whole number `k` modulo `n`. Below 2²¹ the result is exact, because the rounding error of `(k + ½)/n` is
/// smaller than its distance to a whole number. For any other input the result is less than `n`.
#[inline(always)]
fn wrapped(k: f32, n: f32) -> u32 {
    let rest = k - n * ((k + 0.5) * (1.0 / n)).floor();
    // The mantissa of a number from 2²³ on is the whole number. A cast would check each lane for NaN and overflow.
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

    /// Returns the tangent of the horizon's elevation along the unit plane direction, or 0 if nothing rises above
    /// `from`. The result includes the elevations at which the direction is more than [`FACING_MARGIN`] behind the
    /// facet.
    #[inline(always)]
    pub fn highest_slope(&self, from: Vec3, normal: Vec3, along: Vec2) -> f32 {
        let mut slope = (-(normal.truncate().dot(along) + FACING_MARGIN) / normal.z.max(1e-6)).max(0.0);
        if self.top <= from.z {
            return slope;
        }
        let at = from.truncate() * self.samples_from_tile - 0.5;
        let speed = along * self.samples_from_tile;
        let (is_along_x, is_along_y) = (along.y.abs() < 1e-6, along.x.abs() < 1e-6);
        // Along an axis the same heights return after one tile, farther away, so that the walk is exact.
        let (max_edges, min_slope) = match (is_along_x, is_along_y) {
            (true, _) => (self.size[0] + 1, 0.0),
            (_, true) => (self.size[1] + 1, 0.0),
            _ => (MIN_EDGES + 16 * (self.size[0] + self.size[1]), MIN_SLOPE),
        };
        let [x, y] = [[at.x, speed.x], [at.y, speed.y]];
        if !is_along_y {
            slope = self.cross(Edges::Columns, Walk { across: x, along: y, max_edges, min_slope }, from.z, slope);
        }
        if !is_along_x {
            slope = self.cross(Edges::Rows, Walk { across: y, along: x, max_edges, min_slope }, from.z, slope);
        }
        slope
    }

    /// Returns the maximum of `slope` and of the slopes at the crossings with one family of edges. The walk goes to
    /// increasing distance and ends when no farther height can raise the slope, or only up to the smallest slope that is
    /// resolved, which then counts as blocked.
    #[inline(always)]
    fn cross(&self, edges: Edges, walk: Walk, z: f32, mut slope: f32) -> f32 {
        let ([at, speed], [beside, drift]) = (walk.across, walk.along);
        let step = 1.0 / speed.abs();
        let (mut first, sign) = if speed > 0.0 { (at.floor() + 1.0, 1.0) } else { (at.ceil() - 1.0, -1.0) };
        // An edge at distance 0 would compare the point with itself.
        if (first - at) * sign < 1e-6 {
            first += sign;
        }
        let start = (first - at) * sign * step;
        let stride = self.size[0] + 1;
        let [columns, rows] = self.size.map(|n| n as f32);
        let next = match edges {
            Edges::Columns => stride,
            Edges::Rows => 1,
        };
        for k in (0..walk.max_edges).step_by(WIDTH) {
            let near = start + step * k as f32;
            let highest = (self.top - z) / near;
            if highest <= slope {
                break;
            }
            if highest <= walk.min_slope {
                return slope.max(walk.min_slope.min((self.top - z) / start));
            }
            let line = first + sign * k as f32;
            let (mut distances, mut indices, mut fractions) = ([0.0_f32; WIDTH], [0_u32; WIDTH], [0.0_f32; WIDTH]);
            for l in 0..WIDTH {
                let line = line + sign * l as f32;
                distances[l] = near + step * l as f32;
                let coordinate = beside + drift * distances[l];
                let low = coordinate.floor();
                let (column, row) = match edges {
                    Edges::Columns => (line, low),
                    Edges::Rows => (low, line),
                };
                indices[l] = wrapped(row, rows) * stride as u32 + wrapped(column, columns);
                fractions[l] = coordinate - low;
            }
            let mut ends = [[0.0_f32; WIDTH]; 2];
            for l in 0..WIDTH {
                let index = indices[l] as usize;
                ends[0][l] = self.heights[index];
                ends[1][l] = self.heights[index + next];
            }
            let mut slopes = [0.0_f32; WIDTH];
            for l in 0..WIDTH {
                slopes[l] = (ends[0][l] + (ends[1][l] - ends[0][l]) * fractions[l] - z) / distances[l];
            }
            let mut width = WIDTH;
            while width > 1 {
                width /= 2;
                for l in 0..width {
                    let [a, b] = [slopes[l], slopes[l + width]];
                    slopes[l] = if a > b { a } else { b };
                }
            }
            slope = slope.max(slopes[0]);
        }
        slope
    }
}
