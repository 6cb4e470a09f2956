//! Light that facets send to each other before it leaves the tile: what the paper leaves out (Wu et al. 2011, Sec. 6, Fig. 12).
//!
//! One bounce (light, facet, facet, viewer) takes both facets' own BRDFs. Of more bounces the first and the last facet keep
//! theirs, and those between reflect as matte surfaces of the same albedo. What comes out is smooth, so a coarse
//! table over light and viewer holds it; it is symmetric, as `G` is, and is added to what the facets reflect directly.

mod bounces;
mod mirrored;
mod table;
mod transport;

#[cfg(test)]
mod tests;

use glam::Vec3;

pub use bounces::{gather, is_grey};
pub use table::InterreflectionTable;
pub use transport::Transport;

use crate::brdf::Brdf;
use crate::math::directions::PolarGrid;

/// How finely facets exchange light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InterreflectionSettings {
    /// Points of the surface that send and receive.
    pub elements: usize,
    /// Directions that each looks into; even.
    pub rays: usize,
    /// Reflections between facets that are followed, at least one.
    pub bounces: usize,
    /// Nodes of the table.
    pub grid: PolarGrid,
    /// Planes x = const and y = const that mirror the tile: what they tell is not computed.
    pub mirrors: [bool; 2],
}

/// The part of uniform light that a surface reflects: `∫ albedo(θ) 2 sin θ cos θ dθ`, at most 1; over so many rings, each a
/// quadrature of `samples²` points.
pub fn mean_albedo(brdf: &Brdf, rings: usize, samples: usize) -> Vec3 {
    let ring = |k: usize| {
        // Equal parts of sin²θ.
        let sine = ((k as f32 + 0.5) / rings as f32).sqrt();
        brdf.directional_albedo(sine.asin(), samples)
    };
    ((0..rings).map(ring).sum::<Vec3>() / rings as f32).clamp(Vec3::ZERO, Vec3::ONE)
}

/// What interreflection adds to the reflected light of a tile, as a part of it: surfaces of this albedo, of which `hidden` is the
/// part of the hemisphere where they see each other. `Σ (ρ h)^k` is the mean over a tile under uniform light.
pub fn predicted_share(albedo: f64, hidden: f64) -> f64 {
    let once = (albedo * hidden).clamp(0.0, 0.999);
    once / (1.0 - once)
}
