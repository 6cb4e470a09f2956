//! Horizon maps: per facet and azimuth the elevation below which all is blocked, which interpolates smoothly.

use std::f32::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::height_march::{HeightMarch, march_all};
use super::scan::scan_all;
use super::slicer::Slicer;
use crate::geometry::{Facets, HeightGrid};
use crate::geometry::{PeriodicGrid, lifted_origins};
use crate::math::directions::from_angles;
use crate::math::simd;

/// For each azimuth and facet the elevation [rad] below which all is blocked; right for surfaces without overhangs.
///
/// Between azimuths the horizon itself is interpolated (not yes/no), which is why few azimuths do (DESIGN.md, Sec. 4).
/// Visibility ends in a ramp of `ramp` radians, so that what is computed from it is continuous.
#[derive(Debug, Clone)]
pub struct HorizonMap {
    pub(super) azimuths: usize,
    pub(super) facets: usize,
    pub(super) ramp: f32,
    /// `[azimuth][facet]`; [`HorizonMap::FREE`] where nothing blocks, [`HorizonMap::BLOCKED`] where all is.
    pub(super) elevations: Vec<f32>,
    /// Walks that ended before all was known.
    pub(super) truncated: usize,
}

impl HorizonMap {
    /// A horizon so low that the soft step never reaches above 0.
    const FREE: f32 = -0.02;
    /// A horizon so high that the soft step never reaches the zenith.
    pub(super) const BLOCKED: f32 = FRAC_PI_2 + 0.02;

    /// OcclusionIntervals the mesh along every azimuth, for every facet: exact in elevation.
    pub fn scan(grid: &PeriodicGrid, facets: &Facets, azimuths: usize, ramp: f32) -> Self {
        let (slicer, origins) = (Slicer::new(grid), lifted_origins(facets, grid.tile_size));
        Self::fill_rows(facets.len(), azimuths, ramp, |along, row| {
            scan_all(&slicer.turned(along.truncate()), facets, &origins, &mut |facet, blocked| {
                row[facet as usize] = blocked.highest();
            })
        })
    }

    /// Walks the samples of a height-field: the same horizons as [`HorizonMap::scan`], several times faster.
    pub fn march(heights: &HeightGrid, tile_size: glam::Vec2, facets: &Facets, azimuths: usize, ramp: f32) -> Self {
        let march = HeightMarch::new(heights, tile_size);
        Self::fill_rows(facets.len(), azimuths, ramp, |along, row| {
            march_all(&march, facets, along.truncate(), row);
            0
        })
    }

    /// `fill` writes slopes (tangents) of the horizon along a plane direction, which become elevations here, and tells how
    /// many walks it cut short.
    fn fill_rows(facets: usize, azimuths: usize, ramp: f32, fill: impl Fn(Vec3, &mut [f32]) -> usize + Sync) -> Self {
        let mut slopes = vec![0.0; facets * azimuths];
        let rows = slopes.par_chunks_mut(facets.max(1)).enumerate();
        let truncated =
            rows.map(|(azimuth, row)| fill(from_angles(FRAC_PI_2, TAU * azimuth as f32 / azimuths as f32), row)).sum();
        Self { truncated, ..Self::from_slopes(facets, azimuths, ramp, slopes) }
    }

    /// From slopes (tangents) of the horizons, `[azimuth][facet]`.
    pub(super) fn from_slopes(facets: usize, azimuths: usize, ramp: f32, slopes: Vec<f32>) -> Self {
        let mut elevations = slopes;
        elevations.par_iter_mut().for_each(|slope| {
            *slope = if *slope <= 0.0 {
                Self::FREE
            } else if *slope == f32::INFINITY {
                Self::BLOCKED
            } else {
                slope.atan()
            };
        });
        Self { azimuths, facets, ramp: Self::soft(ramp), elevations, truncated: 0 }
    }

    /// A width of the soft step [rad] that is one.
    pub(crate) fn soft(ramp: f32) -> f32 {
        ramp.clamp(1e-6, -2.0 * Self::FREE)
    }

    pub fn facets(&self) -> usize {
        self.facets
    }

    pub(crate) fn azimuths(&self) -> usize {
        self.azimuths
    }

    /// Width of the soft step [rad].
    pub(crate) fn ramp(&self) -> f32 {
        self.ramp
    }

    /// Elevation [rad] below which all is blocked along one azimuth.
    pub(crate) fn elevation(&self, azimuth: usize, facet: usize) -> f32 {
        self.elevations[azimuth * self.facets + facet]
    }

    /// Part of the walks that ended before all was known: something may block directions low over the horizon, unseen.
    pub fn truncated(&self) -> f64 {
        self.truncated as f64 / self.elevations.len().max(1) as f64
    }

    pub fn bytes(&self) -> usize {
        4 * self.elevations.len()
    }

    /// Elevations [rad] of all facets along one azimuth.
    pub(super) fn row(&self, azimuth: usize) -> &[f32] {
        &self.elevations[azimuth * self.facets..][..self.facets]
    }

    /// The two azimuths around one [turns, to 1 at most], and their weights.
    pub(crate) fn taps(&self, azimuth: f32) -> [(usize, f32); 2] {
        let at = azimuth * self.azimuths as f32;
        let below = at as usize;
        // No division: this is asked for each light of each pixel.
        let around = |azimuth: usize| if azimuth >= self.azimuths { azimuth - self.azimuths } else { azimuth };
        let (from, blend) = (around(below), at - below as f32);
        [(from, 1.0 - blend), (around(from + 1), blend)]
    }

    /// The horizons of some of the facets, in their order.
    pub fn picked(&self, facets: &[usize]) -> Self {
        let rows = (0..self.azimuths).map(|azimuth| self.row(azimuth));
        let elevations = rows.flat_map(|row| facets.iter().map(|&facet| row[facet])).collect();
        let Self { azimuths, ramp, truncated, .. } = *self;
        Self { azimuths, facets: facets.len(), ramp, elevations, truncated }
    }

    /// `Σ w v(direction)` over a run of facets with weights `w`: [`HorizonMap::fill`] and a sum at once. Azimuth in turns.
    pub(crate) fn seen_along(&self, [azimuth, elevation]: [f32; 2], range: Range<usize>, weights: &[f32]) -> f64 {
        let [(from, _), (to, blend)] = self.taps(azimuth);
        let row = |azimuth: usize| &self.row(azimuth)[range.clone()];
        simd::ground_sum(weights, row(from), row(to), blend, elevation, 1.0 / self.ramp)
    }

    /// Of each azimuth and run of facets, the elevations below which no facet and above which every facet sees a direction.
    pub(crate) fn reach(&self, runs: &[Range<usize>]) -> Vec<[f32; 2]> {
        let of = |horizons: &[f32]| {
            let (low, high) = horizons.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &at| {
                (if at < low { at } else { low }, if at > high { at } else { high })
            });
            // A little more than the ramp: the blend of two azimuths rounds.
            [low - 0.51 * self.ramp - 1e-6, high + 0.51 * self.ramp + 1e-6]
        };
        (0..self.azimuths).flat_map(|azimuth| runs.iter().map(move |run| of(&self.row(azimuth)[run.clone()]))).collect()
    }

    /// Writes the visibility in `[0, 1]` of a run of facets along `direction` (above the horizon); facing is not included.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        let (azimuth, elevation) = simd::azimuth_and_elevation(direction);
        let [(from, _), (to, blend)] = self.taps(azimuth);
        let row = |azimuth: usize| &self.row(azimuth)[range.clone()];
        simd::ground_visibility(row(from), row(to), blend, elevation, 1.0 / self.ramp, out);
    }
}
