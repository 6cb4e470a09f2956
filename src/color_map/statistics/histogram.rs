//! Histograms of a driver over blocks of texels: the exact distribution of large footprints, up to the width of a bin.

use glam::{DMat2, DVec2, DVec3, UVec2};

use super::DriverGrid;
use super::mips::principal;
use crate::color_map::{Normal, StopMap};

/// Number of bins.
pub const BINS: usize = 64;
/// Texels along a side of a block of the finest level.
const BLOCK: u32 = 8;
/// Samples per texel and axis of the bilinear surface.
const SAMPLES: u32 = 2;
/// Part of the values beyond each end of the bins.
const OUTSIDE: f64 = 5e-4;
/// A footprint takes blocks of at most this many of its shorter deviations, up to this distance.
const BLOCKS_PER_DEVIATION: f64 = 0.5;
const REACH: f64 = 3.5;
/// Smallest shorter deviation of a footprint that histograms resolve [texels].
pub const MIN_DEVIATION: f64 = BLOCK as f64 / BLOCKS_PER_DEVIATION;
/// Samples of the map within a bin.
const COLORS: usize = 32;

/// One level: its size in blocks, and the parts of each block's values in each bin.
type Level = (UVec2, Vec<[f32; BINS]>);

/// Histograms at levels of blocks of 8, 16, ... texels.
#[derive(Debug, Clone)]
pub struct HistogramMips {
    low: f64,
    high: f64,
    texels: UVec2,
    levels: Vec<Level>,
}

impl HistogramMips {
    pub fn new(grid: &DriverGrid) -> Self {
        let mut sorted = grid.values.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        let at = |part: f64| f64::from(sorted[((sorted.len() - 1) as f64 * part).round() as usize]);
        let (low, high) = if sorted.is_empty() { (0.0, 0.0) } else { (at(OUTSIDE), at(1.0 - OUTSIDE)) };
        let (low, high) = if high > low { (low, high) } else { (low - 0.5, low + 0.5) };
        let blocks = (grid.size / BLOCK).max(UVec2::ONE);
        let mut counts = vec![[0.0_f32; BINS]; blocks.element_product() as usize];
        let fine = grid.size * SAMPLES;
        for y in 0..fine.y {
            for x in 0..fine.x {
                let place = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / fine.as_dvec2();
                let value = grid.at(place / f64::from(grid.repeat));
                let bin = (((value - low) / (high - low)) * BINS as f64).clamp(0.0, BINS as f64 - 1.0) as usize;
                let block = (place * blocks.as_dvec2()).as_uvec2().min(blocks - 1);
                counts[(block.y * blocks.x + block.x) as usize][bin] += 1.0;
            }
        }
        for bins in &mut counts {
            let total: f32 = bins.iter().sum();
            bins.iter_mut().for_each(|bin| *bin /= total.max(1.0));
        }
        let mut levels = vec![(blocks, counts)];
        while let Some((size, below)) = levels.last().filter(|(size, _)| size.min_element() % 2 == 0) {
            let level = coarser(*size, below);
            levels.push(level);
        }
        Self { low, high, texels: grid.size, levels }
    }

    /// The distribution over a Gaussian footprint: parts of the bins. `covariance` is in texels².
    pub fn read(&self, centre: DVec2, covariance: DMat2) -> [f64; BINS] {
        let (axes, deviations) = principal(covariance);
        let wanted = (BLOCKS_PER_DEVIATION * deviations[1]).max(1.0);
        let side = |size: UVec2| (self.texels.as_dvec2() / size.as_dvec2()).max_element();
        let fits = |level: &&Level| side(level.0) <= wanted;
        let (size, bins) = self.levels.iter().rev().find(fits).unwrap_or(&self.levels[0]);
        let step = self.texels.as_dvec2() / size.as_dvec2();
        // Beyond a few periods the footprint holds all of the tile evenly.
        let whole = self.texels.as_dvec2();
        let reach = axes[0].abs() * deviations[0] + axes[1].abs() * deviations[1];
        let reach = (reach * REACH).min(whole * 4.0) / step;
        let first = (centre / step - reach).floor();
        let count = (2.0 * reach).ceil() + 1.0;
        let mut sums = [0.0; BINS];
        let mut total = 0.0;
        for j in 0..count.y as i64 {
            for i in 0..count.x as i64 {
                let block = first + DVec2::new(i as f64, j as f64);
                let d = (block + 0.5) * step - centre;
                let square = |k: usize| (d.dot(axes[k]) / deviations[k].max(1e-12)).powi(2);
                let weight = (-0.5 * (square(0) + square(1))).exp();
                let wrapped = |at: f64, size: u32| at.rem_euclid(f64::from(size)) as usize % size as usize;
                let index = wrapped(block.y, size.y) * size.x as usize + wrapped(block.x, size.x);
                sums.iter_mut().zip(&bins[index]).for_each(|(sum, part)| *sum += weight * f64::from(*part));
                total += weight;
            }
        }
        sums.map(|sum| if total > 0.0 { sum / total } else { 0.0 })
    }

    fn value(&self, bin: usize, inside: f64) -> f64 {
        self.low + (self.high - self.low) * (bin as f64 + inside) / BINS as f64
    }

    /// The mean of a map under parts of bins; values are even within a bin.
    pub fn mean(&self, map: &StopMap, parts: &[f64; BINS]) -> DVec3 {
        let color = |bin: usize| {
            let at = |k: usize| map.color(self.value(bin, (k as f64 + 0.5) / COLORS as f64));
            (0..COLORS).map(at).sum::<DVec3>() / COLORS as f64
        };
        (0..BINS).map(|bin| color(bin) * parts[bin]).sum()
    }

    /// Mean and deviation under parts of bins.
    pub fn moments(&self, parts: &[f64; BINS]) -> Normal {
        let mean: f64 = (0..BINS).map(|bin| self.value(bin, 0.5) * parts[bin]).sum();
        let square: f64 = (0..BINS).map(|bin| (self.value(bin, 0.5) - mean).powi(2) * parts[bin]).sum();
        Normal { mean, deviation: square.sqrt() }
    }
}

/// Halves both axes, which have an even number of blocks.
fn coarser(size: UVec2, below: &[[f32; BINS]]) -> Level {
    let half = size / 2;
    let at = |index: u32| {
        let (x, y) = (2 * (index % half.x), 2 * (index / half.x));
        let mut sums = [0.0; BINS];
        for (x, y) in [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)] {
            let bins = &below[(y * size.x + x) as usize];
            sums.iter_mut().zip(bins).for_each(|(sum, part)| *sum += 0.25 * part);
        }
        sums
    };
    (half, (0..half.element_product()).map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color_map::statistics::{Footprint, PlaceDriver};
    use crate::color_map::stops::tests::{MAPS, map};
    use crate::reference::color_map::supersampled;
    use crate::scene::{NoiseBasis, NoiseDriver};

    #[test]
    fn histograms_agree_with_supersampling_of_large_footprints_and_far_away_with_the_plain_mean() {
        let grid = DriverGrid::of_noise(&NoiseDriver { basis: NoiseBasis::Perlin, cells: 32, octaves: 1, seed: 1 });
        let mips = HistogramMips::new(&grid);
        let size = grid.size.as_dvec2();
        for name in MAPS {
            for deviations in [[20.0, 20.0], [60.0, 17.0]] {
                let texels =
                    DMat2::from_diagonal(DVec2::new(deviations[0] * deviations[0], deviations[1] * deviations[1]));
                let scale = DMat2::from_diagonal(size.recip());
                let at = Footprint { centre: DVec2::new(0.31, 0.77), covariance: scale * texels * scale };
                let exact = supersampled(&grid, &map(name), &at, 64, 3);
                let parts = mips.read(at.centre * size, texels);
                assert!((parts.iter().sum::<f64>() - 1.0).abs() < 1e-5);
                let error = (mips.mean(&map(name), &parts) - exact.color).abs().max_element();
                assert!(error < 0.012 + 4.0 * exact.standard_error.max_element(), "{name}: {error}");
                assert!((mips.moments(&parts).deviation - exact.moments.deviation).abs() < 0.02);
            }
            let far = mips.read(DVec2::ZERO, DMat2::from_diagonal(DVec2::splat(1e9)));
            let plain = PlaceDriver::new(grid.clone()).plain_mean(&map(name));
            assert!((mips.mean(&map(name), &far) - plain).abs().max_element() < 0.005, "{name}");
        }
        let constant = HistogramMips::new(&DriverGrid::new(UVec2::new(3, 1), &[2.0; 3], 1));
        let parts = constant.read(DVec2::ZERO, DMat2::from_diagonal(DVec2::splat(1e12)));
        assert!((parts.iter().sum::<f64>() - 1.0).abs() < 1e-6);
    }
}
