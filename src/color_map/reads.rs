//! Colours of pixels by a few reads of tables in single precision: the prefiltered table, and two one-dimensional tables
//! that do not depend on the colour map. `shaders/color_map/` holds the twins.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::heights::{Largest, MAX_LAMBDA, lambda};
use super::prefiltered::MAX_DEVIATION;
use super::slopes::visible_moments;
use super::{DEVIATIONS, MEANS, PrefilteredTable};

/// Entries of each one-dimensional table.
pub const ENTRIES: usize = 512;
/// Octaves of `1 + a` that [`heights`] covers: exponents to 2e7.
const OCTAVES: f32 = 24.5;
/// Smallest `1/(1+Λ)`. It bounds Λ by 1e7.
const LEAST: f32 = 1e-7;

/// Bound of ν, which is infinite from above.
const MOST_NU: f32 = 1e30;

/// A table over a number from 0 to 1, read linearly.
pub type Entries = [[f32; 4]; ENTRIES];

/// `1/(1+Λ)` (Eq. 3), and mean and variance of visible slopes, over `ν/(1+ν)`, for ν ≥ 0.
pub fn directions() -> &'static Entries {
    static TABLE: LazyLock<Entries> = LazyLock::new(|| {
        std::array::from_fn(|k| {
            let t = k as f64 / (ENTRIES - 1) as f64;
            let nu = if t < 1.0 { t / (1.0 - t) } else { f64::INFINITY };
            let seen = if t == 0.0 { 0.0 } else { 1.0 / (1.0 + lambda(nu).min(MAX_LAMBDA)) };
            let (mean, variance) = if t < 1.0 { visible_moments(nu) } else { (0.0, 1.0) };
            [seen as f32, mean as f32, variance as f32, 0.0]
        })
    });
    &TABLE
}

/// Mean and deviation of D_h (Eq. 16) over [`octave`] of `1 + a`, divided by 24.5.
pub fn heights() -> &'static Entries {
    static TABLE: LazyLock<Entries> = LazyLock::new(|| {
        std::array::from_fn(|k| {
            let octave = f64::from(OCTAVES) * k as f64 / (ENTRIES - 1) as f64;
            let exponent = octave.floor().exp2() * (1.0 + octave.fract()) - 1.0;
            let at = Largest { exponent }.exact_moments();
            [at.mean as f32, at.deviation as f32, 0.0, 0.0]
        })
    });
    &TABLE
}

/// The logarithm to base 2 at powers of 2, and linear between them: it is read from the bits of the number.
#[inline]
fn octave(x: f32) -> f32 {
    const ONE: u32 = 0x3f80_0000;
    const PER_BIT: f32 = 1.0 / 8_388_608.0;
    x.to_bits().saturating_sub(ONE) as f32 * PER_BIT
}

#[inline]
fn entry(table: &Entries, t: f32) -> [f32; 3] {
    let x = t.clamp(0.0, 1.0) * (ENTRIES - 1) as f32;
    let k = (x as usize).min(ENTRIES - 2);
    let (f, a, b) = (x - k as f32, &table[k], &table[k + 1]);
    [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * (b[2] - a[2])]
}

/// A prefiltered table and the tables over a number.
#[derive(Debug, Clone, Copy)]
pub struct ColorReads<'a> {
    colors: &'a [Vec3],
    low: f32,
    /// Entries per mean.
    per_mean: f32,
    directions: &'a Entries,
    heights: &'a Entries,
}

/// Heights or slopes that a pixel holds: mean and deviation in deviations of the driver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Within {
    pub mean: f32,
    pub deviation: f32,
}

impl<'a> ColorReads<'a> {
    pub fn new(table: &'a PrefilteredTable) -> Self {
        let (low, per_mean) = table.mean_axis();
        Self { colors: table.colors(), low, per_mean, directions: directions(), heights: heights() }
    }

    /// The mean colour of a texture with this mean and deviation within the pixel. Means beyond the table count as its ends,
    /// which is exact only for deviations that are small against the distance to the stops.
    #[inline]
    pub fn texture(&self, at: Within) -> Vec3 {
        let x = ((at.mean - self.low) * self.per_mean).clamp(0.0, (MEANS - 1) as f32);
        let y = (at.deviation * (1.0 / MAX_DEVIATION as f32)).clamp(0.0, 1.0).sqrt() * (DEVIATIONS - 1) as f32;
        let (i, j) = ((x as usize).min(MEANS - 2), (y as usize).min(DEVIATIONS - 2));
        let (f, g) = (x - i as f32, y - j as f32);
        let row = |j: usize| {
            let at = j * MEANS + i;
            self.colors[at].lerp(self.colors[at + 1], f)
        };
        row(j).lerp(row(j + 1), g)
    }

    /// The mean colour of heights that are seen and lit. `nu` holds ν of viewer and light, `apart` the difference of
    /// their azimuths from 0 to π.
    #[inline]
    pub fn height(&self, nu: Vec2, apart: f32, at: Within) -> Vec3 {
        let lambda = |nu: f32| {
            let nu = nu.clamp(0.0, MOST_NU);
            1.0 / entry(self.directions, nu / (1.0 + nu))[0].max(LEAST) - 1.0
        };
        let (o, i) = (lambda(nu.x), lambda(nu.y));
        let independence = 4.41 * apart / (4.41 * apart + 1.0);
        let exponent = o.max(i) + independence * o.min(i);
        let [mean, deviation, _] = entry(self.heights, octave(1.0 + exponent) * (1.0 / OCTAVES));
        self.texture(Within { mean: at.mean + at.deviation * mean, deviation: at.deviation * deviation })
    }

    /// The mean colour of the slope along an azimuth that a viewer sees. `nu` is that of the viewer, `correlation` that
    /// of the slopes towards the viewer and along the azimuth. A plane that faces away from the viewer counts as ν = 0.
    #[inline]
    pub fn slope(&self, nu: f32, correlation: f32, at: Within) -> Vec3 {
        let nu = nu.clamp(0.0, MOST_NU);
        let [_, mean, variance] = entry(self.directions, nu / (1.0 + nu));
        let spread = (1.0 + correlation * correlation * (variance - 1.0)).max(0.0).sqrt();
        self.texture(Within { mean: at.mean + at.deviation * correlation * mean, deviation: at.deviation * spread })
    }
}

#[cfg(test)]
#[path = "reads_tests.rs"]
mod tests;
