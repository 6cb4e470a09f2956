//! Tests of the cell lists against a sequential implementation.

use glam::{IVec2, UVec2, Vec2, Vec3};

use super::cell_lists::{CellEntry, CellLists};
use crate::geometry::families::heightfield;
use crate::geometry::{PeriodicGrid, TileMesh};

/// Lists that a sequential loop over triangles and cells builds.
struct Sequential {
    solid: Vec<u32>,
    lists: CellLists,
}

fn sequential(mesh: &TileMesh, cells: IVec2) -> Sequential {
    let corners: Vec<[Vec3; 3]> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
    let mut solid: Vec<(f32, u32)> = (0..corners.len() as u32)
        .filter(|&t| corners[t as usize].iter().all(|p| p.is_finite()) && mesh.triangle_area(t as usize) > 0.0)
        .map(|t| (corners[t as usize].iter().fold(f32::NEG_INFINITY, |z, p| z.max(p.z)), t))
        .collect();
    solid.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut lists = vec![(Vec::new(), f32::NEG_INFINITY); (cells.x * cells.y) as usize];
    for &(highest, t) in &solid {
        for_each_cell(&corners[t as usize].map(|p| p.truncate()), cells, mesh.size / cells.as_vec2(), |cell, shift| {
            lists[cell].0.push(CellEntry { triangle: t, shift: [shift.x as i16, shift.y as i16] });
            lists[cell].1 = lists[cell].1.max(highest);
        });
    }
    let ends = lists.iter().scan(0, |end, (entries, _)| {
        *end += entries.len() as u32;
        Some(*end)
    });
    let starts = [0].into_iter().chain(ends).collect();
    let z_max = lists.iter().map(|list| list.1).collect();
    let entries = lists.into_iter().flat_map(|list| list.0).collect();
    Sequential { solid: solid.into_iter().map(|(_, t)| t).collect(), lists: CellLists { starts, entries, z_max } }
}

fn for_each_cell(corners: &[Vec2; 3], cells: IVec2, size: Vec2, mut visit: impl FnMut(usize, IVec2)) {
    let low = corners[0].min(corners[1]).min(corners[2]) / size;
    let high = corners[0].max(corners[1]).max(corners[2]) / size;
    let slack = Vec2::splat(1e-3);
    let (first, last) = ((low - slack).floor().as_ivec2(), (high + slack).floor().as_ivec2());
    for y in first.y..=last.y {
        for x in first.x..=last.x {
            let cell = IVec2::new(x, y);
            if overlaps(corners, cell, size) {
                let tile = IVec2::new(x.div_euclid(cells.x), y.div_euclid(cells.y));
                let local = cell - tile * cells;
                visit((local.y * cells.x + local.x) as usize, -tile);
            }
        }
    }
}

fn overlaps(corners: &[Vec2; 3], cell: IVec2, size: Vec2) -> bool {
    let (centre, half) = ((cell.as_vec2() + 0.5) * size, size * 0.501);
    (0..3).all(|k| {
        let (a, b, c) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
        let axis = (b - a).perp();
        let radius = half.dot(axis.abs());
        let (edge, opposite, at) = (axis.dot(a), axis.dot(c), axis.dot(centre));
        at + radius >= edge.min(opposite) && at - radius <= edge.max(opposite)
    })
}

fn waves(samples: UVec2) -> TileMesh {
    heightfield::from_function(samples, Vec2::new(1.0, 0.7), |p| 0.1 * (p.x * 12.0).sin() * (p.y * 31.0).cos().round())
}

/// Height fields of several sizes, a mesh with triangles that have no area, are not finite or reach over many tiles, a
/// mesh of one triangle, and an empty mesh.
fn meshes() -> Vec<TileMesh> {
    let mut broken = waves(UVec2::new(60, 60));
    for (k, position) in broken.positions.iter_mut().enumerate() {
        match k % 97 {
            3 => position.z = f32::NAN,
            5 => position.x = f32::INFINITY,
            7 => *position = Vec3::new(0.5, 0.25, -0.0),
            8 => *position = Vec3::new(0.5, 0.25, 0.0),
            11 if k % 5 == 0 => *position += Vec3::new(3.0, -2.5, 0.1),
            _ => {}
        }
    }
    let mut one = waves(UVec2::new(1, 1));
    one.triangles.truncate(1);
    let mut none = one.clone();
    none.triangles.clear();
    vec![waves(UVec2::new(90, 50)), waves(UVec2::new(2, 3)), waves(UVec2::new(3000, 1)), broken, one, none]
}

#[test]
fn cell_lists_equal_those_of_a_sequential_loop_for_any_number_of_threads() {
    for mesh in meshes() {
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for grid in pool.install(|| [PeriodicGrid::new(&mesh), PeriodicGrid::for_slices(&mesh)]) {
                let Sequential { solid, lists } = sequential(&mesh, grid.cells);
                let cells = 0..lists.z_max.len();
                let expected = cells
                    .clone()
                    .map(|cell| &lists.entries[lists.starts[cell] as usize..lists.starts[cell + 1] as usize]);
                assert!(
                    cells.clone().map(|cell| grid.entries(cell)).eq(expected),
                    "{} triangles",
                    mesh.triangles.len()
                );
                assert_eq!(grid.z_max, lists.z_max);
                let built = CellLists::new(&grid.corners, &solid, grid.cells, grid.cell_size);
                assert_eq!(built, lists);
            }
        }
    }
}
