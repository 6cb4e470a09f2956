//! The part of a height field below given points.

use std::ops::RangeInclusive;

use glam::{IVec2, Vec2};

use super::heightfield::is_mesh_of;
use crate::geometry::{HeightGrid, PeriodicGrid, TileMesh};

/// Maximum number of samples per side. With more, neighbouring samples could coincide in f32.
const MAX_SAMPLES_PER_SIDE: u32 = 1 << 16;

/// The triangles of a height field that reach into the cells of the points, in their order, and a grid of them. For
/// vertical rays at these points, the grid gives the same hits as a grid of the whole mesh. `None` if the mesh was
/// not built from its samples.
pub(crate) fn part_below(mesh: &TileMesh, points: impl Iterator<Item = Vec2>) -> Option<(TileMesh, PeriodicGrid)> {
    let heights = mesh.height_grid.as_ref()?;
    if heights.size.max_element() > MAX_SAMPLES_PER_SIDE || !is_mesh_of(mesh, heights) {
        return None;
    }
    let cells = PeriodicGrid::height_field_cells(mesh.size, mesh.triangles.len());
    let mut needed: Vec<[i32; 2]> =
        points.map(|point| PeriodicGrid::cell_of(mesh.size, cells, point).to_array()).collect();
    needed.sort_unstable();
    needed.dedup();
    let mut triangles: Vec<u32> =
        needed.iter().flat_map(|cell| triangles_in_cell(heights, (*cell).into(), cells)).collect();
    triangles.sort_unstable();
    triangles.dedup();
    let part = part_of(mesh, &triangles);
    let grid = PeriodicGrid::of_part(&part, cells, mesh.z_range().1);
    Some((part, grid))
}

/// Triangles that reach into a cell.
fn triangles_in_cell(heights: &HeightGrid, cell: IVec2, cells: IVec2) -> impl Iterator<Item = u32> {
    let [width, height] = heights.size.to_array().map(|side| side as i32);
    let columns = samples(cell.x, cells.x, width);
    samples(cell.y, cells.y, height).flat_map(move |j| {
        columns.clone().flat_map(move |i| {
            let first = 2 * (j.rem_euclid(height) * width + i.rem_euclid(width)) as u32;
            [first, first + 1]
        })
    })
}

/// The first samples of triangles that reach into a cell along one axis. Triangles reach from a sample's centre to the
/// next one's. The grid lists triangles within a thousandth of a cell.
fn samples(cell: i32, cells: i32, count: i32) -> RangeInclusive<i32> {
    let sample = |at: f64| (at / f64::from(cells) * f64::from(count) - 0.5).floor() as i32;
    let (first, last) = (sample(f64::from(cell) - 0.01), sample(f64::from(cell) + 1.01));
    first..=last.min(first + count - 1)
}

fn part_of(mesh: &TileMesh, triangles: &[u32]) -> TileMesh {
    let corners = triangles.iter().flat_map(|triangle| mesh.corners(*triangle as usize));
    TileMesh {
        size: mesh.size,
        positions: corners.collect(),
        triangles: (0..triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
        triangle_slot: triangles.iter().map(|triangle| mesh.triangle_slot[*triangle as usize]).collect(),
        color: mesh.color.clone(),
        painted_slots: mesh.painted_slots.clone(),
        ..TileMesh::default()
    }
}
