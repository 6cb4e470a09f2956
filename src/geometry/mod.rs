//! Geometry of the small scale: from a description to a periodic triangle mesh, and from the mesh to facets.

pub mod closure;
pub mod facets;
pub mod families;
pub mod grid;
mod hierarchy;
pub mod image_file;
pub mod relief;
mod symmetry;
mod tile_mesh;

#[cfg(test)]
mod height_images;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use facets::{FacetSampler, Facets, REPLICATES, SampleShift};
pub use families::grooves::GrooveCrossSection;
pub use families::pyramids::PyramidLayout;
use families::{flat, grooves, heightfield, mesh_file, pyramids, rods, weave};
pub use grid::{Hit, PeriodicGrid, SurfacePoint, is_facet_visible, lifted_origins};
pub use symmetry::{mirror_planes, mirror_planes_in};
pub(crate) use tile_mesh::SAME_NORMAL;
pub use tile_mesh::{ColorField, HeightGrid, SlotField, TileMesh};

use crate::base::{InputError, Result};
use crate::scene::{self, Geometry, Painted, Pixels, Tile};

/// Builds the mesh of a tile. Relative paths start in `base_dir`, the scene file's folder.
///
/// # Errors
/// Returns an error if a file is missing or invalid, or if the mesh is too large.
pub fn build(tile: &Tile, base_dir: &Path) -> Result<TileMesh> {
    build_painted(tile, base_dir, &Painted::default())
}

/// Builds the mesh as [`build`] does, with images in memory instead of the files that the tile names.
///
/// # Errors
/// Returns the errors of [`build`].
pub fn build_painted(tile: &Tile, base_dir: &Path, painted: &Painted) -> Result<TileMesh> {
    let size = tile.size;
    let mut mesh = match &tile.geometry {
        Geometry::Grooves(spec) => grooves::build(spec, size),
        Geometry::Pyramids(spec) => pyramids::build(spec, size),
        Geometry::Rods(spec) => rods::build(spec, size),
        Geometry::Weave(spec) => weave::build(spec, size),
        Geometry::Heightfield(spec) => match &painted.heights {
            Some(heights) => heightfield::build_painted(spec, size, heights),
            None => heightfield::build(spec, size, base_dir)?,
        },
        Geometry::Flat(spec) => flat::build(spec, size),
        Geometry::Mesh(spec) => mesh_file::build(spec, size, base_dir)?,
    };
    let file = |path: &PathBuf| image_file::read_colors(base_dir, path);
    if let Some(image) = painted_or_file(&painted.colors, &tile.color_path, file)? {
        mesh.color = ColorField::Image { size: image.size, texels: Arc::new(image.values) };
    }
    let file = |path: &PathBuf| image_file::read_slots(base_dir, path);
    if let Some(image) = painted_or_file(&painted.slots, &tile.slot_path, file)? {
        paint_slots(&mut mesh, image);
    }
    check_extent(&mesh).map_err(|error| match &tile.geometry {
        Geometry::Mesh(spec) => error.in_file(scene::files::resolve(base_dir, &spec.path)),
        _ => error,
    })?;
    Ok(mesh)
}

/// Returns the painted image in memory if there is one, else the file's image if the tile names a file.
fn painted_or_file<T: Clone>(
    painted: &Option<Arc<Pixels<T>>>,
    path: &Option<PathBuf>,
    read: impl Fn(&PathBuf) -> Result<Pixels<T>>,
) -> Result<Option<Pixels<T>>> {
    match painted {
        Some(image) => Ok(Some((**image).clone())),
        None => path.as_ref().map(read).transpose(),
    }
}

/// Adds the slots `paint_1`, `paint_2` and so on of an image over the slots of the surface.
fn paint_slots(mesh: &mut TileMesh, image: Pixels<u8>) {
    let first = mesh.slots.len() as u16;
    let count = image.values.iter().copied().max().unwrap_or(0);
    mesh.slots.extend((1..=count).map(painted_slot));
    mesh.painted_slots = Some(SlotField { size: image.size, texels: Arc::new(image.values), first });
}

/// The name of a painted slot: `paint_1` to `paint_16`.
pub fn painted_slot(number: u8) -> String {
    format!("paint_{number}")
}

/// Maximum extent of a mesh in each direction, in tile lengths. Beyond it, an f32 cannot resolve positions within a
/// tile at grazing angles: at 89.9°, a height of 10⁴ tiles projects to a distance of 6 · 10⁶ tiles.
const MAX_TILES: f32 = 1e4;
/// Maximum number of tiles that the bounding boxes of all triangles cover together. It bounds the cell lists of the
/// grid.
const MAX_TILES_COVERED: f64 = 1e7;

/// Checks that all vertices are finite and near the tile, and that triangles do not reach over too many tiles.
fn check_extent(mesh: &TileMesh) -> std::result::Result<(), InputError> {
    let error_for = |found: String, expected: String| Err(InputError::new("tile.geometry", found, expected));
    let side = mesh.size.max_element();
    for (number, position) in mesh.positions.iter().enumerate() {
        let sideways = (position.truncate() / mesh.size).abs().max_element();
        // NaN fails these comparisons.
        if !(sideways <= MAX_TILES && position.z.abs() <= MAX_TILES * side) {
            let found = format!("vertex {} at ({}, {}, {})", number + 1, position.x, position.y, position.z);
            return error_for(found, format!("finite coordinates within {MAX_TILES} tile lengths of the tile"));
        }
    }
    let covered = |triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|corner| corner.truncate() / mesh.size);
        let [x, y] = (a.max(b).max(c) - a.min(b).min(c)).ceil().as_dvec2().to_array();
        x * y
    };
    let tiles: f64 = (0..mesh.triangles.len()).map(covered).sum();
    if tiles > MAX_TILES_COVERED {
        return error_for(
            format!("triangles that reach over {tiles:.0} tiles together"),
            format!("at most {MAX_TILES_COVERED:.0}; coordinates are tile coordinates, from 0 to tile.size"),
        );
    }
    Ok(())
}
