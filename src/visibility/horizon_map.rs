//! Horizon maps: per facet and azimuth, the slope below which all directions are blocked (Max 1988).

use std::f32::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::Resolution;
use super::height_march::{HeightMarch, march_all};
use super::scan::scan_all;
use super::slicer::Slicer;
use crate::base::Cancel;
use crate::geometry::{Facets, HeightGrid};
use crate::geometry::{PeriodicGrid, lifted_origins};
use crate::math::directions::from_angles;
use crate::math::simd;
use crate::math::simd::HorizonTaps;

/// The slope (tangent of the elevation) below which all directions are blocked, for each azimuth and facet. Exact
/// without overhangs.
///
/// Between azimuths the slope is interpolated, not the visibility, so few azimuths suffice. Above a straight wall the
/// slope is `a cos φ + b sin φ`, and the interpolation is exact.
/// Visibility rises from 0 to 1 over `transition_width` radians at the plane's horizon, and over `transition_width`
/// times the cosine of a higher one, so results computed from it are continuous.
#[derive(Debug, Clone)]
pub struct HorizonMap {
    pub(super) azimuths: usize,
    pub(super) facets: usize,
    pub(crate) transition_width: f32,
    /// Slopes by `[azimuth][facet]`: [`HorizonMap::FREE`] or 0 if nothing blocks, [`HorizonMap::BLOCKED`] if all is
    /// blocked.
    pub(super) slopes: Vec<f32>,
    /// Number of truncated walks.
    pub(super) truncated: usize,
    /// The direction of [`Azimuths::Across`], between which the interpolation is exact.
    pub(crate) across: Option<Vec2>,
    weights: SineWeights,
}

/// The azimuths of a horizon map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Azimuths {
    /// A number of azimuths at equal distances, from x on.
    Even(usize),
    /// The azimuths across and along grooves, from one unit direction across them on. They determine all others: at an
    /// angle φ to the plane across the grooves, a horizon has `cos φ` times the slope of that across them.
    Across(Vec2),
}

impl Azimuths {
    pub fn count(self) -> usize {
        match self {
            Self::Even(count) => count,
            Self::Across(_) => HorizonMap::AZIMUTHS_OF_GROOVES,
        }
    }

    /// The number of azimuths along which horizons are computed.
    fn computed(self) -> usize {
        match self {
            Self::Even(count) => count,
            Self::Across(_) => 2,
        }
    }

    /// The unit direction of one azimuth in the plane. `None` along grooves, where nothing rises.
    fn along(self, azimuth: usize) -> Option<Vec3> {
        match self {
            Self::Even(count) => Some(from_angles(FRAC_PI_2, TAU * azimuth as f32 / count as f32)),
            Self::Across(across) => {
                [Some(across), None, Some(-across), None][azimuth % 4].map(|along| along.extend(0.0))
            }
        }
    }
}

/// The weights `sin((1-t)Δ)/sin Δ` and `sin(tΔ)/sin Δ` of two azimuths Δ apart, at fraction t of the way. They
/// interpolate `a cos φ + b sin φ` exactly.
#[derive(Debug, Clone, Copy)]
struct SineWeights {
    /// Δ [rad].
    step: f32,
    per_sine: f32,
}

impl SineWeights {
    fn new(azimuths: usize) -> Self {
        // From half a turn on, no wave is determined. Over a small step the weights are linear.
        let step = if azimuths < 4 { 1e-3 } else { TAU / azimuths as f32 };
        Self { step, per_sine: 1.0 / sine(step) }
    }

    fn at(&self, blend: f32) -> [f32; 2] {
        [1.0 - blend, blend].map(|part| sine(part * self.step) * self.per_sine)
    }
}

/// The sine of an angle in `[0, π/2]`, within 2e-9 plus rounding (Abramowitz and Stegun, 4.3.97).
#[inline(always)]
fn sine(x: f32) -> f32 {
    let s = x * x;
    let high = s * (-0.000_198_409 + s * (0.000_002_752_6 - s * 0.000_000_023_9));
    x * (1.0 + s * (-0.166_666_67 + s * (0.008_333_332 + high)))
}

impl HorizonMap {
    /// The slope of a facet that nothing blocks, along this azimuth and its neighbours. It is so low that the transition
    /// stays below elevation 0 for the widest transition, by more than rounding: tan(-0.02).
    const FREE: f32 = -0.020_002_667;
    /// A slope so high that the transition never reaches the zenith. It is finite, so that its product with 0 is 0.
    pub(super) const BLOCKED: f32 = 1e9;
    /// Number of [`Azimuths::Across`].
    pub(crate) const AZIMUTHS_OF_GROOVES: usize = 4;
    /// Smallest cosine of an elevation. Times [`HorizonMap::BLOCKED`] it is far above 1, so that blocked facets are
    /// blocked at the zenith.
    const MIN_COSINE: f32 = 1e-6;

    /// Cuts the mesh along every azimuth for every facet. Slopes are exact.
    pub fn scan(grid: &PeriodicGrid, facets: &Facets, azimuths: usize, transition_width: f32) -> Self {
        Self::scan_along(grid, facets, Azimuths::Even(azimuths), transition_width)
    }

    /// As [`HorizonMap::scan`], for azimuths about grooves as well.
    pub(crate) fn scan_along(grid: &PeriodicGrid, facets: &Facets, azimuths: Azimuths, transition_width: f32) -> Self {
        let (slicer, origins) = (Slicer::new(grid), lifted_origins(facets, grid.tile_size));
        Self::fill_rows(facets.len(), azimuths, transition_width, |along, row| {
            let truncated = scan_all(&slicer.rotated(along.truncate()), facets, &origins, &mut |facet, blocked| {
                row[facet as usize] = blocked.highest();
            });
            grid.cancel.step(azimuths.computed());
            truncated
        })
    }

    /// Walks the samples of a height field. The horizons equal those of [`HorizonMap::scan`]; this function is several
    /// times faster.
    pub fn march(
        heights: &HeightGrid,
        tile_size: Vec2,
        facets: &Facets,
        azimuths: usize,
        transition_width: f32,
    ) -> Self {
        let azimuths = Azimuths::Even(azimuths);
        Self::cancellable_march(heights, tile_size, facets, azimuths, transition_width, &Cancel::default())
    }

    /// As [`HorizonMap::march`], for azimuths about grooves as well, and with a count of the azimuths that are done.
    pub(crate) fn cancellable_march(
        heights: &HeightGrid,
        tile_size: Vec2,
        facets: &Facets,
        azimuths: Azimuths,
        transition_width: f32,
        cancel: &Cancel,
    ) -> Self {
        let march = HeightMarch::new(heights, tile_size);
        Self::fill_rows(facets.len(), azimuths, transition_width, |along, row| {
            if !cancel.is_set() {
                march_all(&march, facets, along.truncate(), row);
            }
            cancel.step(azimuths.computed());
            0
        })
    }

    /// Computes the rows with `fill`, which writes slopes of the horizon along a plane direction and returns its number
    /// of truncated walks.
    fn fill_rows(
        facets: usize,
        azimuths: Azimuths,
        transition_width: f32,
        fill: impl Fn(Vec3, &mut [f32]) -> usize + Sync,
    ) -> Self {
        let mut slopes = vec![0.0; facets * azimuths.count()];
        let rows = slopes.par_chunks_mut(facets.max(1)).enumerate();
        let truncated = rows.map(|(azimuth, row)| azimuths.along(azimuth).map_or(0, |along| fill(along, row))).sum();
        let across = match azimuths {
            Azimuths::Even(_) => None,
            Azimuths::Across(across) => Some(across),
        };
        Self { truncated, across, ..Self::from_slopes(facets, azimuths.count(), transition_width, slopes) }
    }

    /// Takes slopes of the horizons in `[0, ∞]`, by `[azimuth][facet]`.
    pub(super) fn from_slopes(facets: usize, azimuths: usize, transition_width: f32, slopes: Vec<f32>) -> Self {
        let row = |azimuth: usize| &slopes[azimuth % azimuths * facets..][..facets];
        let mut stored = vec![0.0; slopes.len()];
        stored.par_chunks_mut(facets.max(1)).enumerate().for_each(|(azimuth, stored)| {
            let (before, own, after) = (row(azimuth + azimuths - 1), row(azimuth), row(azimuth + 1));
            for (stored, ((&before, &own), &after)) in stored.iter_mut().zip(before.iter().zip(own).zip(after)) {
                // Beside a horizon, the slope 0 keeps the interpolation to it exact.
                let least = if before.max(after) > 0.0 { 0.0 } else { Self::FREE };
                *stored = if own <= 0.0 { least } else { own.min(Self::BLOCKED) };
            }
        });
        let slopes = stored;
        Self::stored([azimuths, facets, 0], None, Self::clamped_width(transition_width), slopes)
    }

    /// The map of stored slopes, from the numbers of azimuths, facets and truncated walks.
    pub(super) fn stored(
        [azimuths, facets, truncated]: [usize; 3],
        across: Option<Vec2>,
        transition_width: f32,
        slopes: Vec<f32>,
    ) -> Self {
        Self { azimuths, facets, transition_width, slopes, truncated, across, weights: SineWeights::new(azimuths) }
    }

    /// Clamps a width of the transition [rad] to the range that a horizon map supports.
    pub(crate) fn clamped_width(transition_width: f32) -> f32 {
        transition_width.clamp(1e-6, 0.04)
    }

    pub fn facets(&self) -> usize {
        self.facets
    }

    pub(crate) fn azimuths(&self) -> usize {
        self.azimuths
    }

    /// Slope below which all directions along one azimuth are blocked.
    pub(crate) fn slope(&self, azimuth: usize, facet: usize) -> f32 {
        self.slopes[azimuth * self.facets + facet]
    }

    /// Fraction of the walks that were truncated. Blockers of directions near the horizon may be missing from these.
    pub fn truncated(&self) -> f64 {
        self.truncated as f64 / self.slopes.len().max(1) as f64
    }

    pub fn bytes(&self) -> usize {
        4 * self.slopes.len()
    }

    /// Slopes of all facets along one azimuth.
    pub(super) fn row(&self, azimuth: usize) -> &[f32] {
        &self.slopes[azimuth * self.facets..][..self.facets]
    }

    /// The taps of a unit direction above the plane.
    pub(crate) fn taps(&self, direction: Vec3) -> HorizonTaps {
        let (azimuth, cosine) = simd::azimuth_and_cosine(direction);
        self.taps_at(direction, azimuth, cosine)
    }

    /// As [`HorizonMap::taps`], from the azimuth of the direction [turns, at most 1] and the cosine of its elevation.
    pub(crate) fn taps_at(&self, direction: Vec3, azimuth: f32, cosine: f32) -> HorizonTaps {
        let sharpness = 1.0 / self.transition_width;
        let scale = cosine.max(Self::MIN_COSINE) * sharpness;
        let base = 0.5 + direction.z * sharpness;
        if let Some(across) = self.across {
            // The slope of a wall, times its cosine, times that of the elevation.
            let along_walls = across.perp_dot(direction.truncate());
            let over_walls = across.dot(direction.truncate());
            let (b, a) = (along_walls.abs() * sharpness, over_walls.abs().max(Self::MIN_COSINE) * sharpness);
            let (azimuths, scales) = match (over_walls >= 0.0, along_walls >= 0.0) {
                (true, true) => ([0, 1], [a, b]),
                (false, true) => ([1, 2], [b, a]),
                (false, false) => ([2, 3], [a, b]),
                (true, false) => ([3, 0], [b, a]),
            };
            return HorizonTaps { azimuths, blend: 0.0, base, scale, scales };
        }
        let at = azimuth * self.azimuths as f32;
        let below = at as usize;
        // No division: rendering calls this function for each light of each pixel.
        let wrapped = |azimuth: usize| if azimuth >= self.azimuths { azimuth - self.azimuths } else { azimuth };
        let (from, blend) = (wrapped(below), at - below as f32);
        let scales = self.weights.at(blend).map(|weight| weight * scale);
        HorizonTaps { azimuths: [from, wrapped(from + 1)], blend, base, scale, scales }
    }

    /// The taps of a unit direction above the plane at a lower resolution.
    pub(super) fn coarse_taps(&self, direction: Vec3, resolution: Resolution) -> HorizonTaps {
        let Resolution { azimuth_step, softness } = resolution;
        let azimuths = self.azimuths / azimuth_step;
        let coarse = Self {
            azimuths,
            transition_width: Self::clamped_width(softness * self.transition_width),
            slopes: Vec::new(),
            weights: SineWeights::new(azimuths),
            ..*self
        };
        let taps = coarse.taps(direction);
        HorizonTaps { azimuths: taps.azimuths.map(|azimuth| azimuth * azimuth_step), ..taps }
    }

    /// The horizon map of some of the facets, in the given order.
    pub fn subset(&self, facets: &[usize]) -> Self {
        let mut slopes = Vec::with_capacity(self.azimuths * facets.len());
        for row in (0..self.azimuths).map(|azimuth| self.row(azimuth)) {
            slopes.extend(facets.iter().map(|&facet| row[facet]));
        }
        Self { facets: facets.len(), slopes, ..*self }
    }

    /// Computes `Σ w V(direction)` over a run of facets with weights `w`.
    pub(crate) fn visible_sum(&self, taps: &HorizonTaps, range: Range<usize>, weights: &[f32]) -> f64 {
        let [from, to] = taps.azimuths.map(|azimuth| &self.row(azimuth)[range.clone()]);
        simd::visible_sum(weights, from, to, taps)
    }

    /// The lowest and the highest slope of each azimuth and run of facets. The visibility of every facet of a run lies
    /// between those of the two bounds ([`HorizonTaps::between`]).
    pub(crate) fn horizon_bounds(&self, runs: &[Range<usize>]) -> Vec<[f32; 2]> {
        let bounds = |slopes: &[f32]| {
            // The fold over a pair is vectorized; over an array it is not.
            let (low, high) = slopes.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &at| {
                (if at < low { at } else { low }, if at > high { at } else { high })
            });
            [low, high]
        };
        (0..self.azimuths)
            .flat_map(|azimuth| runs.iter().map(move |run| bounds(&self.row(azimuth)[run.clone()])))
            .collect()
    }

    /// Writes the visibility in `[0, 1]` of a run of facets along `direction`, which points above the horizon. Facing
    /// is not included.
    pub fn fill(&self, direction: Vec3, range: Range<usize>, out: &mut [f32]) {
        self.fill_taps(&self.taps(direction), range, out);
    }

    /// As [`HorizonMap::fill`], from the taps of the direction.
    pub(super) fn fill_taps(&self, taps: &HorizonTaps, range: Range<usize>, out: &mut [f32]) {
        let [from, to] = taps.azimuths.map(|azimuth| &self.row(azimuth)[range.clone()]);
        simd::horizon_visibility(from, to, taps, out);
    }
}

#[cfg(test)]
#[path = "horizon_map_tests.rs"]
mod tests;
