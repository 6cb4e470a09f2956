//! An object that carries the material, the lights on it, and the image of it.

pub mod image;
pub mod lighting;
pub mod object;
mod scene;
pub mod shadow;
pub mod tile_view;

pub use image::camera::CameraView;
pub use image::gbuffer::GBuffer;
pub use image::image_file::Image;
pub use image::render::{RenderInput, Rendered, render};
pub use lighting::light_choice::FAINT_PART;
pub use lighting::lights::DirectionalLight;
pub use object::ObjectMesh;
pub use scene::RenderScene;
