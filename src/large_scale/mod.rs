//! The large scale: an object that carries the material, the lights on it, and the picture of it.
//!
//! ```text
//! scene::Object ─▶ ObjectMesh ─▶ GBuffer ─▶ ShadingPoints ─▶ light visibility ─▶ radiance ─▶ Picture ─▶ PNG | EXR
//!                                  ▲                               ▲                ▲
//! scene::Camera ─▶ CameraView ─────┘      scene::Light ─▶ lights ──┴────────────────┘  (and a Reflectance)
//! ```
//!
//! World frame y up, right-handed. Each arrow is a plain function; [`render::render`] runs them all and times them.

pub mod bvh;
pub mod camera;
pub mod environment;
pub mod gbuffer;
mod gpu_band;
#[cfg(test)]
mod gpu_counts_tests;
mod gpu_gbuffer;
mod gpu_light_rays;
pub mod gpu_picture;
pub mod gpu_render;
#[cfg(test)]
mod gpu_render_tests;
mod gpu_shading;
#[cfg(test)]
mod gpu_shading_tests;
mod gpu_stages;
#[cfg(test)]
mod gpu_tests;
pub mod light_choice;
pub mod lights;
pub mod objects;
pub mod picture;
pub mod raster;
pub mod render;
pub mod shading;
pub mod shading_points;
pub mod shadow;
pub mod shadow_cache;
pub mod stage;
pub mod tone_map;
mod wide_bvh;

pub use camera::CameraView;
pub use gbuffer::GBuffer;
pub use gpu_render::{GpuRenderer, render_gpu};
pub use light_choice::FAINT_PART;
pub use lights::DirectionalLight;
pub use objects::ObjectMesh;
pub use picture::Picture;
pub use render::{RenderInput, Rendered, render};
pub use stage::Stage;
