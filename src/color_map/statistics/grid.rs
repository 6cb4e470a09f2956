//! Drivers that depend on the place: samples over the tile.

use glam::{DVec2, UVec2};

use super::noise;
use crate::scene::NoiseDriver;

/// Samples of a driver in deviations from its mean, wrapped, bilinear between centres `((i+½)/w, (j+½)/h)`.
#[derive(Debug, Clone, PartialEq)]
pub struct DriverGrid {
    pub size: UVec2,
    pub values: Vec<f32>,
    /// Mean and deviation in the driver's own unit. The deviation of a constant is 0, and its values are 0.
    pub mean: f64,
    pub deviation: f64,
    /// Number of periods across the tile.
    pub repeat: u32,
}

impl DriverGrid {
    pub fn new(size: UVec2, values: &[f32], repeat: u32) -> Self {
        let count = values.len().max(1) as f64;
        let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / count;
        let square = values.iter().map(|value| (f64::from(*value) - mean).powi(2)).sum::<f64>() / count;
        // Below the rounding of f32 a deviation is noise.
        let deviation = if square.sqrt() > 1e-7 * mean.abs() { square.sqrt() } else { 0.0 };
        let standard =
            |value: &f32| if deviation > 0.0 { ((f64::from(*value) - mean) / deviation) as f32 } else { 0.0 };
        Self { size, values: values.iter().map(standard).collect(), mean, deviation, repeat }
    }

    pub fn of_noise(driver: &NoiseDriver) -> Self {
        let (side, values) = noise::rasterize(driver);
        Self::new(UVec2::splat(side as u32), &values, 1)
    }

    /// A place in parts of the tile's size, in texels.
    pub fn texels(&self, place: DVec2) -> DVec2 {
        place * f64::from(self.repeat) * self.size.as_dvec2()
    }

    /// The value at a place in parts of the tile's size [deviations].
    pub fn at(&self, place: DVec2) -> f64 {
        self.at_texel(self.texels(place))
    }

    fn at_texel(&self, texel: DVec2) -> f64 {
        bilinear(self.size, texel, |k| [f64::from(self.values[k]), 0.0])[0]
    }

    /// Change of the value per texel along both axes.
    pub fn gradient(&self, texel: DVec2) -> DVec2 {
        let slope = |d: DVec2| self.at_texel(texel + 0.5 * d) - self.at_texel(texel - 0.5 * d);
        DVec2::new(slope(DVec2::X), slope(DVec2::Y))
    }
}

/// Interpolates pairs of values between texel centres of a wrapped image.
pub(super) fn bilinear(size: UVec2, texel: DVec2, value: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
    let at = texel - 0.5;
    let (base, f) = (at.floor(), at - at.floor());
    let wrapped = |at: f64, count: u32| at.rem_euclid(f64::from(count)) as usize % count as usize;
    let (x, y) = (
        [wrapped(base.x, size.x), wrapped(base.x + 1.0, size.x)],
        [wrapped(base.y, size.y), wrapped(base.y + 1.0, size.y)],
    );
    let texel = |i: usize, j: usize| value(y[j] * size.x as usize + x[i]);
    let mix = |a: [f64; 2], b: [f64; 2], f: f64| [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1])];
    mix(mix(texel(0, 0), texel(1, 0), f.x), mix(texel(0, 1), texel(1, 1), f.x), f.y)
}
