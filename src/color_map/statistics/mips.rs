//! The first two moments of a driver over footprints (Heitz et al. 2013, Sec. 4.2).

use glam::{DMat2, DVec2, UVec2};

use super::grid::{DriverGrid, bilinear};
use crate::color_map::Normal;

/// Levels of means of f and f², each half as wide as the one below.
#[derive(Debug, Clone, PartialEq)]
pub struct MomentMips {
    levels: Vec<(UVec2, Vec<[f32; 2]>)>,
}

/// Largest number of reads along a footprint's longer axis, and in all.
const MAX_READS: usize = 64;
/// Distance between reads along the longer axis [deviations of a read].
const SPACING: f64 = 1.8;

/// Deviation of each read, and offsets with weights, for 1, 2 or 4 reads along one axis of a footprint of deviation 1.
/// Mean and variance of the reads together are those of the footprint.
fn scheme(taps: u32) -> (f64, &'static [(f64, f64)]) {
    match taps {
        1 => (1.0, &[(0.0, 1.0)]),
        4 => (0.8, &[(-0.6, 0.5), (0.6, 0.5)]),
        _ => (0.5, &[(-1.425, 0.145_333), (-0.475, 0.354_667), (0.475, 0.354_667), (1.425, 0.145_333)]),
    }
}

impl MomentMips {
    pub fn new(grid: &DriverGrid) -> Self {
        let mut levels = vec![(grid.size, level_zero(grid))];
        while let Some((size, below)) = levels.last().filter(|(size, _)| size.max_element() > 1) {
            let half = (*size / 2).max(UVec2::ONE);
            let narrower = shrunk(below, size.x as usize, size.y as usize, half.x as usize, false);
            let level = shrunk(&narrower, half.x as usize, size.y as usize, half.y as usize, true);
            levels.push((half, level));
        }
        Self { levels }
    }

    /// Mean and deviation over the whole tile.
    pub fn whole(&self) -> Normal {
        let [first, second] = self.levels.last().map_or([0.0; 2], |(_, values)| values[0].map(f64::from));
        Normal { mean: first, deviation: (second - first * first).max(0.0).sqrt() }
    }

    /// Reads the moments of a Gaussian footprint: weight, mean and deviation of each read. `covariance` is in texels².
    /// A read takes its variance after interpolation.
    pub fn reads(&self, grid: &DriverGrid, centre: DVec2, covariance: DMat2, taps: u32) -> Vec<(f64, Normal)> {
        let (axes, deviations) = principal(covariance);
        let (part, offsets) = scheme(taps);
        let narrow = part * deviations[1];
        // A read below half a texel is no narrower than the texel; more of them would repeat it.
        let wide = narrow.max(0.5).max(SPACING.recip() * 5.0 * deviations[0] / MAX_READS as f64);
        let along = long_axis(deviations[0], narrow, wide, offsets, part);
        let isotropic = along.len() == offsets.len();
        let short: &[(f64, f64)] = offsets;
        let read_covariance = {
            let first = if isotropic { part * deviations[0] } else { wide.min(deviations[0]) };
            [first, narrow]
        };
        let mut reads = Vec::with_capacity(along.len() * short.len());
        for (x, weight) in &along {
            for (y, other) in short {
                let at = centre + axes[0] * *x + axes[1] * (*y * deviations[1]);
                reads.push((weight * other, self.read(grid, at, axes, read_covariance)));
            }
        }
        reads
    }

    /// Moments about a point for a read of these deviations along the axes [texels].
    fn read(&self, grid: &DriverGrid, at: DVec2, axes: [DVec2; 2], deviations: [f64; 2]) -> Normal {
        // A level interpolated linearly is a kernel of half its texel's side as deviation.
        let level = (2.0 * deviations[0].max(deviations[1])).max(1e-300).log2();
        let first = grid_value(grid, at);
        if level <= -1.0 {
            return Normal { mean: first, deviation: by_gradient(grid, at, axes, deviations) };
        }
        let last = (self.levels.len() - 1) as f64;
        let low = level.clamp(0.0, last).floor();
        let f = level.clamp(0.0, last) - low;
        let (a, b) = (self.level(low as usize, at), self.level((low as usize + 1).min(last as usize), at));
        let moments = [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1])];
        let variance = (moments[1] - moments[0] * moments[0]).max(0.0);
        if level >= 0.0 {
            return Normal { mean: moments[0], deviation: variance.sqrt() };
        }
        // From half a texel to a texel the variance goes from that of the slope to that of the texels.
        let t = level + 1.0;
        let narrow = by_gradient(grid, at, axes, deviations).powi(2);
        Normal { mean: first + t * (moments[0] - first), deviation: (narrow + t * (variance - narrow)).max(0.0).sqrt() }
    }

    fn level(&self, level: usize, at: DVec2) -> [f64; 2] {
        let (size, values) = &self.levels[level];
        let scale = size.as_dvec2() / self.levels[0].0.as_dvec2();
        bilinear(*size, at * scale, |k| values[k].map(f64::from))
    }
}

fn grid_value(grid: &DriverGrid, texel: DVec2) -> f64 {
    bilinear(grid.size, texel, |k| [f64::from(grid.values[k]), 0.0])[0]
}

fn by_gradient(grid: &DriverGrid, at: DVec2, axes: [DVec2; 2], deviations: [f64; 2]) -> f64 {
    let gradient = grid.gradient(at);
    (0..2).map(|k| (gradient.dot(axes[k]) * deviations[k]).powi(2)).sum::<f64>().sqrt()
}

/// Offsets and weights along the longer axis [texels]: as many reads as keep each about as long as wide.
fn long_axis(deviation: f64, narrow: f64, wide: f64, offsets: &[(f64, f64)], part: f64) -> Vec<(f64, f64)> {
    let is_round = part * deviation <= 1.2 * narrow.max(0.5);
    if is_round {
        return offsets.iter().map(|(x, weight)| (x * deviation, *weight)).collect();
    }
    let spread = (deviation * deviation - wide * wide).max(0.0).sqrt();
    let step = SPACING * wide;
    let half = ((2.5 * spread / step).ceil() as i32).clamp(1, MAX_READS as i32 / 2);
    let weight = |k: i32| (-0.5 * (f64::from(k) * step / spread.max(1e-12)).powi(2)).exp();
    let total: f64 = (-half..=half).map(weight).sum();
    (-half..=half).map(|k| (f64::from(k) * step, weight(k) / total)).collect()
}

/// Unit axes and deviations of a covariance, the longer first.
pub fn principal(covariance: DMat2) -> ([DVec2; 2], [f64; 2]) {
    let (a, b, d) = (covariance.x_axis.x, covariance.x_axis.y, covariance.y_axis.y);
    let (middle, half) = (0.5 * (a + d), (0.25 * (a - d) * (a - d) + b * b).sqrt());
    let angle = 0.5 * (2.0 * b).atan2(a - d);
    let axis = DVec2::from_angle(angle);
    ([axis, axis.perp()], [(middle + half).max(0.0).sqrt(), (middle - half).max(0.0).sqrt()])
}

/// Moments over each texel of the bilinear surface through the samples: exact by two Gauss points per quarter texel
/// and axis, because f² is quadratic there.
fn level_zero(grid: &DriverGrid) -> Vec<[f32; 2]> {
    let size = grid.size;
    let offset = 0.25 / 3.0_f64.sqrt();
    let nodes = [-0.25 - offset, -0.25 + offset, 0.25 - offset, 0.25 + offset];
    let at = |k: u32| {
        let centre = DVec2::new(f64::from(k % size.x), f64::from(k / size.x)) + 0.5;
        let mut sums = [0.0; 2];
        for y in nodes {
            for x in nodes {
                let value = grid_value(grid, centre + DVec2::new(x, y));
                sums[0] += value / 16.0;
                sums[1] += value * value / 16.0;
            }
        }
        sums.map(|sum| sum as f32)
    };
    use rayon::prelude::*;
    (0..size.x * size.y).into_par_iter().with_min_len(4096).map(at).collect()
}

/// Halves one axis. Where the count is odd, texels of the coarser level cover parts of those below, so that means stay
/// exact.
fn shrunk(values: &[[f32; 2]], width: usize, height: usize, count: usize, rows: bool) -> Vec<[f32; 2]> {
    let from = if rows { height } else { width };
    if from == count {
        return values.to_vec();
    }
    let scale = from as f64 / count as f64;
    let taps: Vec<Vec<(usize, f64)>> = (0..count)
        .map(|k| {
            let (low, high) = (k as f64 * scale, (k + 1) as f64 * scale);
            let cover = |j: usize| (high.min((j + 1) as f64) - low.max(j as f64)).max(0.0) / scale;
            (low as usize..(high.ceil() as usize).min(from)).map(|j| (j, cover(j))).collect()
        })
        .collect();
    let (columns, lines) = if rows { (width, count) } else { (count, height) };
    let at = |index: usize| {
        let (x, y) = (index % columns, index / columns);
        let mut sums = [0.0_f64; 2];
        for (j, weight) in &taps[if rows { y } else { x }] {
            let value = if rows { values[j * width + x] } else { values[y * width + j] };
            sums[0] += weight * f64::from(value[0]);
            sums[1] += weight * f64::from(value[1]);
        }
        sums.map(|sum| sum as f32)
    };
    (0..columns * lines).map(at).collect()
}

#[cfg(test)]
#[path = "mips_tests.rs"]
mod tests;
