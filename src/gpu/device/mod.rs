//! The graphics processor: one device without a window, plain WGSL shaders, buffers up and down.
//!
//! What the machine has is decided once, as a [`Tier`], when [`Gpu::open`] is called; nothing else asks for features.
//! Every stage that runs here has a twin on the CPU, and no failure here is a panic: [`GpuError`] says what happened and
//! the caller falls back.

mod adapter;
mod buffers;
mod error;
pub mod pipelines;
mod shaders;

pub use adapter::{Gpu, Tier};
pub use error::GpuError;
pub use shaders::{SHADERS, Swaps, shader_source, swapped_source};
