//! Visibility of the facets of the endlessly repeated tile (V in Wu et al. 2011, Eq. 1).
//!
//! [`Visibility`] is the interface to the rest of the program: soft visibility of every facet along any direction.
//! Without overhangs it stores horizon maps. With overhangs it stores occlusion intervals or bit maps.

pub(crate) mod height_march;
mod horizon_map;
pub(crate) mod occlusion_intervals;
mod packed;
mod ray_cast;
pub(crate) mod scan;
mod shadow_map;
#[cfg(test)]
pub(crate) mod shadow_map_tests;
pub(crate) mod shadow_view;
pub(crate) mod slicer;
pub(crate) mod soft_maps;
mod stored;

use std::ops::Range;

use glam::Vec3;

pub(crate) use horizon_map::Azimuths;
pub use horizon_map::HorizonMap;
pub use occlusion_intervals::OcclusionIntervals;
pub use packed::PackedVisibility;
pub use ray_cast::ray_cast;
pub(crate) use shadow_map::cancellable_maps_cpu;
pub use shadow_map::visibility_maps_cpu;
pub use soft_maps::SoftMaps;

/// Visibility of all facets along any direction.
#[derive(Debug, Clone)]
pub enum Visibility {
    /// A flat tile: nothing blocks any facet.
    Unblocked {
        facets: usize,
    },
    HorizonMap(HorizonMap),
    OcclusionIntervals(OcclusionIntervals),
    Maps(SoftMaps),
}

/// The smallest slope that walks resolve. Where the rest of the tiling blocks no slope above it, a walk ends and takes
/// all that the rest could block as blocked: an endless tiling hides nearly all of it, with farther and farther copies.
/// The shaders repeat this value.
pub(crate) const MIN_SLOPE: f32 = 0.005;

/// A resolution at which visibility is read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Resolution {
    /// Every `azimuth_step`-th azimuth is read. It divides their number.
    pub azimuth_step: usize,
    /// Factor of the width of the transition.
    pub softness: f32,
}

impl Visibility {
    pub fn facets(&self) -> usize {
        match self {
            Self::Unblocked { facets } => *facets,
            Self::HorizonMap(horizon_map) => horizon_map.facets(),
            Self::OcclusionIntervals(intervals) => intervals.facets(),
            Self::Maps(maps) => maps.packed.facet_count,
        }
    }

    /// Fraction of the walks that were truncated ([`HorizonMap::truncated`]).
    pub fn truncated(&self) -> f64 {
        match self {
            Self::HorizonMap(horizon_map) => horizon_map.truncated(),
            Self::OcclusionIntervals(intervals) => intervals.horizon_map.truncated(),
            Self::Unblocked { .. } | Self::Maps(_) => 0.0,
        }
    }

    /// Size in memory, in bytes.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Unblocked { .. } => 0,
            Self::HorizonMap(horizon_map) => horizon_map.bytes(),
            Self::OcclusionIntervals(intervals) => intervals.bytes(),
            Self::Maps(maps) => 4 * maps.packed.words.len(),
        }
    }

    /// The visibility of some of the facets, in ascending order; `None` for bit maps.
    pub(crate) fn subset(&self, facets: &[usize]) -> Option<Self> {
        match self {
            Self::Unblocked { .. } => Some(Self::Unblocked { facets: facets.len() }),
            Self::HorizonMap(horizon_map) => Some(Self::HorizonMap(horizon_map.subset(facets))),
            Self::OcclusionIntervals(intervals) => Some(Self::OcclusionIntervals(intervals.subset(facets))),
            Self::Maps(_) => None,
        }
    }

    /// Returns true if visibility between two azimuths follows exactly from that along them.
    pub(crate) fn is_exact_between_azimuths(&self) -> bool {
        match self {
            Self::Unblocked { .. } => true,
            Self::HorizonMap(map) => map.across.is_some(),
            Self::OcclusionIntervals(_) | Self::Maps(_) => false,
        }
    }

    /// Returns true if visibility can be read from every `step`-th azimuth; false for bit maps, if nothing blocks, and if none
    /// of the azimuths can be missed.
    pub(crate) fn has_azimuth_step(&self, step: usize) -> bool {
        match self {
            Self::Unblocked { .. } | Self::Maps(_) => false,
            Self::HorizonMap(map) | Self::OcclusionIntervals(OcclusionIntervals { horizon_map: map, .. }) => {
                map.azimuths().is_multiple_of(step) && (step == 1 || !self.is_exact_between_azimuths())
            }
        }
    }

    /// As [`Visibility::fill`] at a lower resolution, for estimates of errors. Bit maps have one resolution.
    pub(crate) fn fill_at(&self, resolution: Resolution, direction: Vec3, out: &mut [f32]) {
        let range = 0..self.facets();
        match self {
            Self::HorizonMap(map) if direction.z > 0.0 => {
                map.fill_taps(&map.coarse_taps(direction, resolution), range, out);
            }
            Self::OcclusionIntervals(intervals) if direction.z > 0.0 => {
                intervals.fill_taps(&intervals.horizon_map.coarse_taps(direction, resolution), range, out);
            }
            _ => self.fill(direction, range, out),
        }
    }

    /// Writes the visibility in `[0, 1]` of a run of facets along `direction`, 0 at and below the horizon.
    ///
    /// For a direction that a facet does not face, the value depends on the algorithm. The caller must exclude it.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        if direction.z <= 0.0 {
            out.fill(0.0);
            return;
        }
        match self {
            Self::Unblocked { .. } => out.fill(1.0),
            Self::HorizonMap(horizon_map) => horizon_map.fill(direction, range, out),
            Self::OcclusionIntervals(intervals) => intervals.fill(direction, range, out),
            Self::Maps(maps) => maps.fill(direction, range, out),
        }
    }
}
