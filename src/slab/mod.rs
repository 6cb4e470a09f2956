//! Light through a thin transparent slab with two rough faces (Dai et al. 2009).
//!
//! Conventions: `i` points to the light, `o` to the viewer, z points up from the top face. A facet has the slope
//! `m = h.xy / h.z` of its normal `h`, which points up on both faces. `eta` is the index of the slab over that of its
//! surroundings. `ρ(i, o)` is the BTDF [1/sr], and `f̄ = ρ |cos θ_i|`.

pub mod capture;
mod choose;
mod dual;
mod ellipse;
mod even_numbers;
mod faces;
mod from_geometry;
pub mod fresnel;
pub mod half_vectors;
#[cfg(test)]
mod hard_cases_tests;
mod inner;
mod lobe;
mod model;
mod ndf;
mod optics;
mod ray_sums;
mod ring_table;
mod rows;
mod slope_table;
mod smith;
mod spread;
mod straight;
pub mod table_file;
mod view;
mod virtual_face;
pub(crate) mod walk;

pub use choose::dual_error;
pub use dual::{Configuration, DualFaces, blend, leaving_bottom, masking, rough_bottom, rough_top, walter};
pub use ellipse::{Ellipse, Profile};
pub use faces::{FaceSum, Order};
pub use from_geometry::of_mesh;
pub use inner::{Inner, Parts};
pub use lobe::{DiscGrid, DiscLobe};
pub use model::{Method, Slab, alpha_of};
pub use ndf::{Ndf, normal};
pub use optics::{Channel, Optics};
pub use rows::SlabRow;
pub use slope_table::SlopeTable;
pub use spread::Spread;
pub use straight::{Straight, straight};
pub use view::{BtdfView, SlabView};
pub use virtual_face::virtual_face;
pub use walk::{ChannelSlab, Exit, Tally};
