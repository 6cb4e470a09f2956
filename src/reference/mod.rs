//! The ray-cast reference with its standard error: the sum over facets, and paths between facets.

pub mod color_map;
mod few_pairs;
mod paths;
pub mod photons;
mod ray_cast;
mod stochastic_reference;

pub use ray_cast::{Estimate, Reference, ReferenceSettings};
pub use stochastic_reference::StochasticReference;
