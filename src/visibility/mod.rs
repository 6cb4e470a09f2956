//! Which facets of the endlessly repeated tile does a direction see?

mod packed;

pub use packed::PackedVisibility;
