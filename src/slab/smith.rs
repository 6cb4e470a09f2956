//! Smith's Λ of a distribution of slopes without a closed form.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec2;
use rayon::prelude::*;

/// Number of azimuths.
const AZIMUTHS: usize = 72;
/// Number of steps of the polar angle from 0 to 90°.
const STEPS: usize = 180;
/// Number of bins of the slopes along an azimuth.
const BINS: usize = 768;

/// `B(θ, φ) = ∫ p (cos θ + sin θ m·t)+ dm - cos θ = Λ cos θ` with the horizontal unit vector `t` of azimuth φ. It is
/// bounded, unlike Λ, and 0 at small angles.
#[derive(Debug, Clone, PartialEq)]
pub struct SmithTable {
    /// By azimuth, then by polar angle.
    values: Vec<f32>,
}

impl SmithTable {
    /// The table of a distribution of slopes with masses that sum to 1.
    pub fn new(slopes: &[(DVec2, f64)]) -> Self {
        let reach = slopes.iter().map(|(m, _)| m.length()).fold(1e-9, f64::max);
        let rows = (0..AZIMUTHS).into_par_iter().flat_map_iter(|azimuth| row(slopes, reach, azimuth));
        Self { values: rows.collect() }
    }

    /// Λ of a direction `w` with `k = w.xy / w.z`. It is negative if the mean slope tilts away from the direction.
    pub fn lambda(&self, k: DVec2) -> f64 {
        let tangent = k.length();
        if tangent.is_nan() || tangent <= 0.0 {
            return 0.0;
        }
        let turn = (k.y.atan2(k.x) / TAU).rem_euclid(1.0) * AZIMUTHS as f64;
        let step = tangent.atan() / FRAC_PI_2 * STEPS as f64;
        let (azimuth, angle) = ((turn as usize).min(AZIMUTHS - 1), (step as usize).min(STEPS - 1));
        let (s, t) = (turn - azimuth as f64, step - angle as f64);
        let row = |azimuth: usize| {
            let at = azimuth % AZIMUTHS * (STEPS + 1) + angle;
            (1.0 - t) * f64::from(self.values[at]) + t * f64::from(self.values[at + 1])
        };
        ((1.0 - s) * row(azimuth) + s * row(azimuth + 1)) * (1.0 + tangent * tangent).sqrt()
    }
}

/// The values of one azimuth.
fn row(slopes: &[(DVec2, f64)], reach: f64, azimuth: usize) -> Vec<f32> {
    let along = DVec2::from_angle(azimuth as f64 / AZIMUTHS as f64 * TAU);
    let width = 2.0 * reach / (BINS - 1) as f64;
    let mut bins = vec![0.0; BINS];
    let mut mean = 0.0;
    for (slope, mass) in slopes {
        let s = slope.dot(along);
        mean += mass * s;
        let at = ((s + reach) / width).clamp(0.0, (BINS - 1) as f64 - 1e-9);
        let (bin, part) = (at as usize, at.fract());
        bins[bin] += mass * (1.0 - part);
        bins[bin + 1] += mass * part;
    }
    let value = |step: usize| {
        let (sin, cos) = (step as f64 / STEPS as f64 * FRAC_PI_2).sin_cos();
        // (x)+ = x + (-x)+: only slopes that are turned away remain in the sum.
        let hidden = |(bin, mass): (usize, &f64)| mass * (-cos - sin * (bin as f64 * width - reach)).max(0.0);
        (sin * mean + bins.iter().enumerate().map(hidden).sum::<f64>()) as f32
    };
    (0..=STEPS).map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::super::ellipse::{Ellipse, Profile};
    use super::*;

    #[test]
    fn the_table_of_beckmann_slopes_has_the_closed_form() {
        for (roughness, rotation) in [(DVec2::splat(0.3), 0.0), (DVec2::new(0.6, 0.2), 0.5)] {
            let ellipse = Ellipse::new(Profile::Beckmann, roughness, rotation).unwrap();
            let cell = |j: usize| (j as f64 + 0.5) / 300.0;
            let slopes: Vec<_> =
                (0..90_000).map(|j| (ellipse.slope(cell(j / 300), cell(j % 300)), 1.0 / 9e4)).collect();
            let table = SmithTable::new(&slopes);
            for (degrees, bound) in [(10.0, 1e-3), (45.0, 4e-3), (75.0, 4e-3), (85.0, 4e-3), (89.0_f64, 1e-2)] {
                for azimuth in [0.0, 0.3, 2.0, -1.0] {
                    let k = degrees.to_radians().tan() * DVec2::from_angle(azimuth);
                    let (closed, tabulated) = (1.0 + ellipse.lambda(k), 1.0 + table.lambda(k));
                    assert!((tabulated / closed - 1.0).abs() < bound, "{degrees} {azimuth}: {tabulated} {closed}");
                }
            }
        }
    }
}
