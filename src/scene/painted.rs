//! What an editor has painted over the images that a scene names.

use std::sync::Arc;

use glam::{UVec2, Vec3};

/// An image as numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixels<T> {
    pub size: UVec2,
    /// Row by row, row 0 first in the file.
    pub values: Vec<T>,
}

/// Images in memory that stand for files of the tile, which may not be on disk yet. Only where the geometry has a key for
/// such a file do they count.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Painted {
    /// In place of a height-field's `path` or `values`.
    pub heights: Option<Arc<Pixels<f32>>>,
    /// In place of `color_path`: linear colour weights.
    pub colors: Option<Arc<Pixels<Vec3>>>,
    /// In place of `slot_path`: 0 is the surface's own slot, k the slot `paint_k`.
    pub slots: Option<Arc<Pixels<u8>>>,
}
