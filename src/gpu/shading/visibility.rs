//! Visibility of facets on the GPU: uploaded from the CPU, or to be computed by the GPU.

use super::direct::Sum;
use crate::gpu::{Gpu, GpuError, GpuHorizonMap, GpuMaps};
use crate::math::directions::PolarGrid;
use crate::visibility::{HorizonMap, OcclusionIntervals, SoftMaps, Visibility};

/// Visibility that a GPU sum reads.
#[derive(Debug)]
pub enum GpuVisibility<'a> {
    /// Visibility that the CPU computed.
    Computed(&'a Visibility),
    /// A horizon map that the GPU will compute, and its transition width [rad].
    HorizonMap(GpuHorizonMap, f32),
    /// Occlusion intervals that the GPU will compute, and their transition width [rad].
    OcclusionIntervals(GpuHorizonMap, f32),
    /// Shadow maps that the GPU will draw, and the grid of their directions.
    Maps(GpuMaps, PolarGrid),
}

impl GpuVisibility<'_> {
    /// Returns the name of the shader that reads this visibility.
    pub(crate) fn shader_name(&self) -> &'static str {
        match self {
            Self::Computed(Visibility::Unblocked { .. }) => "visibility_unblocked",
            Self::Computed(Visibility::HorizonMap(_)) | Self::HorizonMap(..) => "visibility_horizons",
            Self::Computed(Visibility::OcclusionIntervals(_)) => "visibility_intervals",
            Self::OcclusionIntervals(..) => "visibility_packed_intervals",
            Self::Computed(Visibility::Maps(_)) | Self::Maps(..) => "visibility_maps",
        }
    }

    /// Returns `sum` with the parameters of this visibility.
    pub(crate) fn with(&self, sum: Sum) -> Sum {
        let horizons = |azimuths: usize, transition_width: f32| Sum {
            azimuths: azimuths as u32,
            sharpness: 1.0 / transition_width,
            ..sum
        };
        match self {
            Self::Computed(Visibility::Unblocked { .. }) => sum,
            Self::Computed(Visibility::HorizonMap(map)) => {
                Sum { across: map.across.unwrap_or_default(), ..horizons(map.azimuths(), map.transition_width) }
            }
            Self::Computed(Visibility::OcclusionIntervals(intervals)) => {
                horizons(intervals.horizon_map.azimuths(), intervals.horizon_map.transition_width)
            }
            Self::Computed(Visibility::Maps(SoftMaps { grid, .. })) | Self::Maps(_, grid) => {
                Sum { azimuths: grid.azimuths as u32, rings: grid.rings as u32, nodes: grid.len() as u32, ..sum }
            }
            Self::HorizonMap(computed, transition_width) | Self::OcclusionIntervals(computed, transition_width) => {
                horizons(computed.azimuths, HorizonMap::clamped_width(*transition_width))
            }
        }
    }

    /// Uploads the visibility, or returns its buffer. The azimuths of a facet are adjacent, because neighbouring points
    /// evaluate neighbouring directions.
    pub(crate) fn upload(&self, gpu: &Gpu) -> Result<wgpu::Buffer, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE;
        match self {
            Self::Computed(Visibility::Unblocked { .. }) => gpu.upload::<u32>("visibility", &[], usage),
            Self::Computed(Visibility::OcclusionIntervals(slices)) => {
                gpu.upload("slices", &slices_by_facet(slices), usage)
            }
            Self::Computed(Visibility::HorizonMap(horizons)) => {
                gpu.upload("horizons", &horizons_by_facet(horizons), usage)
            }
            Self::Computed(Visibility::Maps(maps)) => gpu.upload("visibility maps", &bits_by_facet(maps), usage),
            Self::HorizonMap(computed, _) | Self::OcclusionIntervals(computed, _) => Ok(computed.slopes.clone()),
            Self::Maps(computed, _) => Ok(computed.bits.clone()),
        }
    }
}

fn horizons_by_facet(horizons: &HorizonMap) -> Vec<f32> {
    let azimuths = horizons.azimuths();
    (0..horizons.facets() * azimuths).map(|k| horizons.slope(k % azimuths, k / azimuths)).collect()
}

/// Returns horizons, starts of the overhangs and overhangs, as `visibility_intervals.wgsl` reads them.
fn slices_by_facet(slices: &OcclusionIntervals) -> Vec<u32> {
    let mut words: Vec<u32> = horizons_by_facet(&slices.horizon_map).into_iter().map(f32::to_bits).collect();
    let (starts, intervals) = slices.overhangs_by_facet();
    words.extend(starts);
    words.extend(intervals.iter().flat_map(|&(low, high)| [low.to_bits(), high.to_bits()]));
    words
}

fn bits_by_facet(maps: &SoftMaps) -> Vec<u32> {
    let (words, nodes) = (maps.packed.words_per_row(), maps.packed.direction_count);
    (0..words * nodes).map(|k| maps.packed.words[k % nodes * words + k / nodes]).collect()
}
