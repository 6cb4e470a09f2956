//! Visibility under overhangs from vertical slices: a horizon for each azimuth, and what hangs above it.

use std::f32::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::ray_cast::lifted_origins;
use super::scan::{BlockedSlopes, scan_all};
use super::slicer::Slicer;
use super::{Horizons, PackedVisibility, PeriodicGrid, SoftMaps};
use crate::directions::{PolarGrid, from_angles};
use crate::geometry::Facets;
use crate::simd;

/// All blocked elevations of every facet along a number of azimuths, exact there.
///
/// Between azimuths the horizon itself is interpolated, which is smooth; whether something hangs above it is blended
/// (yes/no from either side).
#[derive(Debug, Clone)]
pub struct Slices {
    pub(crate) horizons: Horizons,
    /// By azimuth, in the order of their facets.
    pub(super) floating: Vec<Vec<Floating>>,
    /// Where between two azimuths a facet changes over from one's view to the other's.
    pub(super) switch: Vec<f32>,
}

/// A blocked interval of elevations [rad] above a facet's horizon.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Floating {
    pub(super) facet: u32,
    low: f32,
    high: f32,
}

/// 2³² over the golden ratio.
const GOLDEN: u32 = 2_654_435_769;

impl Slices {
    /// Cells and triangles that one slice looks at on average, from a few of them: what [`Slices::scan`] will cost.
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
                slicer.scan(origins[facet], facets.normals[facet], facets.triangles[facet], &mut blocked);
            }
        }
        blocked.work as f64 / (FACETS * AZIMUTHS) as f64
    }

    /// Slices the mesh along every azimuth, for every facet. Visibility ends in ramps of `ramp` radians.
    pub fn scan(grid: &PeriodicGrid, facets: &Facets, azimuths: usize, ramp: f32) -> Self {
        let (slicer, origins) = (Slicer::new(grid), lifted_origins(facets, grid.tile_size));
        let scanned: Vec<(Vec<f32>, Vec<Floating>, usize)> = (0..azimuths)
            .into_par_iter()
            .map(|azimuth| {
                let along = from_angles(FRAC_PI_2, TAU * azimuth as f32 / azimuths as f32).truncate();
                let (mut row, mut above) = (vec![0.0; facets.len()], Vec::new());
                let cut_short = scan_all(&slicer.turned(along), facets, &origins, &mut |facet, blocked| {
                    row[facet as usize] = blocked.ground;
                    above.extend(blocked.floating_unfaced().map(|(low, high)| Floating {
                        facet,
                        low: low.atan(),
                        high: if high == f32::INFINITY { Horizons::BLOCKED } else { high.atan() },
                    }));
                });
                above.sort_by_key(|hanging: &Floating| hanging.facet);
                (row, above, cut_short)
            })
            .collect();
        let (mut rows, mut floating, mut cut_short) = (Vec::with_capacity(facets.len() * azimuths), Vec::new(), 0);
        for (row, above, short) in scanned {
            rows.extend(row);
            floating.push(above);
            cut_short += short;
        }
        let mut horizons = Horizons::from_slopes(facets.len(), azimuths, ramp, rows);
        horizons.cut_short = cut_short;
        // The golden ratio's multiples fill [0, 1] evenly, for neighbours too.
        let switch = (0..facets.len() as u32).map(|k| k.wrapping_mul(GOLDEN) as f32 / 4_294_967_296.0).collect();
        Self { horizons, floating, switch }
    }

    pub fn facets(&self) -> usize {
        self.horizons.facets()
    }

    pub fn bytes(&self) -> usize {
        let floating: usize = self.floating.iter().map(Vec::len).sum();
        self.horizons.bytes() + floating * size_of::<Floating>()
    }

    /// Writes the visibility in `[0, 1]` of a run of facets along `direction` (above the horizon); facing is not included.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        let (azimuth, elevation) = simd::azimuth_and_elevation(direction);
        let [(from, _), (to, blend)] = self.horizons.taps(azimuth);
        let sharpness = 1.0 / self.horizons.ramp();
        let row = |azimuth: usize| &self.horizons.row(azimuth)[range.clone()];
        let switch = &self.switch[range.clone()];
        simd::stepped_visibility(row(from), row(to), switch, blend, elevation, sharpness, out);
        let above = |edge: f32| ((elevation - edge) * sharpness + 0.5).clamp(0.0, 1.0);
        for (azimuth, side) in [(from, 0.0), (to, 1.0)] {
            for hanging in self.run(azimuth, &range) {
                let at = hanging.facet as usize - range.start;
                let changed = ((blend - switch[at]) * simd::SWITCH + 0.5).clamp(0.0, 1.0);
                let weight = 1.0 - (side - changed).abs();
                let covered = above(hanging.low) - above(hanging.high);
                out[at] = (out[at] - weight * covered).max(0.0);
            }
        }
    }

    /// Those of some of the facets, in ascending order.
    pub(super) fn picked(&self, facets: &[usize]) -> Self {
        let mut places = vec![u32::MAX; self.facets()];
        for (place, &facet) in facets.iter().enumerate() {
            places[facet] = place as u32;
        }
        let row = |row: &Vec<Floating>| -> Vec<Floating> {
            let moved = row.iter().map(|hanging| Floating { facet: places[hanging.facet as usize], ..*hanging });
            moved.filter(|hanging| hanging.facet != u32::MAX).collect()
        };
        Self {
            horizons: self.horizons.picked(facets),
            floating: self.floating.iter().map(row).collect(),
            switch: facets.iter().map(|&facet| self.switch[facet]).collect(),
        }
    }

    /// What hangs above a run of facets along one azimuth.
    fn run(&self, azimuth: usize, range: &Range<usize>) -> &[Floating] {
        let row = &self.floating[azimuth];
        let place = |facet: usize| row.partition_point(|hanging| (hanging.facet as usize) < facet);
        &row[place(range.start)..place(range.end)]
    }

    /// What hangs over each facet along each azimuth, the azimuths of a facet side by side: where the intervals
    /// `(low, high)` [rad] of each begin (one more entry than facets x azimuths), and the intervals.
    pub(crate) fn hanging_by_facet(&self) -> (Vec<u32>, Vec<(f32, f32)>) {
        let (mut starts, mut intervals) = (vec![0], Vec::new());
        for facet in 0..self.facets() {
            for azimuth in 0..self.horizons.azimuths() {
                let run = self.run(azimuth, &(facet..facet + 1));
                intervals.extend(run.iter().map(|hanging| (hanging.low, hanging.high)));
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
                for hanging in &self.floating[azimuth] {
                    if hanging.low <= elevation && elevation <= hanging.high {
                        packed.set_blocked(node, hanging.facet as usize);
                    }
                }
            }
        }
        SoftMaps { grid, packed }
    }
}
