//! Rays through the endlessly repeated tile.

pub(crate) mod cell_lists;
#[cfg(test)]
mod cell_lists_tests;
mod nearest;
pub(crate) mod periodic_grid;
pub(crate) mod ray_cast;

pub use nearest::Hit;
pub use periodic_grid::PeriodicGrid;
pub use ray_cast::{lifted_origins, sees};
