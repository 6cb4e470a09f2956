//! From a geometry description to a periodic triangle mesh, and from the mesh to facets.

pub mod closure;
pub mod facets;
pub mod families;
pub mod grid;
pub mod image_file;
pub mod obj;
mod symmetry;
mod tile_mesh;

#[cfg(test)]
mod height_images;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use facets::{FacetSampler, Facets, SampleShift};
pub use families::grooves::CrossSection;
pub use families::pyramids::OnePyramid;
use families::{flat, grooves, heightfield, mesh_file, pyramids, rods, weave};
pub use grid::{Hit, PeriodicGrid, lifted_origins, sees};
pub use symmetry::{mirror_planes, mirror_planes_in};
pub(crate) use tile_mesh::SAME_NORMAL;
pub use tile_mesh::{ColorField, HeightGrid, SlotField, TileMesh};

use crate::base::{InputError, Result};
use crate::scene::{Geometry, Painted, Pixels, Tile};

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
    if let Some(image) = chosen(&painted.colors, &tile.color_path, file)? {
        mesh.color = ColorField::Image { size: image.size, texels: Arc::new(image.values) };
    }
    let file = |path: &PathBuf| image_file::read_slots(base_dir, path);
    if let Some(image) = chosen(&painted.slots, &tile.slot_path, file)? {
        paint_slots(&mut mesh, image);
    }
    check_extent(&mesh).map_err(|error| match &tile.geometry {
        Geometry::Mesh(spec) => error.in_file(&spec.path),
        _ => error,
    })?;
    Ok(mesh)
}

/// What was painted in memory, else what the file holds, if one is named.
fn chosen<T: Clone>(
    painted: &Option<Arc<Pixels<T>>>,
    path: &Option<PathBuf>,
    read: impl Fn(&PathBuf) -> Result<Pixels<T>>,
) -> Result<Option<Pixels<T>>> {
    match painted {
        Some(image) => Ok(Some((**image).clone())),
        None => path.as_ref().map(read).transpose(),
    }
}

/// Slots `paint_1` ... of an image over those of the surface.
fn paint_slots(mesh: &mut TileMesh, image: Pixels<u8>) {
    let first = mesh.slots.len() as u16;
    let most = image.values.iter().copied().max().unwrap_or(0);
    mesh.slots.extend((1..=most).map(painted_slot));
    mesh.painted_slots = Some(SlotField { size: image.size, texels: Arc::new(image.values), first });
}

/// The name of a slot that is painted: `paint_1` to `paint_16`.
pub fn painted_slot(number: u8) -> String {
    format!("paint_{number}")
}

/// Tile lengths that a mesh may reach up, down and sideways: beyond, an f32 cannot tell places within a tile apart at
/// grazing angles (a height of 10⁴ tiles lands 6 10⁶ tiles away at 89.9°).
const MAX_TILES: f32 = 1e4;
/// Tiles that the bounding boxes of all triangles may cover together: each copy is listed by every cell that it reaches.
const MAX_TILES_COVERED: f64 = 1e7;

/// Is there something finite, near enough to the tile to compute with?
fn check_extent(mesh: &TileMesh) -> std::result::Result<(), InputError> {
    let complain = |found: String, expected: String| Err(InputError::new("tile.geometry", found, expected));
    let side = mesh.size.max_element();
    for (number, position) in mesh.positions.iter().enumerate() {
        let sideways = (position.truncate() / mesh.size).abs().max_element();
        // Comparisons that NaN fails.
        if !(sideways <= MAX_TILES && position.z.abs() <= MAX_TILES * side) {
            let found = format!("vertex {} at ({}, {}, {})", number + 1, position.x, position.y, position.z);
            return complain(found, format!("finite coordinates within {MAX_TILES} tile lengths of the tile"));
        }
    }
    let covered = |triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|corner| corner.truncate() / mesh.size);
        let [x, y] = (a.max(b).max(c) - a.min(b).min(c)).ceil().as_dvec2().to_array();
        x * y
    };
    let tiles: f64 = (0..mesh.triangles.len()).map(covered).sum();
    if tiles > MAX_TILES_COVERED {
        return complain(
            format!("triangles that reach over {tiles:.0} tiles together"),
            format!("at most {MAX_TILES_COVERED:.0}; coordinates are tile coordinates, from 0 to tile.size"),
        );
    }
    Ok(())
}
