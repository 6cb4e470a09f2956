//! Lists of the triangles that reach into each cell of a periodic grid.

use std::ops::Range;

use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use crate::geometry::families::rounded::floored;

/// Minimum number of triangles per parallel task.
pub(crate) const MIN_ITEMS_PER_TASK: usize = 2048;

/// A triangle copy that reaches into a cell: the triangle's index and the copy's shift in tiles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CellEntry {
    pub triangle: u32,
    pub shift: [i16; 2],
}

impl CellEntry {
    /// The triangle's index, and the shift as two signed 16-bit halves.
    #[cfg(feature = "gpu")]
    pub fn words(self) -> [u32; 2] {
        let [x, y] = self.shift.map(|shift| u32::from(shift.cast_unsigned()));
        [self.triangle, x | y << 16]
    }
}

/// The lists of all cells, one after the other.
#[derive(Debug, PartialEq)]
pub(crate) struct CellLists {
    /// Index of each cell's first entry, and the end of the last cell.
    pub starts: Vec<u32>,
    /// Entries by cell, each cell's in the order of the triangles.
    pub entries: Vec<CellEntry>,
    /// Bound of z in each cell: the highest z of its triangles, inside the cell or outside.
    pub z_max: Vec<f32>,
}

struct Cells<'a> {
    corners: &'a [[Vec3; 3]],
    counts: IVec2,
    size: Vec2,
}

/// A triangle and the cells that its bounds reach into, over all tiles.
struct Bounds {
    triangle: u32,
    first: IVec2,
    last: IVec2,
}

impl CellLists {
    /// Builds the lists of the triangles `solid`, in this order. Each task builds the lists of a band of rows. The
    /// lists do not depend on the number of threads.
    pub fn new(corners: &[[Vec3; 3]], solid: &[u32], counts: IVec2, size: Vec2) -> Self {
        let cells = Cells { corners, counts, size };
        let bounds: Vec<Bounds> =
            solid.par_iter().with_min_len(MIN_ITEMS_PER_TASK).map(|triangle| cells.bounds(*triangle)).collect();
        let bands = if solid.len() < 2 * MIN_ITEMS_PER_TASK { 1 } else { 2 * rayon::current_num_threads() };
        let rows_per_band = (counts.y as usize).div_ceil(bands);
        let (cells_per_band, cell_total) = (rows_per_band * counts.x as usize, (counts.x * counts.y) as usize);
        let rows = |band: usize| (band * rows_per_band) as i32..((band + 1) * rows_per_band) as i32;
        // The first pass counts entries, the second fills them in.
        let mut starts = vec![0_u32; cell_total + 1];
        starts[1..].par_chunks_mut(cells_per_band).enumerate().for_each(|(band, counts)| {
            cells.for_each(&bounds, rows(band), |cell, _, _| counts[cell] += 1);
        });
        for cell in 0..cell_total {
            starts[cell + 1] += starts[cell];
        }
        let mut entries = vec![CellEntry { triangle: 0, shift: [0; 2] }; starts[cell_total] as usize];
        let mut z_max = vec![f32::NEG_INFINITY; cell_total];
        let mut rest = &mut entries[..];
        let split = |starts: &[u32]| {
            let count = (starts[starts.len() - 1] - starts[0]) as usize;
            rest.split_off_mut(..count).unwrap_or_default()
        };
        let ends =
            (0..cell_total).step_by(cells_per_band).map(|first| (first, (first + cells_per_band).min(cell_total)));
        let parts: Vec<&mut [CellEntry]> = ends.map(|(first, end)| &starts[first..=end]).map(split).collect();
        let filled = parts
            .into_par_iter()
            .zip(z_max.par_chunks_mut(cells_per_band))
            .zip(starts[..cell_total].par_chunks(cells_per_band));
        filled.enumerate().for_each(|(band, ((entries, z_max), starts))| {
            let mut next: Vec<u32> = starts.iter().map(|start| start - starts[0]).collect();
            cells.for_each(&bounds, rows(band), |cell, triangle, shift| {
                entries[next[cell] as usize] = CellEntry { triangle, shift: [shift.x as i16, shift.y as i16] };
                next[cell] += 1;
                z_max[cell] = z_max[cell].max(highest(&corners[triangle as usize]));
            });
        });
        Self { starts, entries, z_max }
    }
}

pub(crate) fn highest(corners: &[Vec3; 3]) -> f32 {
    corners.iter().fold(f32::NEG_INFINITY, |z, p| z.max(p.z))
}

impl Cells<'_> {
    fn bounds(&self, triangle: u32) -> Bounds {
        let [a, b, c] = self.corners[triangle as usize].map(|p| p.truncate());
        let (low, high) = (a.min(b).min(c) / self.size, a.max(b).max(c) / self.size);
        // The slack ensures that rounding does not lose a copy at a cell's edge.
        let slack = Vec2::splat(1e-3);
        let cell = |at: Vec2| IVec2::new(floored(at.x), floored(at.y));
        Bounds { triangle, first: cell(low - slack), last: cell(high + slack) }
    }

    /// Calls `visit(cell, triangle, shift)` for each cell of the rows and each triangle copy, moved by `shift` tiles,
    /// that reaches into it. Cell indices start at the first of the rows. A separating-axis test on the triangle's
    /// edges excludes cells that only its bounding box reaches.
    fn for_each(&self, bounds: &[Bounds], rows: Range<i32>, mut visit: impl FnMut(usize, u32, IVec2)) {
        for Bounds { triangle, first, last } in bounds {
            let row = first.y.rem_euclid(self.counts.y);
            let last_row = row.saturating_add(last.y.saturating_sub(first.y));
            if last_row < self.counts.y && (last_row < rows.start || row >= rows.end) {
                continue;
            }
            let corners = self.corners[*triangle as usize].map(|p| p.truncate());
            for y in first.y..=last.y {
                let tile_y = y.div_euclid(self.counts.y);
                let local_y = y - tile_y * self.counts.y;
                if !rows.contains(&local_y) {
                    continue;
                }
                for x in first.x..=last.x {
                    if self.overlaps(&corners, IVec2::new(x, y)) {
                        let tile_x = x.div_euclid(self.counts.x);
                        let cell = (local_y - rows.start) * self.counts.x + x - tile_x * self.counts.x;
                        visit(cell as usize, *triangle, -IVec2::new(tile_x, tile_y));
                    }
                }
            }
        }
    }

    #[inline]
    fn overlaps(&self, corners: &[Vec2; 3], cell: IVec2) -> bool {
        let centre = (cell.as_vec2() + 0.5) * self.size;
        let half = self.size * 0.501;
        (0..3).all(|k| {
            let (a, b, c) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
            let axis = (b - a).perp();
            let radius = half.dot(axis.abs());
            let (edge, opposite, at) = (axis.dot(a), axis.dot(c), axis.dot(centre));
            at + radius >= edge.min(opposite) && at - radius <= edge.max(opposite)
        })
    }
}
