//! Whole images on the GPU.

mod band;
pub(crate) mod gbuffer;
pub mod image;
mod light_rays;
pub mod renderer;
#[cfg(test)]
mod renderer_tests;
mod stages;
#[cfg(test)]
mod tests;
