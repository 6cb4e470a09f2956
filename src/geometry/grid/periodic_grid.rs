//! Triangles of the periodic tile in a plane grid: short rays and vertical slices walk its cells.

use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::cell_lists::{A_THREAD, CellEntry, CellLists, highest};
use crate::base::Cancel;
use crate::geometry::TileMesh;

/// A uniform grid over one period. A cell lists every periodic copy of a triangle whose xy-bounds reach into it.
#[derive(Debug)]
pub struct PeriodicGrid {
    pub(crate) tile_size: Vec2,
    pub(crate) cells: IVec2,
    pub(crate) cell_size: Vec2,
    starts: Vec<u32>,
    /// Those of a cell from the highest down.
    entries: Vec<CellEntry>,
    /// Highest z in each cell, of the triangles' parts anywhere (a bound).
    pub(crate) z_max: Vec<f32>,
    /// Highest z of the tile.
    pub(crate) top: f32,
    /// Corners of each triangle.
    pub(crate) corners: Vec<[Vec3; 3]>,
    /// OcclusionIntervals end at once when it is set.
    pub(crate) cancel: Cancel,
}

/// What rays like.
const TRIANGLES_A_CELL: f32 = 4.0;
/// What slices like, which look at eight triangles at once: measured on rods and a weave; 16 take up to 4 % longer.
const TRIANGLES_A_SLICED_CELL: f32 = 28.0;
const MAX_CELLS_A_SIDE: i32 = 512;

impl PeriodicGrid {
    /// OcclusionIntervals of the whole mesh, which can take long, give up when `cancel` is set; what they found is then worthless.
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
        let corners = corners(mesh);
        let solid = solid(mesh, &corners);
        let extent = |&t: &u32| {
            let [a, b, c] = corners[t as usize].map(|p| p.truncate());
            let extent = a.max(b).max(c) - a.min(b).min(c);
            f64::from(extent.x * extent.y)
        };
        let boxes = solid.iter().map(extent).sum();
        let cells = cell_counts(mesh.size, solid.len(), boxes, triangles_a_cell);
        Self::of_solid(mesh, corners, &solid, cells)
    }

    /// The cells that [`Self::new`] makes for a mesh of so many triangles, all solid, that lie beside each other as those of a
    /// height-field do.
    pub(crate) fn cells_beside_each_other(tile_size: Vec2, triangles: usize) -> IVec2 {
        let boxes = 2.0 * f64::from(tile_size.x * tile_size.y);
        cell_counts(tile_size, triangles, boxes, TRIANGLES_A_CELL)
    }

    /// As if the triangles of `part` were those of a mesh with this highest z and these cells: a cell that none of the others
    /// reach into lists the same.
    pub(crate) fn of_part(part: &TileMesh, cells: IVec2, top: f32) -> Self {
        let corners = corners(part);
        let solid = solid(part, &corners);
        Self { top, ..Self::of_solid(part, corners, &solid, cells) }
    }

    fn of_solid(mesh: &TileMesh, corners: Vec<[Vec3; 3]>, solid: &[u32], cells: IVec2) -> Self {
        let cell_size = mesh.size / cells.as_vec2();
        let top = solid.iter().map(|&t| highest(&corners[t as usize])).fold(f32::NEG_INFINITY, f32::max);
        let CellLists { starts, entries, z_max } = CellLists::new(&corners, solid, cells, cell_size);
        let cancel = Cancel::default();
        Self { tile_size: mesh.size, cells, cell_size, starts, entries, z_max, top, corners, cancel }
    }

    /// The cell of a place in the plane, in the base period.
    pub(crate) fn cell_of(tile_size: Vec2, cells: IVec2, place: Vec2) -> IVec2 {
        (place / (tile_size / cells.as_vec2())).floor().as_ivec2().rem_euclid(cells)
    }

    /// Distance after which a walk along the unit plane direction `along` meets the same again; without end unless it follows
    /// an axis.
    pub(crate) fn period_along(&self, along: Vec2) -> f32 {
        let axis = |across: f32, side: f32| if across.abs() < 1e-6 { 1.001 * side } else { f32::INFINITY };
        axis(along.y, self.tile_size.x).min(axis(along.x, self.tile_size.y))
    }

    pub(crate) fn entries(&self, cell: usize) -> &[CellEntry] {
        &self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// The first entry of each cell, with the end of all; and the entries.
    pub(crate) fn all_entries(&self) -> (&[u32], &[CellEntry]) {
        (&self.starts, &self.entries)
    }

    /// Corners of the copy that an entry names, seen from the tile copy `at` (in tiles).
    pub(crate) fn copy_corners(&self, entry: CellEntry, at: IVec2) -> [Vec3; 3] {
        let shift = (at + IVec2::new(i32::from(entry.shift[0]), i32::from(entry.shift[1]))).as_vec2() * self.tile_size;
        self.corners[entry.triangle as usize].map(|p| p + shift.extend(0.0))
    }
}

/// A key that puts numbers in the order of `total_cmp`, the highest first.
fn descending(z: f32) -> u32 {
    let bits = z.to_bits();
    if bits >> 31 == 0 { !(bits | 1 << 31) } else { bits }
}

fn corners(mesh: &TileMesh) -> Vec<[Vec3; 3]> {
    (0..mesh.triangles.len()).into_par_iter().with_min_len(A_THREAD).map(|t| mesh.corners(t)).collect()
}

/// Triangles with a place and an area, from the highest down: walks can leave the rest of a cell out. The triangle's number
/// decides between equals.
fn solid(mesh: &TileMesh, corners: &[[Vec3; 3]]) -> Vec<u32> {
    let triangles = (0..corners.len()).into_par_iter().with_min_len(A_THREAD);
    let is_solid = |t: &usize| corners[*t].iter().all(|p| p.is_finite()) && mesh.triangle_area(*t) > 0.0;
    let key = |t: usize| u64::from(descending(highest(&corners[t]))) << 32 | t as u64;
    let mut keys: Vec<u64> = triangles.filter(is_solid).map(key).collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|key| key as u32).collect()
}

/// A few triangles a cell, following the tile's shape, and no finer than a large triangle warrants; `boxes` is the area of the
/// triangles' bounds.
fn cell_counts(tile_size: Vec2, triangles: usize, boxes: f64, triangles_a_cell: f32) -> IVec2 {
    let wanted = (triangles as f32 / triangles_a_cell).max(16.0);
    // Grid density must not let a few huge triangles fill the entry list: bound the summed bounding-box areas.
    let boxes = boxes / f64::from(tile_size.x * tile_size.y).max(f64::MIN_POSITIVE);
    let wanted = wanted.min((4e7 / boxes.max(1e-3)) as f32);
    let aspect = (tile_size.x / tile_size.y).clamp(1.0 / 64.0, 64.0);
    let x = (wanted * aspect).sqrt().round() as i32;
    let y = (wanted / aspect).sqrt().round() as i32;
    IVec2::new(x, y).clamp(IVec2::ONE, IVec2::splat(MAX_CELLS_A_SIDE))
}

/// Walks the grid's cells from a point along a plane direction; endless, the caller stops.
#[derive(Debug)]
pub(crate) struct CellWalk {
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
