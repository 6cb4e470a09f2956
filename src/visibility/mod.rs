//! Which facets of the endlessly repeated tile does a direction see?

mod gpu_maps;
mod packed;
mod shadow_map;
#[cfg(test)]
mod shadow_map_tests;
mod shadow_view;

pub use gpu_maps::{GpuShadowMaps, visibility_maps_gpu};
pub use packed::PackedVisibility;
pub use shadow_map::visibility_maps_cpu;
