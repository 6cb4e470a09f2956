//! Visibility with overhangs from vertical slices: per azimuth, a horizon and the blocked intervals above it.

use std::f32::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::scan::{BlockedSlopes, scan_all};
use super::slicer::Slicer;
use super::{HorizonMap, PackedVisibility, SoftMaps};
use crate::geometry::Facets;
use crate::geometry::{PeriodicGrid, lifted_origins};
use crate::math::directions::{PolarGrid, from_angles};
use crate::math::simd;
use crate::math::simd::{F32x8Array, HorizonTaps};

/// All blocked slopes of every facet along a number of azimuths, exact at these azimuths.
///
/// Between azimuths the slope of the horizon is interpolated, unless it jumps to another part of the surface. At such jumps, and for
/// overhangs, each facet switches from one azimuth to the next over a transition.
#[derive(Debug, Clone)]
pub struct OcclusionIntervals {
    pub(crate) horizon_map: HorizonMap,
    /// Overhangs by azimuth.
    pub(crate) overhangs: Vec<Overhangs>,
    /// Fraction of the way between two azimuths at which a facet switches from one to the other.
    pub(crate) switch: Vec<f32>,
}

/// Overhangs along one azimuth: blocked intervals of slopes above the horizon, in the order of their facets.
#[derive(Debug, Clone, Default)]
pub(crate) struct Overhangs {
    pub(crate) facets: Vec<u32>,
    pub(crate) low: Vec<f32>,
    pub(crate) high: Vec<f32>,
    /// [`OcclusionIntervals::switch`] of the facet.
    switch: Vec<f32>,
}

impl Overhangs {
    /// Collects intervals `(facet, low, high)`, which are in the order of facets.
    pub(crate) fn new(intervals: impl Iterator<Item = (u32, f32, f32)>, switch: &[f32]) -> Self {
        let mut overhangs = Self::default();
        for (facet, low, high) in intervals {
            overhangs.facets.push(facet);
            overhangs.low.push(low);
            overhangs.high.push(high);
            overhangs.switch.push(switch[facet as usize]);
        }
        overhangs
    }

    /// The intervals of some of the facets: `new_indices` holds each facet's new index, or [`NOT_IN_SUBSET`].
    fn subset(&self, new_indices: &[u32]) -> Self {
        let (mut kept, mut count) = (vec![0; self.facets.len()], 0);
        // Each index is written; the next one overwrites it if its facet is not in the subset. A branch would be unpredictable
        // and cost more.
        for (k, facet) in self.facets.iter().enumerate() {
            kept[count] = k as u32;
            count += usize::from(new_indices[*facet as usize] != NOT_IN_SUBSET);
        }
        kept.truncate(count);
        let column = |values: &[f32]| kept.iter().map(|k| values[*k as usize]).collect();
        Self {
            facets: kept.iter().map(|k| new_indices[self.facets[*k as usize] as usize]).collect(),
            low: column(&self.low),
            high: column(&self.high),
            switch: column(&self.switch),
        }
    }

    fn iter(&self) -> impl Iterator<Item = (u32, f32, f32)> {
        self.facets.iter().zip(&self.low).zip(&self.high).map(|((facet, low), high)| (*facet, *low, *high))
    }

    /// The index range of the intervals of a run of facets.
    fn range_of(&self, facets: &Range<usize>) -> Range<usize> {
        let first = |facet: usize| self.facets.partition_point(|&other| (other as usize) < facet);
        first(facets.start)..first(facets.end)
    }
}

/// Marks a facet that is not in the subset.
const NOT_IN_SUBSET: u32 = u32::MAX;

/// 2³² divided by the golden ratio.
const GOLDEN: u32 = 2_654_435_769;

impl OcclusionIntervals {
    /// Estimates the mean number of steps per slice from a few slices, as a measure of the cost of
    /// [`OcclusionIntervals::scan`].
    pub fn mean_steps(grid: &PeriodicGrid, facets: &Facets) -> f64 {
        const FACETS: usize = 48;
        const AZIMUTHS: usize = 5;
        let (slicer, origins) = (Slicer::new(grid), lifted_origins(facets, grid.tile_size));
        let mut blocked = BlockedSlopes::default();
        let sampled = FACETS.min(facets.len());
        for azimuth in 0..AZIMUTHS {
            let along = from_angles(FRAC_PI_2, TAU * (azimuth as f32 + 0.3) / AZIMUTHS as f32).truncate();
            let slicer = slicer.rotated(along);
            for facet in (0..sampled).map(|k| k * facets.len() / sampled) {
                slicer.scan::<F32x8Array>(origins[facet], facets.normals[facet], facets.triangles[facet], &mut blocked);
            }
        }
        blocked.steps as f64 / (sampled.max(1) * AZIMUTHS) as f64
    }

    /// Cuts the mesh along every azimuth for every facet. Visibility has transitions of `transition_width` radians.
    pub fn scan(grid: &PeriodicGrid, facets: &Facets, azimuths: usize, transition_width: f32) -> Self {
        Self::scan_between(None, grid, facets, azimuths, transition_width)
    }

    /// As [`OcclusionIntervals::scan`], without cutting along the azimuths of `coarser` again. It has the same facets.
    pub(crate) fn scan_between(
        coarser: Option<&Self>,
        grid: &PeriodicGrid,
        facets: &Facets,
        azimuths: usize,
        transition_width: f32,
    ) -> Self {
        let coarser = coarser.filter(|coarser| azimuths.is_multiple_of(coarser.horizon_map.azimuths()));
        let (slicer, origins) = (Slicer::new(grid), lifted_origins(facets, grid.tile_size));
        // Multiples of the golden ratio fill [0, 1] evenly, also for consecutive facets.
        let switch: Vec<f32> =
            (0..facets.len() as u32).map(|k| k.wrapping_mul(GOLDEN) as f32 / 4_294_967_296.0).collect();
        let scanned: Vec<(Vec<f32>, Overhangs, usize)> = (0..azimuths)
            .into_par_iter()
            .map(|azimuth| {
                if let Some((row, above)) = coarser.and_then(|coarser| coarser.slice(azimuth, azimuths)) {
                    grid.cancel.step(azimuths);
                    return (row, above, 0);
                }
                let along = from_angles(FRAC_PI_2, TAU * azimuth as f32 / azimuths as f32).truncate();
                let (mut row, mut above) = (vec![0.0; facets.len()], Vec::new());
                let truncated = scan_all(&slicer.rotated(along), facets, &origins, &mut |facet, blocked| {
                    row[facet as usize] = blocked.ground;
                    above.extend(
                        blocked.floating_faced().map(|(low, high)| (facet, low, high.min(HorizonMap::BLOCKED))),
                    );
                });
                above.sort_by_key(|interval| interval.0);
                grid.cancel.step(azimuths);
                (row, Overhangs::new(above.into_iter(), &switch), truncated)
            })
            .collect();
        let (mut rows, mut overhangs) = (Vec::with_capacity(facets.len() * azimuths), Vec::new());
        let mut truncated = coarser.map_or(0, |coarser| coarser.horizon_map.truncated);
        for (row, above, row_truncated) in scanned {
            rows.extend(row);
            overhangs.push(above);
            truncated += row_truncated;
        }
        let mut horizon_map = HorizonMap::from_slopes(facets.len(), azimuths, transition_width, rows);
        horizon_map.truncated = truncated;
        Self { horizon_map, overhangs, switch }
    }

    /// The horizons and overhangs along one of `azimuths` azimuths, a multiple of the own ones, if it is one of them.
    fn slice(&self, azimuth: usize, azimuths: usize) -> Option<(Vec<f32>, Overhangs)> {
        let step = azimuths / self.horizon_map.azimuths();
        let own = azimuth / step;
        azimuth.is_multiple_of(step).then(|| (self.horizon_map.row(own).to_vec(), self.overhangs[own].clone()))
    }

    pub fn facets(&self) -> usize {
        self.horizon_map.facets()
    }

    pub fn bytes(&self) -> usize {
        let intervals: usize = self.overhangs.iter().map(|overhangs| overhangs.facets.len()).sum();
        self.horizon_map.bytes() + intervals * size_of::<(u32, [f32; 3])>()
    }

    /// Writes the visibility in `[0, 1]` of a run of facets along `direction`, which points above the horizon. Facing
    /// is not included.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        self.fill_taps(&self.horizon_map.taps(direction), range, out);
    }

    /// As [`OcclusionIntervals::fill`], from the taps of the direction.
    pub(super) fn fill_taps(&self, taps: &HorizonTaps, range: Range<usize>, out: &mut [f32]) {
        let [from, to] = taps.azimuths.map(|azimuth| &self.horizon_map.row(azimuth)[range.clone()]);
        simd::stepped_visibility(from, to, &self.switch[range.clone()], taps, out);
        // Blocks of intervals are computed as whole vectors first, because each facet has many intervals.
        const MAX_INTERVALS: usize = 256;
        let mut covered = [0.0; MAX_INTERVALS];
        for (azimuth, side) in taps.azimuths.into_iter().zip([0.0, 1.0]) {
            let overhangs = &self.overhangs[azimuth];
            let run = overhangs.range_of(&range);
            for first in run.clone().step_by(MAX_INTERVALS) {
                let part = first..(first + MAX_INTERVALS).min(run.end);
                let covered = &mut covered[..part.len()];
                let (low, high) = (&overhangs.low[part.clone()], &overhangs.high[part.clone()]);
                simd::interval_cover(low, high, &overhangs.switch[part.clone()], side, taps, covered);
                for (facet, covered) in overhangs.facets[part].iter().zip(covered) {
                    let out = &mut out[*facet as usize - range.start];
                    *out = (*out - *covered).max(0.0);
                }
            }
        }
    }

    /// The occlusion intervals of some of the facets, in ascending order.
    pub(crate) fn subset(&self, facets: &[usize]) -> Self {
        let mut new_indices = vec![NOT_IN_SUBSET; self.facets()];
        for (new_index, &facet) in facets.iter().enumerate() {
            new_indices[facet] = new_index as u32;
        }
        Self {
            horizon_map: self.horizon_map.subset(facets),
            overhangs: self.overhangs.iter().map(|overhangs| overhangs.subset(&new_indices)).collect(),
            switch: facets.iter().map(|&facet| self.switch[facet]).collect(),
        }
    }

    /// Overhangs by facet, then azimuth. The first array holds the start of each list and the end of the last one, the
    /// second the intervals `(low, high)` of slopes.
    #[cfg(feature = "gpu")]
    pub(crate) fn overhangs_by_facet(&self) -> (Vec<u32>, Vec<(f32, f32)>) {
        let (mut starts, mut intervals) = (vec![0], Vec::new());
        for facet in 0..self.facets() {
            for azimuth in 0..self.horizon_map.azimuths() {
                let overhangs = &self.overhangs[azimuth];
                let run = overhangs.range_of(&(facet..facet + 1));
                intervals.extend(run.map(|k| (overhangs.low[k], overhangs.high[k])));
                starts.push(intervals.len() as u32);
            }
        }
        (starts, intervals)
    }

    /// Converts to bit maps on a polar grid of `rings` rings and the same azimuths. The bits are exact at the nodes.
    pub fn maps(&self, rings: usize) -> SoftMaps {
        let (facets, azimuths) = (self.facets(), self.horizon_map.azimuths());
        let grid = PolarGrid::new(rings, azimuths);
        let mut packed = PackedVisibility::new(facets, grid.len());
        for ring in 0..grid.ring_count() {
            let slope = 1.0 / grid.theta(ring).tan();
            for azimuth in 0..azimuths {
                let node = ring * azimuths + azimuth;
                for facet in 0..facets {
                    if slope > self.horizon_map.slope(azimuth, facet) {
                        packed.set_visible(node, facet);
                    }
                }
                for (facet, low, high) in self.overhangs[azimuth].iter() {
                    if low <= slope && slope <= high {
                        packed.set_blocked(node, facet as usize);
                    }
                }
            }
        }
        SoftMaps { grid, packed }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::geometry::families::heightfield;
    use crate::geometry::{FacetSampler, SampleShift};

    #[test]
    fn slices_along_the_azimuths_of_a_coarser_visibility_are_those_of_it() {
        let waves = |height: f32| {
            heightfield::from_function(glam::UVec2::new(9, 7), Vec2::ONE, |p| {
                height * (7.0 * p.x).sin() * (9.0 * p.y).cos()
            })
        };
        let (mesh, higher) = (waves(0.2), waves(0.3));
        let facets = FacetSampler::new(&mesh).sample(&mesh, 60, SampleShift::from_seed(1));
        let grids = [&mesh, &higher].map(PeriodicGrid::for_slices);
        let slopes = |intervals: &OcclusionIntervals| -> Vec<Vec<f32>> {
            (0..intervals.horizon_map.azimuths()).map(|azimuth| intervals.horizon_map.row(azimuth).to_vec()).collect()
        };
        let anew = slopes(&OcclusionIntervals::scan(&grids[0], &facets, 12, 0.02));
        let coarser = OcclusionIntervals::scan(&grids[0], &facets, 6, 0.02);
        assert_eq!(slopes(&OcclusionIntervals::scan_between(Some(&coarser), &grids[0], &facets, 12, 0.01)), anew);
        // The coarser slices of another mesh show which ones are not cut again.
        let other = OcclusionIntervals::scan(&grids[1], &facets, 4, 0.02);
        let mixed = slopes(&OcclusionIntervals::scan_between(Some(&other), &grids[0], &facets, 12, 0.02));
        let other = slopes(&other);
        for azimuth in 0..12 {
            let expected = if azimuth % 3 == 0 { &other[azimuth / 3] } else { &anew[azimuth] };
            assert_eq!(&mixed[azimuth], expected, "{azimuth}");
        }
        let unrelated = OcclusionIntervals::scan(&grids[1], &facets, 5, 0.02);
        assert_eq!(slopes(&OcclusionIntervals::scan_between(Some(&unrelated), &grids[0], &facets, 12, 0.02)), anew);
    }
}
