//! Painting on images that wrap: brushes for heights, colours and materials. The module does not use the interface.

mod brush;
mod stroke;
#[cfg(test)]
mod tests;

pub use brush::{Brush, Tool};
pub use stroke::Stroke;

use crate::geometry::image_file;
use crate::scene::{Geometry, LoadedScene, Pixels};
use glam::{UVec2, Vec3};

/// Side of a new image of heights in pixels (128 in Wu et al. 2011, Sec. 5).
const NEW_SIDE: u32 = 128;
/// Side of a new image of colours or materials in pixels; larger, because their edges are visible.
const NEW_PRINT_SIDE: u32 = 256;

/// The heights at the start of painting: those of the scene, or a plane in the middle of the range.
///
/// # Errors
/// The scene's image cannot be read.
pub fn heights_of(loaded: &LoadedScene) -> crate::base::Result<Pixels<f32>> {
    if let Some(painted) = &loaded.painted.heights
        && matches!(loaded.scene.tile.geometry, Geometry::Heightfield(_))
    {
        return Ok((**painted).clone());
    }
    match &loaded.scene.tile.geometry {
        Geometry::Heightfield(field) => match (&field.path, &field.values) {
            (Some(path), _) => image_file::read_heights(&loaded.base_dir, path),
            (None, Some(rows)) if !rows.is_empty() => {
                let size = UVec2::new(rows[0].len() as u32, rows.len() as u32);
                Ok(Pixels { size, values: rows.concat() })
            }
            _ => Ok(blank(NEW_SIDE, 0.5)),
        },
        _ => Ok(blank(NEW_SIDE, 0.5)),
    }
}

/// The colours at the start of painting: those of the scene, or white.
///
/// # Errors
/// The scene's image cannot be read.
pub fn colors_of(loaded: &LoadedScene) -> crate::base::Result<Pixels<Vec3>> {
    match (&loaded.painted.colors, &loaded.scene.tile.color_path) {
        (Some(painted), _) => Ok((**painted).clone()),
        (None, Some(path)) => image_file::read_colors(&loaded.base_dir, path),
        (None, None) => Ok(blank(NEW_PRINT_SIDE, Vec3::ONE)),
    }
}

/// The slots at the start of painting: those of the scene, or the surface's own.
///
/// # Errors
/// The scene's image cannot be read.
pub fn slots_of(loaded: &LoadedScene) -> crate::base::Result<Pixels<u8>> {
    match (&loaded.painted.slots, &loaded.scene.tile.slot_path) {
        (Some(painted), _) => Ok((**painted).clone()),
        (None, Some(path)) => image_file::read_slots(&loaded.base_dir, path),
        (None, None) => Ok(blank(NEW_PRINT_SIDE, 0)),
    }
}

fn blank<T: Clone>(side: u32, value: T) -> Pixels<T> {
    Pixels { size: UVec2::splat(side), values: vec![value; (side * side) as usize] }
}

/// Converts any surface to heights from 0 to 1, viewed from above. Also returns the height that 1 represents.
pub fn relief_of(tile: &crate::render::tile_view::TileScene) -> (Pixels<f32>, f32) {
    let size = UVec2::splat(NEW_SIDE);
    let (low, high) = tile.mesh.z_range();
    let range = high - low;
    // The range leaves room for painting above and below the surface, even for a shallow one.
    let scale = (1.6 * range).max(0.15 * tile.mesh.size.min_element());
    let middle = 0.5 * (low + high);
    let values = tile.heights(size).iter().map(|z| (0.5 + (z - middle) / scale).clamp(0.0, 1.0)).collect();
    (Pixels { size, values }, scale)
}
