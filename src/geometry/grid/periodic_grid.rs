//! A planar grid of the periodic tile's triangles. Vertical slices walk its cells; rays descend a hierarchy.

use std::sync::OnceLock;

use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::cell_lists::{CellEntry, CellLists, MIN_ITEMS_PER_TASK, highest};
use crate::base::Cancel;
use crate::geometry::TileMesh;
use crate::geometry::hierarchy::TileHierarchy;

/// A uniform grid over one period. Each cell lists every periodic copy of a triangle that reaches into it in xy.
#[derive(Debug)]
pub struct PeriodicGrid {
    pub(crate) tile_size: Vec2,
    pub(crate) cells: IVec2,
    pub(crate) cell_size: Vec2,
    starts: Vec<u32>,
    /// Entries by cell, each cell's from the highest to the lowest.
    entries: Vec<CellEntry>,
    /// Bound of z in each cell: the highest z of its triangles, inside the cell or outside.
    pub(crate) z_max: Vec<f32>,
    /// Highest z of the tile.
    pub(crate) top: f32,
    /// Corners of each triangle.
    pub(crate) corners: Vec<[Vec3; 3]>,
    /// Stops slices when it is set.
    pub(crate) cancel: Cancel,
    /// The hierarchy that rays descend, built for the first ray.
    rays: OnceLock<TileHierarchy>,
}

/// Mean number of triangles per cell, for vertical rays.
const TRIANGLES_PER_CELL: f32 = 4.0;
/// Mean number of triangles per cell, for slices. It is larger than for rays because slices test eight triangles at
/// once.
const TRIANGLES_PER_SLICED_CELL: f32 = 28.0;
const MAX_CELLS_PER_SIDE: i32 = 512;

impl PeriodicGrid {
    /// Lets `cancel` stop slices of the mesh, which can take long. The results of stopped slices are invalid.
    pub fn cancelled_by(mut self, cancel: &Cancel) -> Self {
        self.cancel = cancel.clone();
        self
    }

    /// Builds a grid with small cells. Triangles with corners that are not finite, or without area, block nothing.
    pub fn new(mesh: &TileMesh) -> Self {
        Self::with_cells(mesh, TRIANGLES_PER_CELL)
    }

    /// Builds a grid with larger cells, for slices.
    pub fn for_slices(mesh: &TileMesh) -> Self {
        Self::with_cells(mesh, TRIANGLES_PER_SLICED_CELL)
    }

    fn with_cells(mesh: &TileMesh, triangles_per_cell: f32) -> Self {
        let corners = corners(mesh);
        let solid = solid(mesh, &corners);
        let extent = |&t: &u32| {
            let [a, b, c] = corners[t as usize].map(|p| p.truncate());
            let extent = a.max(b).max(c) - a.min(b).min(c);
            f64::from(extent.x * extent.y)
        };
        let boxes = solid.iter().map(extent).sum();
        let cells = cell_counts(mesh.size, solid.len(), boxes, triangles_per_cell);
        Self::of_solid(mesh, corners, &solid, cells)
    }

    /// The cell counts of [`Self::new`] for a height field of `triangles` triangles, all solid.
    pub(crate) fn height_field_cells(tile_size: Vec2, triangles: usize) -> IVec2 {
        let boxes = 2.0 * f64::from(tile_size.x * tile_size.y);
        cell_counts(tile_size, triangles, boxes, TRIANGLES_PER_CELL)
    }

    /// Builds a grid of a part of a mesh with the cell counts and the highest z of the whole mesh. A cell lists the
    /// same triangles as in the whole mesh's grid if all of them are in the part.
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
        Self {
            tile_size: mesh.size,
            cells,
            cell_size,
            starts,
            entries,
            z_max,
            top,
            corners,
            cancel,
            rays: OnceLock::new(),
        }
    }

    /// Builds the hierarchy for rays now. Without it, the first ray builds it; if several threads begin to cast rays, each
    /// of them does so.
    pub(crate) fn prepare_rays(&self) {
        self.rays();
    }

    /// The hierarchy of the triangles, for rays.
    pub(super) fn rays(&self) -> &TileHierarchy {
        match self.rays.get() {
            Some(rays) => rays,
            None => {
                // Built outside of the lock: a thread that builds in parallel may meet a task that waits for the lock.
                let rays = TileHierarchy::new(&self.corners, self.tile_size);
                self.rays.get_or_init(|| rays)
            }
        }
    }

    /// The cell of a point of the plane, in the base period.
    pub(crate) fn cell_of(tile_size: Vec2, cells: IVec2, point: Vec2) -> IVec2 {
        (point / (tile_size / cells.as_vec2())).floor().as_ivec2().rem_euclid(cells)
    }

    /// Distance after which a walk along the unit plane direction `along` repeats; infinite unless the direction
    /// follows an axis or a diagonal of the tile.
    pub(crate) fn period_along(&self, along: Vec2) -> f32 {
        let tiles_per_length = (along / self.tile_size).abs();
        let (fewer, more) = (tiles_per_length.min_element(), tiles_per_length.max_element());
        let repeats = fewer < 1e-6 * more || more - fewer < 1e-6 * more;
        if repeats { 1.001 / more } else { f32::INFINITY }
    }

    pub(crate) fn entries(&self, cell: usize) -> &[CellEntry] {
        &self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// The index of each cell's first entry, with the end of the last cell, and the entries.
    #[cfg(feature = "gpu")]
    pub(crate) fn all_entries(&self) -> (&[u32], &[CellEntry]) {
        (&self.starts, &self.entries)
    }

    /// Corners of an entry's triangle copy, in the tile copy `at` (in tiles).
    pub(crate) fn copy_corners(&self, entry: CellEntry, at: IVec2) -> [Vec3; 3] {
        let shift = (at + IVec2::new(i32::from(entry.shift[0]), i32::from(entry.shift[1]))).as_vec2() * self.tile_size;
        self.corners[entry.triangle as usize].map(|p| p + shift.extend(0.0))
    }
}

/// Key that sorts numbers by `total_cmp`, the highest first.
fn descending(z: f32) -> u32 {
    let bits = z.to_bits();
    if bits >> 31 == 0 { !(bits | 1 << 31) } else { bits }
}

fn corners(mesh: &TileMesh) -> Vec<[Vec3; 3]> {
    (0..mesh.triangles.len()).into_par_iter().with_min_len(MIN_ITEMS_PER_TASK).map(|t| mesh.corners(t)).collect()
}

/// Triangles with finite corners and an area, from the highest to the lowest, so that walks can skip the rest of a
/// cell. Equal heights are in the order of triangles.
fn solid(mesh: &TileMesh, corners: &[[Vec3; 3]]) -> Vec<u32> {
    let triangles = (0..corners.len()).into_par_iter().with_min_len(MIN_ITEMS_PER_TASK);
    let is_solid = |t: &usize| corners[*t].iter().all(|p| p.is_finite()) && mesh.triangle_area(*t) > 0.0;
    let key = |t: usize| u64::from(descending(highest(&corners[t]))) << 32 | t as u64;
    let mut keys: Vec<u64> = triangles.filter(is_solid).map(key).collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|key| key as u32).collect()
}

/// Chooses the numbers of cells for `triangles_per_cell` triangles per cell and the tile's aspect ratio. `boxes` is the
/// summed area of the triangles' bounds.
fn cell_counts(tile_size: Vec2, triangles: usize, boxes: f64, triangles_per_cell: f32) -> IVec2 {
    let wanted = (triangles as f32 / triangles_per_cell).max(16.0);
    // Few large triangles must not fill the entry list: the summed area of the bounds limits the number of cells.
    let boxes = boxes / f64::from(tile_size.x * tile_size.y).max(f64::MIN_POSITIVE);
    let wanted = wanted.min((4e7 / boxes.max(1e-3)) as f32);
    let aspect = (tile_size.x / tile_size.y).clamp(1.0 / 64.0, 64.0);
    let x = (wanted * aspect).sqrt().round() as i32;
    let y = (wanted / aspect).sqrt().round() as i32;
    IVec2::new(x, y).clamp(IVec2::ONE, IVec2::splat(MAX_CELLS_PER_SIDE))
}

/// A walk over the grid's cells from a point along a plane direction. It never ends; the caller stops.
#[derive(Debug)]
pub(crate) struct CellWalk {
    /// Cell in the base period.
    local: IVec2,
    tile: IVec2,
    step: IVec2,
    next: Vec2,
    delta: Vec2,
    cells: IVec2,
    /// Distance at which the walk enters the current cell, in lengths of the direction.
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

    /// Index of the current cell in the base period, and its tile copy.
    #[inline(always)]
    pub fn cell(&self) -> (usize, IVec2) {
        ((self.local.y * self.cells.x + self.local.x) as usize, self.tile)
    }

    /// Advances to the next cell and returns the distance at which the walk enters it.
    #[inline(always)]
    pub fn advance(&mut self) -> f32 {
        // A step over the end of the period enters the next tile copy.
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
