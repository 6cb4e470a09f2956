//! Horizon maps: per facet and azimuth, the elevation below which all directions are blocked (Max 1988).

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

/// The elevation [rad] below which all directions are blocked, for each azimuth and facet. Exact without overhangs.
///
/// Between azimuths the elevation is interpolated, not the visibility, so few azimuths suffice.
/// Visibility rises from 0 to 1 over `transition_width` radians, so results computed from it are continuous.
#[derive(Debug, Clone)]
pub struct HorizonMap {
    pub(super) azimuths: usize,
    pub(super) facets: usize,
    pub(super) transition_width: f32,
    /// Elevations by `[azimuth][facet]`: [`HorizonMap::FREE`] if nothing blocks, [`HorizonMap::BLOCKED`] if all is
    /// blocked.
    pub(super) elevations: Vec<f32>,
    /// Number of truncated walks.
    pub(super) truncated: usize,
}

impl HorizonMap {
    /// A horizon so low that the soft step stays at or below elevation 0.
    const FREE: f32 = -0.02;
    /// A horizon so high that the soft step never reaches the zenith.
    pub(super) const BLOCKED: f32 = FRAC_PI_2 + 0.02;

    /// Cuts the mesh along every azimuth for every facet. Elevations are exact.
    pub fn scan(grid: &PeriodicGrid, facets: &Facets, azimuths: usize, transition_width: f32) -> Self {
        let (slicer, origins) = (Slicer::new(grid), lifted_origins(facets, grid.tile_size));
        Self::fill_rows(facets.len(), azimuths, transition_width, |along, row| {
            let truncated = scan_all(&slicer.rotated(along.truncate()), facets, &origins, &mut |facet, blocked| {
                row[facet as usize] = blocked.highest();
            });
            grid.cancel.step(azimuths);
            truncated
        })
    }

    /// Walks the samples of a height field. The horizons equal those of [`HorizonMap::scan`]; this function is several
    /// times faster.
    pub fn march(
        heights: &HeightGrid,
        tile_size: glam::Vec2,
        facets: &Facets,
        azimuths: usize,
        transition_width: f32,
    ) -> Self {
        let march = HeightMarch::new(heights, tile_size);
        Self::fill_rows(facets.len(), azimuths, transition_width, |along, row| {
            march_all(&march, facets, along.truncate(), row);
            0
        })
    }

    /// Computes the rows with `fill`, which writes slopes (tangents) of the horizon along a plane direction and returns
    /// its number of truncated walks.
    fn fill_rows(
        facets: usize,
        azimuths: usize,
        transition_width: f32,
        fill: impl Fn(Vec3, &mut [f32]) -> usize + Sync,
    ) -> Self {
        let mut slopes = vec![0.0; facets * azimuths];
        let rows = slopes.par_chunks_mut(facets.max(1)).enumerate();
        let truncated =
            rows.map(|(azimuth, row)| fill(from_angles(FRAC_PI_2, TAU * azimuth as f32 / azimuths as f32), row)).sum();
        Self { truncated, ..Self::from_slopes(facets, azimuths, transition_width, slopes) }
    }

    /// Converts slopes (tangents) of the horizons, by `[azimuth][facet]`, to elevations.
    pub(super) fn from_slopes(facets: usize, azimuths: usize, transition_width: f32, slopes: Vec<f32>) -> Self {
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
        Self { azimuths, facets, transition_width: Self::clamped_width(transition_width), elevations, truncated: 0 }
    }

    /// Clamps a width of the soft step [rad] to the range that a horizon map supports.
    pub(crate) fn clamped_width(transition_width: f32) -> f32 {
        transition_width.clamp(1e-6, -2.0 * Self::FREE)
    }

    pub fn facets(&self) -> usize {
        self.facets
    }

    pub(crate) fn azimuths(&self) -> usize {
        self.azimuths
    }

    /// Width of the soft step [rad].
    pub(crate) fn transition_width(&self) -> f32 {
        self.transition_width
    }

    /// Elevation [rad] below which all directions along one azimuth are blocked.
    pub(crate) fn elevation(&self, azimuth: usize, facet: usize) -> f32 {
        self.elevations[azimuth * self.facets + facet]
    }

    /// Fraction of the walks that were truncated. Blockers of directions near the horizon may be missing from these.
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

    /// The two nodes around an azimuth [turns, at most 1], and their weights.
    pub(crate) fn taps(&self, azimuth: f32) -> [(usize, f32); 2] {
        let at = azimuth * self.azimuths as f32;
        let below = at as usize;
        // No division: rendering calls this function for each light of each pixel.
        let wrapped = |azimuth: usize| if azimuth >= self.azimuths { azimuth - self.azimuths } else { azimuth };
        let (from, blend) = (wrapped(below), at - below as f32);
        [(from, 1.0 - blend), (wrapped(from + 1), blend)]
    }

    /// The horizon map of some of the facets, in the given order.
    pub fn subset(&self, facets: &[usize]) -> Self {
        let rows = (0..self.azimuths).map(|azimuth| self.row(azimuth));
        let elevations = rows.flat_map(|row| facets.iter().map(|&facet| row[facet])).collect();
        let Self { azimuths, transition_width, truncated, .. } = *self;
        Self { azimuths, facets: facets.len(), transition_width, elevations, truncated }
    }

    /// Computes `Σ w V(direction)` over a run of facets with weights `w`. The azimuth is in turns, the elevation in
    /// radians.
    pub(crate) fn visible_sum(&self, [azimuth, elevation]: [f32; 2], range: Range<usize>, weights: &[f32]) -> f64 {
        let [(from, _), (to, blend)] = self.taps(azimuth);
        let row = |azimuth: usize| &self.row(azimuth)[range.clone()];
        simd::visible_sum(weights, row(from), row(to), blend, elevation, 1.0 / self.transition_width)
    }

    /// Elevation bounds [rad] of each azimuth and run of facets. Every facet is blocked below the first bound and
    /// visible above the second.
    pub(crate) fn horizon_bounds(&self, runs: &[Range<usize>]) -> Vec<[f32; 2]> {
        let bounds = |horizons: &[f32]| {
            let (low, high) = horizons.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &at| {
                (if at < low { at } else { low }, if at > high { at } else { high })
            });
            // Slightly more than half the transition width, because the blend of two azimuths rounds.
            [low - 0.51 * self.transition_width - 1e-6, high + 0.51 * self.transition_width + 1e-6]
        };
        (0..self.azimuths)
            .flat_map(|azimuth| runs.iter().map(move |run| bounds(&self.row(azimuth)[run.clone()])))
            .collect()
    }

    /// Writes the visibility in `[0, 1]` of a run of facets along `direction`, which points above the horizon. Facing
    /// is not included.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        let (azimuth, elevation) = simd::azimuth_and_elevation(direction);
        let [(from, _), (to, blend)] = self.taps(azimuth);
        let row = |azimuth: usize| &self.row(azimuth)[range.clone()];
        simd::horizon_visibility(row(from), row(to), blend, elevation, 1.0 / self.transition_width, out);
    }
}
