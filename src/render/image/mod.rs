//! From an object, lights and a material to an image.

pub mod camera;
pub mod gbuffer;
pub mod image_file;
pub mod raster;
pub mod render;
pub mod shading;
pub mod shading_points;
pub mod tone_map;
