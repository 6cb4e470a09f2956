//! Whole images on the GPU.

mod band;
#[cfg(test)]
mod counts_tests;
pub(crate) mod gbuffer;
mod light_rays;
pub mod picture;
pub mod renderer;
#[cfg(test)]
mod renderer_tests;
mod stages;
#[cfg(test)]
mod tests;
