//! A tile under a colour map at every distance (Heitz et al. 2013): the height field low-passed with the pixel is
//! geometry, and the rest is filtered in the plane of its slope. Far away nothing but `f̄` is left, without a transition.

mod calibration;
mod methods;
mod object;
mod radiance;
mod surface;
#[cfg(test)]
mod tests;
mod zoom;

pub use calibration::{Calibration, Corrections};
pub use object::PixelOnTile;
pub use radiance::PixelMaterials;
pub use surface::FilteredTile;
pub use zoom::ZoomTarget;
