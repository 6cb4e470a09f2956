//! Height fields from images or lists of values.

use std::path::Path;

use glam::{UVec2, Vec2, Vec3};

use crate::base::{InputError, Result};
use crate::geometry::image_file::Pixels;
use crate::geometry::{HeightGrid, TileMesh, image_file};
use crate::scene::Heightfield;

pub fn build(spec: &Heightfield, size: Vec2, base_dir: &Path) -> Result<TileMesh> {
    let mut pixels = match (&spec.path, &spec.values) {
        (Some(path), _) => image_file::read_heights(base_dir, path)?,
        (None, Some(rows)) => from_rows(rows)?,
        (None, None) => {
            return Err(InputError::new(
                "tile.geometry",
                "no heights",
                "`path` (an image) or `values` (rows of heights)",
            )
            .into());
        }
    };
    pixels.values.iter_mut().for_each(|height| *height *= spec.height_scale);
    Ok(from_grid(HeightGrid { size: pixels.size, heights: pixels.values }, size))
}

/// Builds the mesh as [`build`] does, from heights in memory.
pub fn build_painted(spec: &Heightfield, size: Vec2, painted: &Pixels<f32>) -> TileMesh {
    let heights = painted.values.iter().map(|height| height * spec.height_scale).collect();
    from_grid(HeightGrid { size: painted.size, heights }, size)
}

fn from_rows(rows: &[Vec<f32>]) -> Result<Pixels<f32>> {
    let width = rows.first().map_or(0, Vec::len);
    if width == 0 || rows.iter().any(|row| row.len() != width) {
        return Err(
            InputError::new("tile.geometry.values", "rows of different lengths or none", "rows of one length").into()
        );
    }
    Ok(Pixels { size: UVec2::new(width as u32, rows.len() as u32), values: rows.concat() })
}

/// Builds the mesh with two triangles per cell between samples, which meet in the lower diagonal of the cell. The last row
/// and column reach over the tile's edge to the first.
///
/// The rule has no preferred direction: turning or mirroring the samples turns or mirrors the surface. Both diagonals give
/// a surface at the same distance from the bilinear one: t/√90 (root mean square) in a cell of twist t = (a + c) - (b + d).
/// The lower one is a valley, so that no horizon lies on it, and walks over the surface need not visit it.
pub fn from_grid(grid: HeightGrid, size: Vec2) -> TileMesh {
    let positions: Vec<Vec3> = positions(&grid, size).collect();
    let triangles: Vec<[u32; 3]> = triangles(&grid).collect();
    TileMesh {
        size,
        triangle_slot: vec![0; triangles.len()],
        positions,
        triangles,
        slots: vec!["default".to_owned()],
        height_grid: Some(grid),
        closes_plane: true,
        ..TileMesh::default()
    }
}

fn positions(grid: &HeightGrid, size: Vec2) -> impl Iterator<Item = Vec3> {
    let step = size / grid.size.as_vec2();
    let [width, height] = grid.size.to_array().map(|side| side as usize);
    (0..=height).flat_map(move |j| {
        let row = &grid.heights[j % height * width..][..width];
        (0..=width).map(move |i| {
            let xy = (Vec2::new(i as f32, j as f32) + 0.5) * step;
            xy.extend(if i < width { row[i] } else { row[0] })
        })
    })
}

/// Triangles of all cells. The cell between samples (i, j) and (i + 1, j + 1) has the triangles `2 (j width + i)` and
/// the next.
fn triangles(grid: &HeightGrid) -> impl Iterator<Item = [u32; 3]> {
    let size = grid.size;
    let index = move |i: u32, j: u32| j * (size.x + 1) + i;
    let height = move |i: u32, j: u32| grid.heights[((j % size.y) * size.x + i % size.x) as usize];
    let cell = move |i, j| {
        let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        let [za, zb, zc, zd] = corners.map(|(i, j)| height(i, j));
        let [a, b, c, d] = corners.map(|(i, j)| index(i, j));
        if za + zc <= zb + zd { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    (0..size.y).flat_map(move |j| (0..size.x).flat_map(move |i| cell(i, j)))
}

/// Returns whether the mesh equals that of [`from_grid`] for these samples, and all of them are finite.
pub(super) fn is_mesh_of(mesh: &TileMesh, grid: &HeightGrid) -> bool {
    mesh.positions.iter().all(|position| position.is_finite())
        && positions(grid, mesh.size).eq(mesh.positions.iter().copied())
        && triangles(grid).eq(mesh.triangles.iter().copied())
}

/// Builds a height field from a function of tile coordinates, for tests and examples.
pub fn from_function(samples: UVec2, size: Vec2, height: impl Fn(Vec2) -> f32) -> TileMesh {
    let at = |k: u32| Vec2::new((k % samples.x) as f32 + 0.5, (k / samples.x) as f32 + 0.5) / samples.as_vec2() * size;
    from_grid(HeightGrid { size: samples, heights: (0..samples.x * samples.y).map(|k| height(at(k))).collect() }, size)
}

/// Position of a sample: `((i+½)/w, (j+½)/h)` of the tile, at its height.
pub fn sample_position(grid: &HeightGrid, index: usize, size: Vec2) -> Vec3 {
    let (i, j) = (index % grid.size.x as usize, index / grid.size.x as usize);
    ((Vec2::new(i as f32, j as f32) + 0.5) * size / grid.size.as_vec2()).extend(grid.heights[index])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closure::assert_closes_plane;

    #[test]
    fn samples_lie_at_texel_centres_with_row_0_at_y_0() {
        let spec = Heightfield {
            values: Some(vec![vec![1.0, 2.0], vec![3.0, 4.0], vec![5.0, 6.0]]),
            height_scale: 0.5,
            ..Heightfield::default()
        };
        let mesh = build(&spec, Vec2::new(2.0, 3.0), Path::new("")).unwrap();
        assert!(mesh.positions.contains(&Vec3::new(0.5, 0.5, 0.5)));
        assert!(mesh.positions.contains(&Vec3::new(1.5, 2.5, 3.0)));
        // The copy of sample (0, 0) beyond both edges.
        assert!(mesh.positions.contains(&Vec3::new(2.5, 3.5, 0.5)));
        let grid = mesh.height_grid.clone().unwrap();
        for index in 0..6 {
            assert!(mesh.positions.contains(&sample_position(&grid, index, mesh.size)));
        }
    }

    #[test]
    fn any_grid_closes_the_plane_without_overhangs() {
        for samples in [UVec2::new(1, 1), UVec2::new(2, 5), UVec2::new(33, 17)] {
            let mesh = from_function(samples, Vec2::new(1.0, 0.7), |p| (p.x * 12.0).sin() * (p.y * 31.0).cos());
            assert_closes_plane(&mesh);
            assert!(mesh.is_height_field());
            assert_eq!(mesh.triangles.len() as u32, 2 * samples.x * samples.y);
        }
    }
}
