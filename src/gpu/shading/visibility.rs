//! What facets see, on the device: uploaded as the CPU found it, or to be made there.

use super::direct::Sum;
use crate::gpu::{Gpu, GpuError, GpuHorizonMap, GpuMaps};
use crate::math::directions::PolarGrid;
use crate::visibility::{HorizonMap, OcclusionIntervals, SoftMaps, Visibility};

/// How facets on a device come to see.
#[derive(Debug)]
pub enum GpuVisibility<'a> {
    /// The CPU saw for them.
    Held(&'a Visibility),
    /// HorizonMap that the device is to make, and the width of the soft step there [rad].
    Marched(GpuHorizonMap, f32),
    /// OcclusionIntervals that the device is to make, and the width of the soft step there [rad].
    Sliced(GpuHorizonMap, f32),
    /// Maps that the device is to draw, and what their directions are.
    Drawn(GpuMaps, PolarGrid),
}

impl GpuVisibility<'_> {
    /// The shader that reads it.
    pub(crate) fn file(&self) -> &'static str {
        match self {
            Self::Held(Visibility::Unblocked { .. }) => "visibility_unblocked",
            Self::Held(Visibility::HorizonMap(_)) | Self::Marched(..) => "visibility_horizons",
            Self::Held(Visibility::OcclusionIntervals(_)) => "visibility_slices",
            Self::Sliced(..) => "visibility_hanging",
            Self::Held(Visibility::Maps(_)) | Self::Drawn(..) => "visibility_maps",
        }
    }

    /// A sum over facets that see so.
    pub(crate) fn with(&self, sum: Sum) -> Sum {
        let horizons = |azimuths: usize, ramp: f32| Sum { azimuths: azimuths as u32, sharpness: 1.0 / ramp, ..sum };
        match self {
            Self::Held(Visibility::Unblocked { .. }) => sum,
            Self::Held(Visibility::HorizonMap(held)) => horizons(held.azimuths(), held.ramp()),
            Self::Held(Visibility::OcclusionIntervals(held)) => {
                horizons(held.horizons.azimuths(), held.horizons.ramp())
            }
            Self::Held(Visibility::Maps(SoftMaps { grid, .. })) | Self::Drawn(_, grid) => {
                Sum { azimuths: grid.azimuths as u32, rings: grid.rings as u32, nodes: grid.len() as u32, ..sum }
            }
            Self::Marched(made, ramp) | Self::Sliced(made, ramp) => horizons(made.azimuths, HorizonMap::soft(*ramp)),
        }
    }

    /// Side by side what neighbouring points read of one facet: they look along neighbouring directions.
    pub(crate) fn on_device(&self, gpu: &Gpu) -> Result<wgpu::Buffer, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE;
        match self {
            Self::Held(Visibility::Unblocked { .. }) => gpu.upload::<u32>("visibility", &[], usage),
            Self::Held(Visibility::OcclusionIntervals(slices)) => gpu.upload("slices", &slices_by_facet(slices), usage),
            Self::Held(Visibility::HorizonMap(horizons)) => gpu.upload("horizons", &horizons_by_facet(horizons), usage),
            Self::Held(Visibility::Maps(maps)) => gpu.upload("visibility maps", &bits_by_facet(maps), usage),
            Self::Marched(made, _) | Self::Sliced(made, _) => Ok(made.elevations.clone()),
            Self::Drawn(made, _) => Ok(made.bits.clone()),
        }
    }
}

fn horizons_by_facet(horizons: &HorizonMap) -> Vec<f32> {
    let azimuths = horizons.azimuths();
    (0..horizons.facets() * azimuths).map(|k| horizons.elevation(k % azimuths, k / azimuths)).collect()
}

/// HorizonMap, starts of the hanging intervals, and the intervals (visibility_slices.wgsl).
fn slices_by_facet(slices: &OcclusionIntervals) -> Vec<u32> {
    let mut words: Vec<u32> = horizons_by_facet(&slices.horizons).into_iter().map(f32::to_bits).collect();
    let (starts, intervals) = slices.hanging_by_facet();
    words.extend(starts);
    words.extend(intervals.iter().flat_map(|&(low, high)| [low.to_bits(), high.to_bits()]));
    words
}

fn bits_by_facet(maps: &SoftMaps) -> Vec<u32> {
    let (words, nodes) = (maps.packed.words_per_row(), maps.packed.direction_count);
    (0..words * nodes).map(|k| maps.packed.words[k % nodes * words + k / nodes]).collect()
}
