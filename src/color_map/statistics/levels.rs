//! Periodic samples low-passed with pixels of increasing width.

use glam::{DVec2, UVec2};
use rayon::prelude::*;

/// Deviation of the Gaussian low-pass of a pixel of width 1. With the blur of bilinear reads between texels, whose variance
/// is a sixth of a texel's square, it has the deviation of a box, 0.29.
pub const LOW_PASS: f64 = 0.27;
/// Texels of a level per width of its pixel. The low-pass leaves nothing that bilinear reads of these texels miss.
const TEXELS_PER_PIXEL: f64 = 4.0;
/// Width of the last level's pixel in periods, at which nothing but the mean is left.
const LAST: f64 = 4.0;
/// Reach of a kernel [deviations].
const REACH: f64 = 4.0;

/// `C` channels of a periodic surface. Level k is low-passed with a pixel of `2^k` texels; level 0 holds the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Levels<const C: usize> {
    /// Width of a texel of level 0 [unit of the period].
    texel: f64,
    levels: Vec<Level<C>>,
}

#[derive(Debug, Clone, PartialEq)]
struct Level<const C: usize> {
    size: UVec2,
    values: Vec<[f32; C]>,
}

/// A place in two neighbouring levels: the index of the finer one and the weight of the coarser one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelAt {
    pub finer: usize,
    pub weight: f32,
}

impl<const C: usize> Levels<C> {
    /// Low-passes samples at the texel centres of a period of size `period`, row 0 at y = 0.
    pub fn new(period: DVec2, size: UVec2, values: Vec<[f32; C]>) -> Self {
        let texels = period / size.as_dvec2();
        let texel = texels.min_element();
        let mut levels = vec![Level { size, values }];
        let mut width = texel;
        while width < LAST * period.max_element() {
            let before = if levels.len() == 1 { 0.0 } else { LOW_PASS * width };
            width *= 2.0;
            let added = ((LOW_PASS * width).powi(2) - before * before).sqrt();
            let count = (period * TEXELS_PER_PIXEL / width).ceil().as_uvec2().clamp(UVec2::splat(4).min(size), size);
            levels.push(levels[levels.len() - 1].low_passed(count, DVec2::splat(added) / period));
        }
        Self { texel, levels }
    }

    pub fn count(&self) -> usize {
        self.levels.len()
    }

    /// The levels of a pixel of this width [unit of the period].
    pub fn of_width(&self, width: f64) -> LevelAt {
        let last = (self.levels.len() - 1) as f64;
        let level = (width / self.texel).max(1.0).log2().min(last);
        let finer = level.floor().min(last - 1.0).max(0.0);
        LevelAt { finer: finer as usize, weight: (level - finer).min(1.0) as f32 }
    }

    /// Width of a level's pixel [unit of the period].
    pub fn width(&self, level: usize) -> f64 {
        self.texel * (level as f64).exp2()
    }

    /// Width of a texel that resolves a place between two levels, in parts of the period.
    pub fn step(&self, at: LevelAt) -> DVec2 {
        self.levels[at.finer].size.as_dvec2().recip()
    }

    /// All samples of a level.
    pub fn values(&self, level: usize) -> (UVec2, &[[f32; C]]) {
        (self.levels[level].size, &self.levels[level].values)
    }

    /// The channels at a place in parts of the period.
    pub fn at(&self, place: DVec2, at: LevelAt) -> [f32; C] {
        let mut mixed = [0.0; C];
        self.mix(place, at, |texel, weight| (0..C).for_each(|c| mixed[c] += weight * texel[c]));
        mixed
    }

    /// One channel at a place.
    pub fn channel(&self, channel: usize, place: DVec2, at: LevelAt) -> f32 {
        let mut mixed = 0.0;
        self.mix(place, at, |texel, weight| mixed += weight * texel[channel]);
        mixed
    }

    fn mix(&self, place: DVec2, at: LevelAt, mut add: impl FnMut(&[f32; C], f32)) {
        let place = place - place.floor();
        for (level, weight) in [(at.finer, 1.0 - at.weight), (at.finer + 1, at.weight)] {
            if weight > 0.0 && level < self.levels.len() {
                self.levels[level].mix(place, weight, &mut add);
            }
        }
    }
}

impl<const C: usize> Level<C> {
    /// Bilinear weights at a place of the period, whose parts lie in 0..1.
    fn mix(&self, place: DVec2, weight: f32, add: &mut impl FnMut(&[f32; C], f32)) {
        let [width, height] = self.size.to_array().map(|count| count as usize);
        let (x, y) = ((place.x * width as f64) as f32 - 0.5, (place.y * height as f64) as f32 - 0.5);
        let (left, low) = (x.floor(), y.floor());
        let (f, g) = (x - left, y - low);
        let wrapped = |at: f32, count: usize| if at < 0.0 { count - 1 } else { (at as usize).min(count - 1) };
        let (i, j) = (wrapped(left, width), wrapped(low, height));
        let (next_i, next_j) = (if i + 1 == width { 0 } else { i + 1 }, if j + 1 == height { 0 } else { j + 1 });
        add(&self.values[j * width + i], weight * (1.0 - f) * (1.0 - g));
        add(&self.values[j * width + next_i], weight * f * (1.0 - g));
        add(&self.values[next_j * width + i], weight * (1.0 - f) * g);
        add(&self.values[next_j * width + next_i], weight * f * g);
    }

    /// The convolution with a Gaussian of these deviations [parts of the period], sampled at `count` texels.
    fn low_passed(&self, count: UVec2, deviation: DVec2) -> Self {
        let [width, height] = self.size.to_array().map(|count| count as usize);
        let [columns, rows] = count.to_array().map(|count| count as usize);
        let (across, down) = (kernels(width, columns, deviation.x), kernels(height, rows, deviation.y));
        let narrowed: Vec<[f32; C]> = (0..columns * height)
            .into_par_iter()
            .with_min_len(1024)
            .map(|k| weighted(&across[k % columns], |i| &self.values[k / columns * width + i]))
            .collect();
        let values = (0..columns * rows)
            .into_par_iter()
            .with_min_len(1024)
            .map(|k| weighted(&down[k / columns], |j| &narrowed[j * columns + k % columns]))
            .collect();
        Self { size: count, values }
    }
}

fn weighted<'a, const C: usize>(kernel: &[(usize, f64)], value: impl Fn(usize) -> &'a [f32; C]) -> [f32; C] {
    let mut sums = [0.0_f64; C];
    for (k, weight) in kernel {
        sums.iter_mut().zip(value(*k)).for_each(|(sum, value)| *sum += weight * f64::from(*value));
    }
    sums.map(|sum| sum as f32)
}

/// For each of `to` texel centres of a period, the samples of `from` texels under a Gaussian, with their weights.
fn kernels(from: usize, to: usize, deviation: f64) -> Vec<Vec<(usize, f64)>> {
    let spread = deviation * from as f64;
    let half = (REACH * spread).ceil().max(1.0) as i64;
    (0..to)
        .map(|k| {
            let centre = (k as f64 + 0.5) * from as f64 / to as f64 - 0.5;
            let nearest = centre.round() as i64;
            let weight = |i: i64| (-0.5 * ((i as f64 - centre) / spread.max(0.1)).powi(2)).exp();
            let total: f64 = (nearest - half..=nearest + half).map(weight).sum();
            let tap = |i: i64| (i.rem_euclid(from as i64) as usize, weight(i) / total);
            (nearest - half..=nearest + half).map(tap).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn wave(size: UVec2, waves: f64) -> Levels<1> {
        let value = |k: u32| [(TAU * waves * (f64::from(k % size.x) + 0.5) / f64::from(size.x)).sin() as f32];
        Levels::new(DVec2::new(2.0, 1.0), size, (0..size.x * size.y).map(value).collect())
    }

    #[test]
    fn a_wave_fades_as_under_the_gaussian_of_the_pixel_at_every_level() {
        for (size, waves) in [(UVec2::new(96, 48), 5.0), (UVec2::new(75, 9), 2.0)] {
            let levels = wave(size, waves);
            for level in 1..levels.count() {
                let width = levels.width(level);
                let expected = (-0.5 * (TAU * waves / 2.0 * LOW_PASS * width).powi(2)).exp();
                let (size, values) = levels.values(level);
                for (k, [value]) in values.iter().enumerate() {
                    let x = (f64::from(k as u32 % size.x) + 0.5) / f64::from(size.x);
                    let exact = expected * (TAU * waves * x).sin();
                    assert!((f64::from(*value) - exact).abs() < 2e-3, "{level} {k}: {value} {exact}");
                }
            }
            let (_, last) = levels.values(levels.count() - 1);
            assert!(last.iter().all(|[value]| value.abs() < 1e-6));
        }
    }

    #[test]
    fn reads_between_levels_and_texels_are_continuous_and_wrap() {
        let levels = wave(UVec2::new(64, 32), 3.0);
        let read = |x: f64, width: f64| levels.channel(0, DVec2::new(x, 0.3), levels.of_width(width));
        for k in 0..400 {
            let width = 0.01 * 1.02_f64.powi(k);
            assert!((read(0.21, width) - read(0.21, width * 1.0001)).abs() < 1e-3, "{width}");
            assert!((read(-0.79, width) - read(7.21, width)).abs() < 1e-5);
        }
        assert_eq!(levels.of_width(1e9), LevelAt { finer: levels.count() - 2, weight: 1.0 });
        assert_eq!(levels.of_width(0.0), LevelAt { finer: 0, weight: 0.0 });
        for k in 0..1000 {
            let x = 0.001 * f64::from(k);
            assert!((read(x, 0.1) - read(x + 1e-6, 0.1)).abs() < 1e-4, "{x}");
        }
    }

    #[test]
    fn a_single_sample_is_the_same_at_every_width() {
        let levels: Levels<2> = Levels::new(DVec2::ONE, UVec2::ONE, vec![[0.5, 2.0]]);
        for width in [0.0, 0.3, 1.0, 1e6] {
            assert_eq!(levels.at(DVec2::new(0.7, -3.2), levels.of_width(width)), [0.5, 2.0]);
        }
    }
}
