//! Ray-cast ground truth with its own standard error: the sum over facets, and paths between facets.

mod glimpse;
mod paths;
mod ray_cast;

pub use glimpse::Glimpse;
pub use ray_cast::{Estimate, Reference, ReferenceSettings};
