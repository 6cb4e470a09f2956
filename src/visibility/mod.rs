//! Which facets of the endlessly repeated tile does a direction see?

mod packed;
mod shadow_map;
#[cfg(test)]
mod shadow_map_tests;
mod shadow_view;

pub use packed::PackedVisibility;
pub use shadow_map::visibility_maps_cpu;
