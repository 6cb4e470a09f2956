//! The large scale: the object that the tile covers, its lights, its shadows and images of it; and images of the tile.

pub mod image;
pub mod lighting;
pub mod object;
mod scene;
pub mod seen_through;
pub mod shadow;
pub mod stages;
pub mod tile_view;

pub use image::camera::CameraView;
pub use image::gbuffer::GBuffer;
pub use image::pixels::Image;
pub use image::render::{RenderInput, Rendered, render};
pub use lighting::lights::DirectionalLight;
pub use object::ObjectMesh;
pub use scene::RenderScene;
