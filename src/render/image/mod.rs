//! Rendering on the CPU: G-buffer, shading points, shadows, shading, tone map.

pub mod camera;
pub mod gbuffer;
mod interpolated;
pub mod pixels;
pub mod raster;
pub mod render;
pub mod shading;
pub mod shading_points;
pub mod tone_map;
