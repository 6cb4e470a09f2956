//! Objects that a viewer sees through: what lies behind them, blurred by their surface, and what they reflect.
//!
//! Only the surface that the viewer sees first is rendered, as by Dai et al. 2009. Light keeps its place while it passes,
//! because the slab is thin, and the object casts no shadow on what lies behind it.

mod backdrop;
#[cfg(test)]
mod comparison_tests;
mod image;
mod pyramid;
mod scene;
mod stage;
#[cfg(test)]
mod tests;

pub use backdrop::{Backdrop, BackdropFootprint, BackdropKernel, Plane};
pub use image::{Places, SeenThrough, render};
pub use pyramid::{Kernel, Pyramid};
pub use scene::SlabScene;
pub use stage::{BuildBackdrop, BuildView};
