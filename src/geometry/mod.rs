//! From a geometry description to a periodic triangle mesh, and from the mesh to facets.

mod builder;
pub mod closure;
mod facet_order;
mod facets;
mod flat;
mod grooves;
pub mod heightfield;
pub mod image_file;
pub(crate) mod kd_tree;
mod mesh_file;
mod normal_bins;
pub mod obj;
mod pyramids;
mod rods;
mod symmetry;
mod tile_mesh;
mod voronoi;
mod weave;

#[cfg(test)]
mod height_images;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::sync::Arc;

pub use facets::{FacetSampler, Facets, SampleShift};
pub use grooves::CrossSection;
pub use pyramids::OnePyramid;
pub use symmetry::mirror_planes;
pub use tile_mesh::{ColorField, HeightGrid, TileMesh};

use crate::error::{InputError, Result};
use crate::scene::{Geometry, Painted, Tile};

/// The mesh of a tile; `base_dir` is the scene file's folder, where relative paths start.
///
/// # Errors
/// A file that is missing or not what it should be.
pub fn build(tile: &Tile, base_dir: &Path) -> Result<TileMesh> {
    build_painted(tile, base_dir, &Painted::default())
}

/// As [`build`], with images in memory in place of the files that the geometry names.
///
/// # Errors
/// As [`build`].
pub fn build_painted(tile: &Tile, base_dir: &Path, painted: &Painted) -> Result<TileMesh> {
    let size = tile.size;
    let (mut mesh, color_path) = match &tile.geometry {
        Geometry::Grooves(spec) => (grooves::build(spec, size), None),
        Geometry::Pyramids(spec) => (pyramids::build(spec, size), None),
        Geometry::Rods(spec) => (rods::build(spec, size), None),
        Geometry::Weave(spec) => (weave::build(spec, size), None),
        Geometry::Heightfield(spec) => {
            let mesh = match &painted.heights {
                Some(heights) => heightfield::build_painted(spec, size, heights),
                None => heightfield::build(spec, size, base_dir)?,
            };
            (mesh, spec.color_path.as_deref())
        }
        Geometry::Flat(spec) => (flat::build(spec, size), spec.color_path.as_deref()),
        Geometry::Mesh(spec) => (mesh_file::build(spec, size, base_dir)?, spec.color_path.as_deref()),
    };
    let takes_colors = matches!(&tile.geometry, Geometry::Heightfield(_) | Geometry::Flat(_) | Geometry::Mesh(_));
    if let (true, Some(image)) = (takes_colors, &painted.colors) {
        mesh.color = ColorField::Image { size: image.size, texels: Arc::new(image.values.clone()) };
    } else if let Some(path) = color_path {
        let image = image_file::read_colors(base_dir, path)?;
        mesh.color = ColorField::Image { size: image.size, texels: Arc::new(image.values) };
    }
    check_extent(&mesh).map_err(|error| match &tile.geometry {
        Geometry::Mesh(spec) => error.in_file(&spec.path),
        _ => error,
    })?;
    Ok(mesh)
}

/// Tile lengths that a mesh may reach up, down and sideways: beyond, an f32 cannot tell places within a tile apart at
/// grazing angles (a height of 10⁴ tiles lands 6 10⁶ tiles away at 89.9°).
const MOST_TILES: f32 = 1e4;
/// Tiles that the bounding boxes of all triangles may cover together: each copy is listed by every cell that it reaches.
const MOST_TILES_COVERED: f64 = 1e7;

/// Is there something finite, near enough to the tile to compute with?
fn check_extent(mesh: &TileMesh) -> std::result::Result<(), InputError> {
    let complain = |found: String, expected: String| Err(InputError::new("tile.geometry", found, expected));
    let side = mesh.size.max_element();
    for (number, position) in mesh.positions.iter().enumerate() {
        let sideways = (position.truncate() / mesh.size).abs().max_element();
        // Comparisons that NaN fails.
        if !(sideways <= MOST_TILES && position.z.abs() <= MOST_TILES * side) {
            let found = format!("vertex {} at ({}, {}, {})", number + 1, position.x, position.y, position.z);
            return complain(found, format!("finite coordinates within {MOST_TILES} tile lengths of the tile"));
        }
    }
    let covered = |triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|corner| corner.truncate() / mesh.size);
        let [x, y] = (a.max(b).max(c) - a.min(b).min(c)).ceil().as_dvec2().to_array();
        x * y
    };
    let tiles: f64 = (0..mesh.triangles.len()).map(covered).sum();
    if tiles > MOST_TILES_COVERED {
        return complain(
            format!("triangles that reach over {tiles:.0} tiles together"),
            format!("at most {MOST_TILES_COVERED:.0}; coordinates are tile coordinates, from 0 to tile.size"),
        );
    }
    Ok(())
}
