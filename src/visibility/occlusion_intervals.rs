//! Visibility under overhangs from vertical slices: a horizon for each azimuth, and what hangs above it.

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
use crate::math::simd::F32x8Array;

/// All blocked elevations of every facet along a number of azimuths, exact there.
///
/// Between azimuths the horizon itself is interpolated, which is smooth; whether something hangs above it is blended
/// (yes/no from either side).
#[derive(Debug, Clone)]
pub struct OcclusionIntervals {
    pub(crate) horizons: HorizonMap,
    /// By azimuth.
    pub(crate) hanging: Vec<Overhangs>,
    /// Where between two azimuths a facet changes over from one's view to the other's.
    pub(crate) switch: Vec<f32>,
}

/// What hangs above the facets along one azimuth: blocked intervals of elevations [rad] above the horizon, in the order of
/// their facets.
#[derive(Debug, Clone, Default)]
pub(crate) struct Overhangs {
    pub(crate) facets: Vec<u32>,
    pub(crate) low: Vec<f32>,
    pub(crate) high: Vec<f32>,
    /// [`OcclusionIntervals::switch`] of the facet.
    switch: Vec<f32>,
}

impl Overhangs {
    /// Facet, low and high of each interval, in the order of facets.
    pub(crate) fn new(intervals: impl Iterator<Item = (u32, f32, f32)>, switch: &[f32]) -> Self {
        let mut hanging = Self::default();
        for (facet, low, high) in intervals {
            hanging.facets.push(facet);
            hanging.low.push(low);
            hanging.high.push(high);
            hanging.switch.push(switch[facet as usize]);
        }
        hanging
    }

    /// Those of the facets that have a place, which is their new number.
    fn picked(&self, places: &[u32]) -> Self {
        let count = self.facets.len();
        let (mut facets, mut columns) = (vec![0; count], [(); 3].map(|()| vec![0.0; count]));
        let mut kept = 0;
        // Every interval is written, and stays where it counts: which ones do cannot be foreseen, so a branch would cost more.
        for k in 0..count {
            let place = places[self.facets[k] as usize];
            facets[kept] = place;
            for (column, from) in columns.iter_mut().zip([&self.low, &self.high, &self.switch]) {
                column[kept] = from[k];
            }
            kept += usize::from(place != NOWHERE);
        }
        facets.truncate(kept);
        columns.iter_mut().for_each(|column| column.truncate(kept));
        let [low, high, switch] = columns;
        Self { facets, low, high, switch }
    }

    fn iter(&self) -> impl Iterator<Item = (u32, f32, f32)> {
        self.facets.iter().zip(&self.low).zip(&self.high).map(|((facet, low), high)| (*facet, *low, *high))
    }

    /// Where the intervals of a run of facets stand.
    fn of(&self, facets: &Range<usize>) -> Range<usize> {
        let place = |facet: usize| self.facets.partition_point(|&hanging| (hanging as usize) < facet);
        place(facets.start)..place(facets.end)
    }
}

/// The place of a facet that is not picked.
const NOWHERE: u32 = u32::MAX;

/// 2³² over the golden ratio.
const GOLDEN: u32 = 2_654_435_769;

impl OcclusionIntervals {
    /// Cells and triangles that one slice looks at on average, from a few of them: what [`OcclusionIntervals::scan`] will cost.
    pub fn work(grid: &PeriodicGrid, facets: &Facets) -> f64 {
        const FACETS: usize = 48;
        const AZIMUTHS: usize = 5;
        let (slicer, origins) = (Slicer::new(grid), lifted_origins(facets, grid.tile_size));
        let mut blocked = BlockedSlopes::default();
        let looked_at = FACETS.min(facets.len());
        for azimuth in 0..AZIMUTHS {
            let along = from_angles(FRAC_PI_2, TAU * (azimuth as f32 + 0.3) / AZIMUTHS as f32).truncate();
            let slicer = slicer.turned(along);
            for facet in (0..looked_at).map(|k| k * facets.len() / looked_at) {
                slicer.scan::<F32x8Array>(origins[facet], facets.normals[facet], facets.triangles[facet], &mut blocked);
            }
        }
        blocked.work as f64 / (FACETS * AZIMUTHS) as f64
    }

    /// OcclusionIntervals the mesh along every azimuth, for every facet. Visibility ends in ramps of `ramp` radians.
    pub fn scan(grid: &PeriodicGrid, facets: &Facets, azimuths: usize, ramp: f32) -> Self {
        let (slicer, origins) = (Slicer::new(grid), lifted_origins(facets, grid.tile_size));
        // The golden ratio's multiples fill [0, 1] evenly, for neighbours too.
        let switch: Vec<f32> =
            (0..facets.len() as u32).map(|k| k.wrapping_mul(GOLDEN) as f32 / 4_294_967_296.0).collect();
        let scanned: Vec<(Vec<f32>, Overhangs, usize)> = (0..azimuths)
            .into_par_iter()
            .map(|azimuth| {
                let along = from_angles(FRAC_PI_2, TAU * azimuth as f32 / azimuths as f32).truncate();
                let (mut row, mut above) = (vec![0.0; facets.len()], Vec::new());
                let truncated = scan_all(&slicer.turned(along), facets, &origins, &mut |facet, blocked| {
                    row[facet as usize] = blocked.ground;
                    above.extend(blocked.floating_unfaced().map(|(low, high)| {
                        (facet, low.atan(), if high == f32::INFINITY { HorizonMap::BLOCKED } else { high.atan() })
                    }));
                });
                above.sort_by_key(|interval| interval.0);
                (row, Overhangs::new(above.into_iter(), &switch), truncated)
            })
            .collect();
        let (mut rows, mut hanging, mut truncated) = (Vec::with_capacity(facets.len() * azimuths), Vec::new(), 0);
        for (row, above, short) in scanned {
            rows.extend(row);
            hanging.push(above);
            truncated += short;
        }
        let mut horizons = HorizonMap::from_slopes(facets.len(), azimuths, ramp, rows);
        horizons.truncated = truncated;
        Self { horizons, hanging, switch }
    }

    pub fn facets(&self) -> usize {
        self.horizons.facets()
    }

    pub fn bytes(&self) -> usize {
        let intervals: usize = self.hanging.iter().map(|hanging| hanging.facets.len()).sum();
        self.horizons.bytes() + intervals * size_of::<(u32, [f32; 3])>()
    }

    /// Writes the visibility in `[0, 1]` of a run of facets along `direction` (above the horizon); facing is not included.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        let (azimuth, elevation) = simd::azimuth_and_elevation(direction);
        let [(from, _), (to, blend)] = self.horizons.taps(azimuth);
        let sharpness = 1.0 / self.horizons.ramp();
        let row = |azimuth: usize| &self.horizons.row(azimuth)[range.clone()];
        simd::stepped_visibility(row(from), row(to), &self.switch[range.clone()], blend, elevation, sharpness, out);
        // What each interval covers in whole vectors first: there are many for each facet.
        const MOST: usize = 256;
        let mut covered = [0.0; MOST];
        for (azimuth, side) in [(from, 0.0), (to, 1.0)] {
            let (hanging, run) = (&self.hanging[azimuth], self.hanging[azimuth].of(&range));
            for first in run.clone().step_by(MOST) {
                let part = first..(first + MOST).min(run.end);
                let covered = &mut covered[..part.len()];
                let (low, high) = (&hanging.low[part.clone()], &hanging.high[part.clone()]);
                let turn = (&hanging.switch[part.clone()], blend, side);
                simd::interval_cover(low, high, turn, elevation, sharpness, covered);
                for (facet, covered) in hanging.facets[part].iter().zip(covered) {
                    let out = &mut out[*facet as usize - range.start];
                    *out = (*out - *covered).max(0.0);
                }
            }
        }
    }

    /// Those of some of the facets, in ascending order.
    pub(crate) fn picked(&self, facets: &[usize]) -> Self {
        let mut places = vec![NOWHERE; self.facets()];
        for (place, &facet) in facets.iter().enumerate() {
            places[facet] = place as u32;
        }
        Self {
            horizons: self.horizons.picked(facets),
            hanging: self.hanging.iter().map(|hanging| hanging.picked(&places)).collect(),
            switch: facets.iter().map(|&facet| self.switch[facet]).collect(),
        }
    }

    /// What hangs over each facet along each azimuth, the azimuths of a facet side by side: where the intervals
    /// `(low, high)` [rad] of each begin (one more entry than facets x azimuths), and the intervals.
    pub(crate) fn hanging_by_facet(&self) -> (Vec<u32>, Vec<(f32, f32)>) {
        let (mut starts, mut intervals) = (vec![0], Vec::new());
        for facet in 0..self.facets() {
            for azimuth in 0..self.horizons.azimuths() {
                let hanging = &self.hanging[azimuth];
                intervals.extend(hanging.of(&(facet..facet + 1)).map(|k| (hanging.low[k], hanging.high[k])));
                starts.push(intervals.len() as u32);
            }
        }
        (starts, intervals)
    }

    /// The same as yes/no maps of `rings` rings on the slices' own azimuths: exact at the nodes.
    pub fn maps(&self, rings: usize) -> SoftMaps {
        let (facets, azimuths) = (self.facets(), self.horizons.azimuths());
        let grid = PolarGrid::new(rings, azimuths);
        let mut packed = PackedVisibility::new(facets, grid.len());
        for ring in 0..grid.ring_count() {
            let elevation = FRAC_PI_2 - grid.theta(ring);
            for azimuth in 0..azimuths {
                let node = ring * azimuths + azimuth;
                for facet in 0..facets {
                    if elevation > self.horizons.elevation(azimuth, facet) {
                        packed.set_visible(node, facet);
                    }
                }
                for (facet, low, high) in self.hanging[azimuth].iter() {
                    if low <= elevation && elevation <= high {
                        packed.set_blocked(node, facet as usize);
                    }
                }
            }
        }
        SoftMaps { grid, packed }
    }
}
