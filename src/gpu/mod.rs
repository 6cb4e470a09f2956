//! The graphics processor: device, visibility, shading and whole images. Every stage here has a CPU twin.

pub mod device;
pub mod render;
pub mod shading;
pub mod visibility;

pub use device::{Gpu, GpuError, SHADERS, Swaps, Tier, shader_source, swapped_source};
pub use render::renderer::{GpuRenderer, render_gpu};
pub use visibility::{GpuHeightMarch, GpuHorizonMap, GpuMaps, GpuShadowMaps, GpuSlicer, visibility_maps_gpu};
