//! Triangles of the periodic tile in a plane grid: short rays and vertical slices walk its cells.

use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use crate::cancel::Cancel;
use crate::geometry::TileMesh;

/// A triangle copy that reaches into a cell: its index and how many tiles the copy is moved by.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellEntry {
    pub triangle: u32,
    pub shift: [i16; 2],
}

/// A uniform grid over one period. A cell lists every periodic copy of a triangle whose xy-bounds reach into it.
#[derive(Debug)]
pub struct PeriodicGrid {
    pub(super) tile_size: Vec2,
    pub(super) cells: IVec2,
    pub(super) cell_size: Vec2,
    starts: Vec<u32>,
    /// Those of a cell from the highest down.
    entries: Vec<CellEntry>,
    /// Highest z in each cell, of the triangles' parts anywhere (a bound).
    pub(super) z_max: Vec<f32>,
    /// Highest z of the tile.
    pub(super) top: f32,
    /// Corners of each triangle.
    pub(super) corners: Vec<[Vec3; 3]>,
    /// Slices end at once when it is set.
    pub(super) cancel: Cancel,
}

/// What rays like.
const TRIANGLES_A_CELL: f32 = 4.0;
/// What slices like, which look at eight triangles at once: measured on rods and a weave; 16 take up to 4 % longer.
const TRIANGLES_A_SLICED_CELL: f32 = 28.0;
const MAX_CELLS_A_SIDE: i32 = 512;

impl PeriodicGrid {
    /// Slices of the whole mesh, which can take long, give up when `cancel` is set; what they found is then worthless.
    pub fn cancelled_by(mut self, cancel: &Cancel) -> Self {
        self.cancel = cancel.clone();
        self
    }

    /// Triangles with corners that are not finite, or without area, block nothing.
    pub fn new(mesh: &TileMesh) -> Self {
        Self::with_cells(mesh, TRIANGLES_A_CELL)
    }

    /// The same with larger cells, for slices.
    pub fn for_slices(mesh: &TileMesh) -> Self {
        Self::with_cells(mesh, TRIANGLES_A_SLICED_CELL)
    }

    fn with_cells(mesh: &TileMesh, triangles_a_cell: f32) -> Self {
        let corners: Vec<[Vec3; 3]> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
        let mut solid: Vec<(f32, u32)> = (0..corners.len() as u32)
            .filter(|&t| corners[t as usize].iter().all(|p| p.is_finite()) && mesh.triangle_area(t as usize) > 0.0)
            .map(|t| (corners[t as usize].iter().fold(f32::NEG_INFINITY, |z, p| z.max(p.z)), t))
            .collect();
        // A cell's triangles from the highest down: walks can leave the rest of a cell out.
        solid.par_sort_by(|a, b| b.0.total_cmp(&a.0));
        let cells = cell_counts(mesh.size, &corners, &solid, triangles_a_cell);
        let cell_size = mesh.size / cells.as_vec2();
        let cell_total = (cells.x * cells.y) as usize;

        let mut grid = Self {
            tile_size: mesh.size,
            cells,
            cell_size,
            starts: vec![0; cell_total + 1],
            entries: Vec::new(),
            z_max: vec![f32::NEG_INFINITY; cell_total],
            top: f32::NEG_INFINITY,
            corners,
            cancel: Cancel::default(),
        };
        // Two passes: count, then fill.
        let mut counts = vec![0_u32; cell_total];
        for &(highest, t) in &solid {
            grid.top = grid.top.max(highest);
            grid.for_each_cell(t, |cell, _| counts[cell] += 1);
        }
        for (cell, count) in counts.iter().enumerate() {
            grid.starts[cell + 1] = grid.starts[cell] + count;
        }
        let mut next = grid.starts.clone();
        let mut entries = vec![CellEntry { triangle: 0, shift: [0; 2] }; grid.starts[cell_total] as usize];
        let mut z_max = std::mem::take(&mut grid.z_max);
        for &(highest, t) in &solid {
            grid.for_each_cell(t, |cell, shift| {
                entries[next[cell] as usize] = CellEntry { triangle: t, shift: [shift.x as i16, shift.y as i16] };
                next[cell] += 1;
                z_max[cell] = z_max[cell].max(highest);
            });
        }
        grid.entries = entries;
        grid.z_max = z_max;
        grid
    }

    /// Distance after which a walk along the unit plane direction `along` meets the same again; without end unless it follows
    /// an axis.
    pub(super) fn period_along(&self, along: Vec2) -> f32 {
        let axis = |across: f32, side: f32| if across.abs() < 1e-6 { 1.001 * side } else { f32::INFINITY };
        axis(along.y, self.tile_size.x).min(axis(along.x, self.tile_size.y))
    }

    pub(super) fn entries(&self, cell: usize) -> &[CellEntry] {
        &self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// Corners of the copy that an entry names, seen from the tile copy `at` (in tiles).
    pub(super) fn copy_corners(&self, entry: CellEntry, at: IVec2) -> [Vec3; 3] {
        let shift = (at + IVec2::new(i32::from(entry.shift[0]), i32::from(entry.shift[1]))).as_vec2() * self.tile_size;
        self.corners[entry.triangle as usize].map(|p| p + shift.extend(0.0))
    }

    /// Calls `visit(cell, shift)` for each cell of the base period that a copy of the triangle, moved by `shift` tiles,
    /// reaches into. A separating-axis test on the triangle's edges drops the corners of its bounding box.
    fn for_each_cell(&self, triangle: u32, mut visit: impl FnMut(usize, IVec2)) {
        let corners = self.corners[triangle as usize].map(|p| p.truncate());
        let low = corners[0].min(corners[1]).min(corners[2]) / self.cell_size;
        let high = corners[0].max(corners[1]).max(corners[2]) / self.cell_size;
        // A hair wider than the bounds: rounding must not lose a copy at a cell's edge.
        let slack = Vec2::splat(1e-3);
        let (first, last) = ((low - slack).floor().as_ivec2(), (high + slack).floor().as_ivec2());
        for y in first.y..=last.y {
            for x in first.x..=last.x {
                if !self.overlaps(&corners, IVec2::new(x, y)) {
                    continue;
                }
                let tile = IVec2::new(x.div_euclid(self.cells.x), y.div_euclid(self.cells.y));
                let local = IVec2::new(x, y) - tile * self.cells;
                visit((local.y * self.cells.x + local.x) as usize, -tile);
            }
        }
    }

    fn overlaps(&self, corners: &[Vec2; 3], cell: IVec2) -> bool {
        let centre = (cell.as_vec2() + 0.5) * self.cell_size;
        let half = self.cell_size * 0.501;
        (0..3).all(|k| {
            let (a, b, c) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
            let axis = (b - a).perp();
            let radius = half.dot(axis.abs());
            let (edge, opposite, at) = (axis.dot(a), axis.dot(c), axis.dot(centre));
            at + radius >= edge.min(opposite) && at - radius <= edge.max(opposite)
        })
    }
}

/// A few triangles a cell, following the tile's shape, and no finer than a large triangle warrants.
fn cell_counts(tile_size: Vec2, corners: &[[Vec3; 3]], solid: &[(f32, u32)], triangles_a_cell: f32) -> IVec2 {
    let wanted = (solid.len() as f32 / triangles_a_cell).max(16.0);
    // Grid density must not let a few huge triangles fill the entry list: bound the summed bounding-box areas.
    let boxes: f64 = solid
        .iter()
        .map(|&(_, t)| {
            let [a, b, c] = corners[t as usize].map(|p| p.truncate());
            let extent = a.max(b).max(c) - a.min(b).min(c);
            f64::from(extent.x * extent.y)
        })
        .sum::<f64>()
        / f64::from(tile_size.x * tile_size.y).max(f64::MIN_POSITIVE);
    let wanted = wanted.min((4e7 / boxes.max(1e-3)) as f32);
    let aspect = (tile_size.x / tile_size.y).clamp(1.0 / 64.0, 64.0);
    let x = (wanted * aspect).sqrt().round() as i32;
    let y = (wanted / aspect).sqrt().round() as i32;
    IVec2::new(x, y).clamp(IVec2::ONE, IVec2::splat(MAX_CELLS_A_SIDE))
}

/// Walks the grid's cells from a point along a plane direction; endless, the caller stops.
#[derive(Debug)]
pub(super) struct CellWalk {
    /// Place in the base period.
    local: IVec2,
    tile: IVec2,
    step: IVec2,
    next: Vec2,
    delta: Vec2,
    cells: IVec2,
    /// Distance at which the present cell is entered, in lengths of the direction.
    pub entered: f32,
}

impl CellWalk {
    #[inline(always)]
    pub fn new(grid: &PeriodicGrid, from: Vec2, direction: Vec2) -> Self {
        let at = from / grid.cell_size;
        let speed = direction / grid.cell_size;
        let position = at.floor().as_ivec2();
        let axis = |at: f32, speed: f32, cell: i32| {
            if speed > 0.0 {
                (1, ((cell + 1) as f32 - at) / speed, 1.0 / speed)
            } else if speed < 0.0 {
                (-1, (at - cell as f32) / -speed, -1.0 / speed)
            } else {
                (0, f32::INFINITY, f32::INFINITY)
            }
        };
        let (step_x, next_x, delta_x) = axis(at.x, speed.x, position.x);
        let (step_y, next_y, delta_y) = axis(at.y, speed.y, position.y);
        let tile = IVec2::new(position.x.div_euclid(grid.cells.x), position.y.div_euclid(grid.cells.y));
        Self {
            local: position - tile * grid.cells,
            tile,
            step: IVec2::new(step_x, step_y),
            next: Vec2::new(next_x, next_y),
            delta: Vec2::new(delta_x, delta_y),
            cells: grid.cells,
            entered: 0.0,
        }
    }

    /// Index of the present cell in the base period, and the tile copy it belongs to.
    #[inline(always)]
    pub fn cell(&self) -> (usize, IVec2) {
        ((self.local.y * self.cells.x + self.local.x) as usize, self.tile)
    }

    /// Goes on to the next cell; returns where it is entered.
    #[inline(always)]
    pub fn advance(&mut self) -> f32 {
        // The next period begins where this one ends.
        let stepped = |local: &mut i32, tile: &mut i32, step: i32, cells: i32| {
            *local += step;
            let over = i32::from(*local == cells) - i32::from(*local < 0);
            *local -= over * cells;
            *tile += over;
        };
        if self.next.x <= self.next.y {
            self.entered = self.next.x;
            self.next.x += self.delta.x;
            stepped(&mut self.local.x, &mut self.tile.x, self.step.x, self.cells.x);
        } else {
            self.entered = self.next.y;
            self.next.y += self.delta.y;
            stepped(&mut self.local.y, &mut self.tile.y, self.step.y, self.cells.y);
        }
        self.entered
    }
}
