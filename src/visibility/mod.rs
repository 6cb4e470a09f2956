//! Which facets of the endlessly repeated tile does a direction see?
//!
//! [`Horizons`] is what the rest of the program reads: for each facet and azimuth the elevations at which the sky is
//! blocked. It is made exactly, by slicing the tile ([`Horizons::scan`]), or from yes/no maps ([`Horizons::from_packed`]).

mod horizons;
mod packed;
mod periodic_grid;
mod ray_cast;
mod scan;

pub use horizons::Horizons;
pub use packed::PackedVisibility;
pub use periodic_grid::PeriodicGrid;
pub use ray_cast::{lifted_origins, ray_cast, sees};
