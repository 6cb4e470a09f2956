//! GPU access: opening a GPU, WGSL shaders, pipelines, and buffer transfers.
//!
//! [`Gpu::open`] determines the [`Tier`] of the machine once; no other code tests for features. No failure of the GPU
//! is a panic: functions return a [`GpuError`], and the caller falls back to the CPU twin.

mod adapter;
mod buffers;
pub mod pipelines;
mod shaders;

pub use crate::base::GpuError;
pub use adapter::{Gpu, Tier};
pub use shaders::{SHADERS, Swaps, shader_source, swapped_source};
