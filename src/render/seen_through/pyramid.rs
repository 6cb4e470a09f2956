//! An image at many resolutions, read with Gaussian footprints of any shape.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Largest number of reads along the longer axis of a footprint.
const MAX_PROBES: usize = 9;
/// Variance of a bilinear read of level k in squared texels of level 0: `A 4^k - B`. Each level is reduced by weights of
/// variance 11/4, and the linear interpolation adds 1/6.
const A: f32 = 13.0 / 12.0;
const B: f32 = 11.0 / 12.0;

/// Excess of the variance along the longer axis, over that along the shorter, from which several reads are made.
const ROUND: f32 = 0.8;

/// One resolution.
#[derive(Debug, Clone)]
struct Level {
    size: [usize; 2],
    texels: Vec<Vec3>,
}

/// An image at resolutions that halve. It repeats along x, and along y if `wraps_y`; otherwise its border rows continue.
#[derive(Debug, Clone)]
pub struct Pyramid {
    levels: Vec<Level>,
    wraps_y: bool,
}

/// The reads that average a footprint.
#[derive(Debug, Clone, Copy)]
pub struct Kernel {
    /// Reads around the centre: offsets in texels of level 0, with weights.
    probes: [(Vec2, f32); MAX_PROBES],
    count: usize,
    level: usize,
    /// Weight of the next coarser level.
    coarser: f32,
    /// Variance that is read over that which was asked for, at most 1.
    pub share: f32,
}

impl Pyramid {
    /// `texels` has `size[0] * size[1]` entries, row by row, at least one.
    pub fn new(size: [usize; 2], texels: Vec<Vec3>, wraps_y: bool) -> Self {
        let mut levels = vec![Level { size, texels }];
        while let Some(last) = levels.last().filter(|level| level.size != [1, 1]) {
            let next = last.reduced(wraps_y);
            levels.push(next);
        }
        Self { levels, wraps_y }
    }

    pub fn size(&self) -> [usize; 2] {
        self.levels[0].size
    }

    /// Size and texels of each resolution, from the finest.
    pub fn levels(&self) -> impl Iterator<Item = ([usize; 2], &[Vec3])> {
        self.levels.iter().map(|level| (level.size, &level.texels[..]))
    }

    pub fn wraps_y(&self) -> bool {
        self.wraps_y
    }

    /// The mean over all texels.
    pub fn mean(&self) -> Vec3 {
        self.levels.last().map_or(Vec3::ZERO, |level| level.texels[0])
    }

    /// The reads of a Gaussian footprint with the covariance xx, xy, yy [squared texels of level 0].
    pub fn kernel(&self, covariance: [f32; 3]) -> Kernel {
        let [xx, xy, yy] = covariance;
        let largest = (4 * self.size()[0].max(self.size()[1])) as f32;
        let bound = largest * largest;
        let scale = bound / (xx + yy).max(bound);
        let (xx, xy, yy) = (xx * scale, xy * scale, yy * scale);
        let (middle, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let radius = (half * half + xy * xy).sqrt();
        let (major, minor) = (middle + radius, (middle - radius).max(0.0));
        let major = if major.is_finite() { major } else { bound };
        // As many probes as are allowed must cover the longer axis.
        let minor = if minor.is_finite() { minor } else { bound }.max(major / 14.0).max(A - B);
        // A nearly round footprint is read as a round one of the same mean variance.
        let rest = major - minor;
        let minor = if rest > ROUND * minor { minor } else { minor + 0.5 * rest };
        // The exponent of a number is the integer part of its logarithm.
        let exponent = (((minor + B) / A).to_bits() >> 23) as i32 - 127;
        let low = (exponent.max(0) as usize / 2).min(self.levels.len() - 1);
        let variance = |level: usize| A * (1u64 << (2 * level)) as f32 - B;
        let coarser = if low + 1 < self.levels.len() {
            ((minor - variance(low)) / (variance(low + 1) - variance(low))).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let mut kernel = Kernel { probes: [(Vec2::ZERO, 1.0); MAX_PROBES], count: 1, level: low, coarser, share: 1.0 };
        if rest > ROUND * minor && low + 1 < self.levels.len() {
            // The axis has two forms; this one is free of cancellation.
            let axis = if half > 0.0 { Vec2::new(half + radius, xy) } else { Vec2::new(xy, radius - half) };
            let along = axis.try_normalize().unwrap_or(Vec2::X);
            kernel.spread(along * rest.sqrt(), (rest / minor).sqrt());
        }
        kernel
    }

    /// As [`Self::kernel`], but one read, as wide as the shorter axis and at one resolution.
    pub fn narrow_kernel(&self, [xx, xy, yy]: [f32; 3]) -> Kernel {
        let (middle, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let minor = (middle - (half * half + xy * xy).sqrt()).max(0.0);
        let kernel = self.kernel([minor, 0.0, minor]);
        let read = A * (1u64 << (2 * kernel.level)) as f32 - B;
        Kernel { coarser: 0.0, share: (read / minor.max(1e-12)).min(1.0), ..kernel }
    }

    /// The mean of the image under a footprint around `at` [texels of level 0].
    pub fn read(&self, at: Vec2, kernel: &Kernel) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for (offset, weight) in &kernel.probes[..kernel.count] {
            let mut value = self.bilinear(kernel.level, at + *offset);
            if kernel.coarser > 0.0 {
                value += kernel.coarser * (self.bilinear(kernel.level + 1, at + *offset) - value);
            }
            sum += *weight * value;
        }
        sum
    }

    /// Reads one level at `at` [texels of level 0].
    pub fn bilinear(&self, level: usize, at: Vec2) -> Vec3 {
        let Level { size: [width, height], texels } = &self.levels[level];
        let [full_width, full_height] = self.size();
        let x = at.x * (*width as f32 / full_width as f32) - 0.5;
        let y = at.y * (*height as f32 / full_height as f32) - 0.5;
        let ((left, s), (top, t)) = (floor(x), floor(y));
        let rows = if self.wraps_y {
            [wrapped(top, *height), wrapped(top + 1, *height)]
        } else {
            [top, top + 1].map(|row| row.clamp(0, *height as i32 - 1) as usize)
        };
        let (a, b) = (wrapped(left, *width), wrapped(left + 1, *width));
        let [upper, lower] = rows.map(|row| {
            let row = &texels[row * width..][..*width];
            row[a] + s * (row[b] - row[a])
        });
        upper + t * (lower - upper)
    }
}

/// The integer at or below a number, and the rest. Far numbers end at the range of integers that f32 holds.
fn floor(x: f32) -> (i32, f32) {
    let x = x.clamp(-1.6e7, 1.6e7);
    let towards_zero = x as i32;
    let below = towards_zero - i32::from((towards_zero as f32) > x);
    (below, x - below as f32)
}

fn wrapped(k: i32, n: usize) -> usize {
    if n.is_power_of_two() { k as usize & (n - 1) } else { k.rem_euclid(n as i32) as usize }
}

impl Kernel {
    /// Places [deviations] and weights of 3, 5, 7 and 9 reads along a line.
    pub fn reads() -> &'static [Vec<(f32, f32)>] {
        &*READS
    }

    /// Spreads reads along `deviation`, which is `ratio` times the footprint of one read.
    fn spread(&mut self, deviation: Vec2, ratio: f32) {
        self.count = (((2.4 * ratio).ceil() as usize) | 1).clamp(3, MAX_PROBES);
        for (probe, (at, weight)) in self.probes.iter_mut().zip(&READS[self.count / 2 - 1]) {
            *probe = (deviation * *at, *weight);
        }
    }
}

/// Places [deviations] and weights of 3, 5, 7 and 9 reads along a line.
static READS: LazyLock<[Vec<(f32, f32)>; MAX_PROBES / 2]> = LazyLock::new(|| std::array::from_fn(|k| reads(2 * k + 3)));

/// Places [deviations] and weights of `count` reads along a line.
fn reads(count: usize) -> Vec<(f32, f32)> {
    // The reads reach over 2.2 deviations to either side.
    let step = 4.4 / (count - 1) as f32;
    let at = |k: usize| (k as f32 - 0.5 * (count - 1) as f32) * step;
    let weights: Vec2 = (0..count).map(|k| Vec2::new(1.0, at(k) * at(k)) * (-0.5 * at(k) * at(k)).exp()).sum();
    // The reads have exactly the variance that is asked for.
    let widen = (weights.x / weights.y).sqrt();
    (0..count).map(|k| (at(k) * widen, (-0.5 * at(k) * at(k)).exp() / weights.x)).collect()
}

impl Level {
    fn reduced(&self, wraps_y: bool) -> Self {
        let [width, height] = self.size;
        let size = self.size.map(|side| side.div_ceil(2));
        let columns = weights(width, size[0], true);
        let rows = weights(height, size[1], wraps_y);
        let row = |y: usize| {
            let mean =
                |x: usize| -> Vec3 { columns[x].iter().map(|(k, weight)| *weight * self.texels[y * width + k]).sum() };
            (0..size[0]).map(mean).collect::<Vec<Vec3>>()
        };
        let narrow: Vec<Vec<Vec3>> = (0..height).into_par_iter().map(row).collect();
        let texel = |x: usize, y: usize| -> Vec3 { rows[y].iter().map(|(k, weight)| *weight * narrow[*k][x]).sum() };
        let texels = (0..size[0] * size[1]).into_par_iter().map(|k| texel(k % size[0], k / size[0])).collect();
        Self { size, texels }
    }
}

/// The finer texels of each coarser one, with weights: a tent that is 1, 3, 5, 7, 7, 5, 3, 1 if the sizes halve. Narrower
/// weights would let waves of the size of a texel through, which a linear interpolation distorts.
fn weights(fine: usize, coarse: usize, wraps: bool) -> Vec<Vec<(usize, f32)>> {
    let ratio = fine as f32 / coarse as f32;
    (0..coarse)
        .map(|k| {
            let center = (k as f32 + 0.5) * ratio - 0.5;
            let reach = 2.0 * ratio;
            let tent = |at: i64| (1.0 - (at as f32 - center).abs() / reach).max(0.0);
            let first = (center - reach).floor() as i64;
            let all: Vec<(i64, f32)> = (first..=first + 9).map(|at| (at, tent(at))).filter(|tap| tap.1 > 0.0).collect();
            let sum: f32 = all.iter().map(|tap| tap.1).sum();
            let place = |at: i64| {
                if wraps { at.rem_euclid(fine as i64) as usize } else { at.clamp(0, fine as i64 - 1) as usize }
            };
            all.into_iter().map(|(at, weight)| (place(at), weight / sum)).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_footprint_reads_a_wave_with_the_contrast_of_a_gaussian() {
        // A Gaussian of covariance C reads the wave of frequency k with the factor exp(-kᵀCk / 2).
        let side = 256;
        for (period, angle) in [(64.0, 0.0), (32.0, 0.0)] {
            let k = std::f32::consts::TAU / period * Vec2::from_angle(angle);
            let wave = |x: usize, y: usize| (k.dot(Vec2::new(x as f32 + 0.5, y as f32 + 0.5))).cos();
            let texels = (0..side * side).map(|n| Vec3::splat(wave(n % side, n / side))).collect();
            let pyramid = Pyramid::new([side; 2], texels, true);
            for (major, minor, turn) in [
                (2.0, 2.0, 0.0),
                (6.0, 6.0, 0.0),
                (8.0, 3.0, 0.0),
                (12.0, 4.0, 0.7),
                (9.0, 2.5, std::f32::consts::FRAC_PI_2),
            ] {
                let (u, v) = (major * Vec2::from_angle(turn), minor * Vec2::from_angle(turn).perp());
                let covariance = [u.x * u.x + v.x * v.x, u.x * u.y + v.x * v.y, u.y * u.y + v.y * v.y];
                let expected = (-0.5 * (k.dot(u).powi(2) + k.dot(v).powi(2))).exp();
                let kernel = pyramid.kernel(covariance);
                // Centres of several phases.
                let error = (0..16)
                    .map(|n| {
                        let at = Vec2::new(100.0 + n as f32 * 2.3, 50.0);
                        pyramid.read(at, &kernel).x - expected * k.dot(at).cos()
                    })
                    .fold(0.0, |worst: f32, error| worst.max(error.abs()));
                assert!(error < 0.06, "period {period}, footprint {major} x {minor} at {turn}: {error}");
            }
        }
    }

    #[test]
    fn every_footprint_reads_an_even_image_exactly_and_none_is_too_large() {
        let pyramid = Pyramid::new([37, 20], vec![Vec3::new(1.0, 0.5, 0.25); 740], false);
        for covariance in [[0.0; 3], [1e-9, 0.0, 1e9], [1e30, 1e29, 1e30], [f32::INFINITY, 0.0, 1.0], [5.0, 4.9, 5.0]] {
            let value = pyramid.read(Vec2::new(-1e4, 3.0), &pyramid.kernel(covariance));
            assert!((value - Vec3::new(1.0, 0.5, 0.25)).abs().max_element() < 1e-5, "{covariance:?}: {value}");
        }
        assert!((pyramid.mean() - Vec3::new(1.0, 0.5, 0.25)).length() < 1e-5);
    }
}
