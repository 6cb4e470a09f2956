//! Visibility of a tile, computed on the GPU.

mod maps;
mod march;
#[cfg(test)]
mod shadow_map_tests;
mod slices;

pub use maps::{GpuMaps, GpuShadowMaps, visibility_maps_gpu};
pub use march::{GpuHeightMarch, GpuHorizonMap};
pub use slices::GpuSlicer;
