//! Interreflection: light that facets send to each other before it leaves the tile. The paper leaves it out (Wu et al.
//! 2011, Sec. 6, Fig. 12).
//!
//! Rays from facets find the points that send light to them, and random walks from these points collect the light of
//! all directions of a table at once. Every facet of a walk reflects by its own BRDF. The table over light and view
//! directions is symmetric, as `G` is, and its values are added to the direct reflection.

mod gather;
mod mirrored;
mod sampler;
mod share;
mod table;
mod transport;
mod viewer_weights;
mod walk;

#[cfg(test)]
mod tests;

use glam::Vec3;

pub use gather::{gather, is_grey};
pub use sampler::LobeSampler;
pub use share::{BouncedShare, measure as measure_share};
pub use table::InterreflectionTable;
pub use transport::{MOST_RAYS_PER_USEFUL, Ray, Tracer, Transport, Vertex};
pub use walk::{WalkPoint, WalkedTile};

use crate::brdf::Brdf;
use crate::math::directions::ReducedGrid;

/// Resolution of interreflection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InterreflectionSettings {
    /// Number of elements: the facets that send and receive light.
    pub elements: usize,
    /// Number of rays that should meet another facet from an element that sees the sky.
    pub useful_rays: usize,
    /// Largest number of bounces; at least one.
    pub bounces: usize,
    /// Nodes of the table.
    pub grid: ReducedGrid,
    /// Planes x = const and y = const that map the tile to itself. Values that follow from this symmetry are not
    /// summed, and glossy rays have less noise.
    pub mirrors: [bool; 2],
}

/// The fraction of uniform light that a surface reflects: `∫ albedo(θ) 2 sin θ cos θ dθ`. It exceeds 1 if the BRDF creates
/// energy. The integral uses `rings` values of θ, with a quadrature of `samples²` points for each.
pub fn mean_albedo(brdf: &Brdf, rings: usize, samples: usize) -> Vec3 {
    let ring = |k: usize| {
        // Even steps of sin²θ.
        let sine = ((k as f32 + 0.5) / rings as f32).sqrt();
        brdf.directional_albedo(sine.asin(), samples)
    };
    (0..rings).map(ring).sum::<Vec3>() / rings as f32
}
