//! Height-fields from images or lists of values.

use std::path::Path;

use glam::{UVec2, Vec2, Vec3};

use super::image_file::{self, Pixels};
use super::{HeightGrid, TileMesh};
use crate::error::{InputError, Result};
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

/// As [`build`], from heights in memory.
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

/// Two triangles a cell, between samples; the last row and column reach over the tile's edge to the first.
pub fn from_grid(grid: HeightGrid, size: Vec2) -> TileMesh {
    let (width, height) = (grid.size.x as usize, grid.size.y as usize);
    let step = size / grid.size.as_vec2();
    let mut positions = Vec::with_capacity((width + 1) * (height + 1));
    for j in 0..=height {
        for i in 0..=width {
            let xy = (Vec2::new(i as f32, j as f32) + 0.5) * step;
            positions.push(xy.extend(grid.heights[(j % height) * width + i % width]));
        }
    }
    let index = |i: usize, j: usize| (j * (width + 1) + i) as u32;
    let mut triangles = Vec::with_capacity(2 * width * height);
    for j in 0..height {
        for i in 0..width {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
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

/// A height-field from a function of tile coordinates: for tests and examples.
pub fn from_function(samples: UVec2, size: Vec2, height: impl Fn(Vec2) -> f32) -> TileMesh {
    let at = |k: u32| Vec2::new((k % samples.x) as f32 + 0.5, (k / samples.x) as f32 + 0.5) / samples.as_vec2() * size;
    from_grid(HeightGrid { size: samples, heights: (0..samples.x * samples.y).map(|k| height(at(k))).collect() }, size)
}

/// Places of the samples: `((i+½)/w, (j+½)/h)` of the tile.
pub fn sample_position(grid: &HeightGrid, index: usize, size: Vec2) -> Vec3 {
    let (i, j) = (index % grid.size.x as usize, index / grid.size.x as usize);
    ((Vec2::new(i as f32, j as f32) + 0.5) * size / grid.size.as_vec2()).extend(grid.heights[index])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closure::assert_closes_plane;

    #[test]
    fn samples_sit_at_texel_centres_with_row_0_at_y_0() {
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
    fn any_grid_closes_the_plane_without_overhang() {
        for samples in [UVec2::new(1, 1), UVec2::new(2, 5), UVec2::new(33, 17)] {
            let mesh = from_function(samples, Vec2::new(1.0, 0.7), |p| (p.x * 12.0).sin() * (p.y * 31.0).cos());
            assert_closes_plane(&mesh);
            assert!(mesh.is_height_field());
            assert_eq!(mesh.triangles.len() as u32, 2 * samples.x * samples.y);
        }
    }
}
