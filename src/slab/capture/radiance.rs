//! From the values of a pixel to the BTDF of its point (Dai et al. 2009, Sec. 4.1).

use glam::{DVec2, DVec3};

/// Light of one dot of the monitor at a point of the sheet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DotLight {
    /// Unit direction to the dot.
    pub i: DVec3,
    /// Irradiance of a dot of intensity 1: `cos θ / r²` [1/m²].
    pub irradiance: f64,
}

impl DotLight {
    /// The light of the dot at `dot` at the point `x` of the sheet; the monitor is `distance` above the sheet.
    pub fn new(dot: DVec2, distance: f64, x: DVec2) -> Self {
        let to = (dot - x).extend(distance);
        let square = to.length_squared();
        let i = to.try_normalize().unwrap_or(DVec3::Z);
        Self { i, irradiance: if square > 0.0 { i.z / square } else { 0.0 } }
    }

    /// Eq. 12: the BTDF [1/sr] of a pixel's radiance under a dot of the given intensity. The paper prints `r²` below the
    /// line; it belongs above it.
    pub fn btdf(&self, radiance: f64, intensity: f64) -> f64 {
        let irradiance = self.irradiance * intensity;
        if irradiance > 0.0 { radiance / irradiance } else { 0.0 }
    }
}

/// Part of the values whose median stands for the least, and their smallest number.
const LOWEST: f64 = 0.05;
const LOWEST_COUNT: usize = 5;

/// Eq. 14: the diffuse part of the BTDF, from the irradiance and the BTDF of each dot. 0 without any.
///
/// The paper takes the least of all values whose radiance exceeds 0.05 of the mean, against noise. A sheet without a diffuse
/// part has no dark value there, and the least of noisy values is too small. Here, the dots of at least the median
/// irradiance count, whose values have the least noise, and the median of the lowest 5 % of them is taken.
pub fn diffuse_part(values: &[(f64, f64)]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let of_rank = |mut values: Vec<f64>, rank: usize| *values.select_nth_unstable_by(rank, f64::total_cmp).1;
    let median = of_rank(values.iter().map(|(irradiance, _)| *irradiance).collect(), values.len() / 2);
    let strong: Vec<f64> =
        values.iter().filter(|(irradiance, _)| *irradiance >= median).map(|(_, btdf)| *btdf).collect();
    let count = ((LOWEST * strong.len() as f64) as usize).max(LOWEST_COUNT).min(strong.len());
    if strong.is_empty() { 0.0 } else { of_rank(strong, count / 2).max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lambertian_sheet_has_the_same_btdf_under_every_dot_because_r_squared_stands_above_the_line() {
        for dot in [DVec2::ZERO, DVec2::new(0.05, 0.02), DVec2::new(-0.2, 0.1)] {
            let (x, distance) = (DVec2::new(0.01, -0.02), 0.04);
            let light = DotLight::new(dot, distance, x);
            let to = (dot - x).extend(distance);
            // A point source of intensity 3 gives E = 3 cos θ / r², and a diffuse BTDF of 0.25 sends 0.25 E.
            let radiance = 0.25 * 3.0 * (distance / to.length()) / to.length_squared();
            assert!((light.btdf(radiance, 3.0) / 0.25 - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_diffuse_part_is_the_floor_below_a_lobe_and_weak_dots_and_one_noisy_value_do_not_change_it() {
        let value = |k: usize| 0.02 + 5.0 * (-(k as f64 / 20.0).powi(2)).exp();
        let mut values: Vec<(f64, f64)> = (0..200).map(|k| (1.0, value(k))).collect();
        values.extend((0..200).map(|k| (0.1, 0.01 * k as f64 - 1.0)));
        assert!((diffuse_part(&values) - 0.02).abs() < 1e-6);
        values[199].1 = 0.0;
        assert!((diffuse_part(&values) - 0.02).abs() < 1e-6);
        assert_eq!(diffuse_part(&[]), 0.0);
        assert_eq!(diffuse_part(&[(0.0, 0.0); 4]), 0.0);
    }

    #[test]
    fn a_lobe_without_a_diffuse_part_has_none() {
        let values: Vec<(f64, f64)> = (0..400).map(|k| (1.0, 5.0 * (-(k as f64 / 40.0).powi(2)).exp())).collect();
        assert!(diffuse_part(&values) < 1e-6);
    }
}
