//! All statistics of a driver that depends on the place: moments of its values, and of its ranks.

use std::sync::{Arc, OnceLock};

use glam::{DMat2, DVec2, DVec3};

use super::{DriverGrid, MomentMips};
use crate::color_map::{Normal, Quantiles, StopMap, gaussianize};
use crate::scene::Gaussianize;

/// Mean colour far away that may be wrong before `gaussianize = "auto"` uses ranks.
const FAR_ERROR: f64 = 0.005;
/// Largest number of points from which quantiles are taken.
const MAX_POINTS: u32 = 1 << 20;

/// A driver on the tile. Moments are computed when they are first read, so that colouring facets needs none.
#[derive(Debug)]
pub struct PlaceDriver {
    pub grid: DriverGrid,
    mips: OnceLock<MomentMips>,
    ranked: OnceLock<Ranked>,
}

/// The ranks of a driver.
#[derive(Debug)]
struct Ranked {
    grid: DriverGrid,
    mips: MomentMips,
    /// Values of the surface by their quantile.
    quantiles: Quantiles,
}

/// A footprint: its centre in parts of the tile's size, and its covariance in the same unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    pub centre: DVec2,
    pub covariance: DMat2,
}

/// A map of a driver, ready to be filtered: the stops in the unit of the moments, and the choice between values and
/// ranks.
#[derive(Debug, Clone)]
pub struct PlaceMap {
    driver: Arc<PlaceDriver>,
    map: StopMap,
    ranked: bool,
}

impl PlaceDriver {
    pub fn new(grid: DriverGrid) -> Self {
        Self { grid, mips: OnceLock::new(), ranked: OnceLock::new() }
    }

    /// Moments of the values.
    pub fn mips(&self) -> &MomentMips {
        self.mips.get_or_init(|| MomentMips::new(&self.grid))
    }

    fn ranked(&self) -> &Ranked {
        self.ranked.get_or_init(|| {
            let grid = DriverGrid::new(self.grid.size, &gaussianize(&self.grid.values), self.grid.repeat);
            let mips = MomentMips::new(&grid);
            Ranked { grid, mips, quantiles: Quantiles::new(self.surface_values()) }
        })
    }

    /// Centre and covariance of a footprint in texels.
    fn in_texels(&self, footprint: &Footprint) -> (DVec2, DMat2) {
        let scale = DMat2::from_diagonal(self.grid.size.as_dvec2() * f64::from(self.grid.repeat));
        (self.grid.texels(footprint.centre), scale * footprint.covariance * scale)
    }

    /// The reads of a footprint: weights and moments of the values.
    fn reads(&self, footprint: &Footprint, taps: u32) -> Vec<(f64, Normal)> {
        let (centre, covariance) = self.in_texels(footprint);
        self.mips().reads(&self.grid, centre, covariance, taps)
    }

    /// The mean over a footprint [deviations], by one read as of a mip-mapped texture.
    pub fn mean(&self, footprint: &Footprint) -> f64 {
        self.reads(footprint, 1).iter().map(|(weight, at)| weight * at.mean).sum()
    }

    /// Values between texels as well, because footprints see the interpolated surface.
    fn surface_values(&self) -> Vec<(f32, f32)> {
        let size = self.grid.size;
        let count = size.x * size.y;
        let parts = if 4 * count <= MAX_POINTS { 2 } else { 1 };
        let texel = |k: u32| DVec2::new(f64::from(k % (size.x * parts)), f64::from(k / (size.x * parts)));
        let scale = DVec2::splat(f64::from(self.grid.repeat)) * (size * parts).as_dvec2();
        let at = |k: u32| (self.grid.at((texel(k) + 0.5) / scale) as f32, 1.0);
        (0..count * parts * parts).map(at).collect()
    }

    /// The plain mean of a map's colours over the tile.
    pub fn plain_mean(&self, map: &StopMap) -> DVec3 {
        let values = self.surface_values();
        values.iter().map(|(value, _)| map.color(f64::from(*value))).sum::<DVec3>() / values.len().max(1) as f64
    }
}

impl PlaceMap {
    /// A map over deviations of a driver.
    pub fn new(driver: Arc<PlaceDriver>, map: &StopMap, gaussianize: Gaussianize) -> Self {
        let by_values = || map.mean(&driver.mips().whole());
        let ranked = match gaussianize {
            _ if driver.grid.deviation == 0.0 => false,
            Gaussianize::On => true,
            Gaussianize::Off => false,
            Gaussianize::Auto => (by_values() - driver.plain_mean(map)).abs().max_element() > FAR_ERROR,
        };
        let map = if ranked { driver.ranked().quantiles.compose(map) } else { map.clone() };
        Self { driver, map, ranked }
    }

    /// The map over the values that [`PlaceMap::reads`] returns.
    pub fn map(&self) -> &StopMap {
        &self.map
    }

    /// Moments over the whole tile, in the unit of [`PlaceMap::map`].
    pub fn whole(&self) -> Normal {
        if self.ranked { Normal { mean: 0.0, deviation: 1.0 } } else { self.driver.mips().whole() }
    }

    /// Moments of the driver over the whole tile, in its deviations.
    pub fn moments_of_whole(&self) -> Normal {
        self.driver.mips().whole()
    }

    /// The reads of a footprint: weights and moments in the unit of [`PlaceMap::map`].
    pub fn reads(&self, footprint: &Footprint, taps: u32) -> Vec<(f64, Normal)> {
        if !self.ranked {
            return self.driver.reads(footprint, taps);
        }
        let (centre, covariance) = self.driver.in_texels(footprint);
        let ranked = self.driver.ranked();
        let whole = ranked.mips.whole();
        let standard = |at: Normal| Normal {
            mean: (at.mean - whole.mean) / whole.deviation,
            deviation: at.deviation / whole.deviation,
        };
        let reads = ranked.mips.reads(&ranked.grid, centre, covariance, taps);
        reads.into_iter().map(|(weight, at)| (weight, standard(at))).collect()
    }

    /// Mean and deviation of the driver over a footprint, in deviations of the driver.
    pub fn moments(&self, footprint: &Footprint, taps: u32) -> Normal {
        let (mut first, mut second) = (0.0, 0.0);
        for (weight, at) in self.driver.reads(footprint, taps) {
            first += weight * at.mean;
            second += weight * (at.mean * at.mean + at.deviation * at.deviation);
        }
        Normal { mean: first, deviation: (second - first * first).max(0.0).sqrt() }
    }

    /// The mean colour of a footprint.
    pub fn mean(&self, footprint: &Footprint, taps: u32) -> DVec3 {
        self.reads(footprint, taps).iter().map(|(weight, at)| self.map.mean(at) * *weight).sum()
    }
}

#[cfg(test)]
#[path = "place_tests.rs"]
mod tests;
