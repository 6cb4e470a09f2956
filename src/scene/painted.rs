//! Images in memory that replace the image files of a tile; the editor paints them.

use std::sync::Arc;

use glam::{UVec2, Vec3};

/// An image as an array of values.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixels<T> {
    pub size: UVec2,
    /// Values row by row; row 0 is the first row of the file.
    pub values: Vec<T>,
}

/// Images in memory that replace files of the tile, which may not exist on disk. An image is used only if the geometry
/// has a key for such a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Painted {
    /// Replaces `path` or `values` of a height field.
    pub heights: Option<Arc<Pixels<f32>>>,
    /// Replaces `color_path`: linear colour weights.
    pub colors: Option<Arc<Pixels<Vec3>>>,
    /// Replaces `slot_path`: 0 is the surface's own slot, k the slot `paint_k`.
    pub slots: Option<Arc<Pixels<u8>>>,
}
