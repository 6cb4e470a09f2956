//! GPU access, visibility, shading and image rendering. Every stage here has a CPU twin.

#[cfg(feature = "gpu")]
mod access;
#[cfg(feature = "gpu")]
pub mod color_map;
#[cfg(feature = "gpu")]
pub mod device;
#[cfg(feature = "gpu")]
pub mod render;
#[cfg(feature = "gpu")]
pub mod seen_through;
#[cfg(feature = "gpu")]
pub mod shading;
#[cfg(feature = "gpu")]
pub mod visibility;

#[cfg(feature = "gpu")]
pub use device::{Gpu, GpuError, SHADERS, Swaps, Tier, shader_source, swapped_source};
#[cfg(feature = "gpu")]
pub use render::renderer::{GpuRenderer, render_gpu};
#[cfg(feature = "gpu")]
pub use visibility::{GpuHeightMarch, GpuHorizonMap, GpuMaps, GpuShadowMaps, GpuSlicer, visibility_maps_gpu};

use crate::pipeline::Pipeline;

/// A pipeline that opens the GPU of the machine when a scene first needs it. Without the feature `gpu` it runs on the
/// CPU.
pub fn pipeline() -> Pipeline {
    #[cfg(feature = "gpu")]
    return Pipeline::new().with_gpu_opener(access::open);
    #[cfg(not(feature = "gpu"))]
    Pipeline::new()
}
