//! Colour maps filtered at every distance (Heitz et al. 2013): stops, their means under the distributions of what a
//! pixel sees, and the statistics of drivers. Nothing here depends on a tile.

mod distribution;
pub mod filter;
pub mod heights;
pub mod layers;
pub mod naive;
pub mod normal;
pub mod pixel;
mod prefiltered;
mod ranks;
pub mod reads;
pub mod slopes;
pub mod statistics;
pub(crate) mod stops;

pub use distribution::{Distribution, Normal, Tabulated};
pub use prefiltered::{DEVIATIONS, MEANS, PrefilteredTable};
pub use ranks::{Quantiles, gaussianize};
pub use stops::{Stop, StopMap};
