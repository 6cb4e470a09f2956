//! Periodic grid of the tile's triangles, and rays through the endless tiling.

pub(crate) mod cell_lists;
#[cfg(test)]
mod cell_lists_tests;
mod nearest;
pub(crate) mod periodic_grid;
pub(crate) mod ray_cast;
mod surface_point;

pub use nearest::Hit;
pub use periodic_grid::PeriodicGrid;
pub use ray_cast::{is_facet_visible, lifted_origins};
pub use surface_point::SurfacePoint;
