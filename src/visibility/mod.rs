//! Which facets of the endlessly repeated tile does a direction see?
//!
//! [`Visibility`] is what the rest of the program reads: soft visibility of every facet along any direction, held as
//! horizons where nothing overhangs, as slices or as maps of bits where something does.

pub(crate) mod height_march;
mod horizon_map;
pub(crate) mod occlusion_intervals;
mod packed;
mod ray_cast;
pub(crate) mod scan;
mod shadow_map;
#[cfg(test)]
mod shadow_map_tests;
pub(crate) mod shadow_view;
pub(crate) mod slicer;
pub(crate) mod soft_maps;
mod stored;

use std::ops::Range;

use glam::Vec3;

pub use horizon_map::HorizonMap;
pub use occlusion_intervals::OcclusionIntervals;
pub use packed::PackedVisibility;
pub use ray_cast::ray_cast;
pub use shadow_map::visibility_maps_cpu;
pub use soft_maps::SoftMaps;

/// Visibility of all facets along any direction.
#[derive(Debug, Clone)]
pub enum Visibility {
    /// A flat tile: every facet sees everything.
    Unblocked {
        facets: usize,
    },
    HorizonMap(HorizonMap),
    OcclusionIntervals(OcclusionIntervals),
    Maps(SoftMaps),
}

impl Visibility {
    pub fn facets(&self) -> usize {
        match self {
            Self::Unblocked { facets } => *facets,
            Self::HorizonMap(horizons) => horizons.facets(),
            Self::OcclusionIntervals(slices) => slices.facets(),
            Self::Maps(maps) => maps.packed.facet_count,
        }
    }

    /// Part of the walks over the tile that ended before all was known ([`HorizonMap::truncated`]).
    pub fn truncated(&self) -> f64 {
        match self {
            Self::HorizonMap(horizons) => horizons.truncated(),
            Self::OcclusionIntervals(slices) => slices.horizons.truncated(),
            Self::Unblocked { .. } | Self::Maps(_) => 0.0,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Unblocked { .. } => 0,
            Self::HorizonMap(horizons) => horizons.bytes(),
            Self::OcclusionIntervals(slices) => slices.bytes(),
            Self::Maps(maps) => 4 * maps.packed.words.len(),
        }
    }

    /// That of some of the facets, in ascending order; `None` for maps, which are packed.
    pub(crate) fn picked(&self, facets: &[usize]) -> Option<Self> {
        match self {
            Self::Unblocked { .. } => Some(Self::Unblocked { facets: facets.len() }),
            Self::HorizonMap(horizons) => Some(Self::HorizonMap(horizons.picked(facets))),
            Self::OcclusionIntervals(slices) => Some(Self::OcclusionIntervals(slices.picked(facets))),
            Self::Maps(_) => None,
        }
    }

    /// Writes the visibility in `[0, 1]` of a run of facets along `direction`; directions a facet does not face count as blocked or
    /// not, as the route has it: its cosine decides them.
    /// 0 at and under the horizon.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        if direction.z <= 0.0 {
            out.fill(0.0);
            return;
        }
        match self {
            Self::Unblocked { .. } => out.fill(1.0),
            Self::HorizonMap(horizons) => horizons.fill(direction, range, out),
            Self::OcclusionIntervals(slices) => slices.fill(direction, range, out),
            Self::Maps(maps) => maps.fill(direction, range, out),
        }
    }
}
