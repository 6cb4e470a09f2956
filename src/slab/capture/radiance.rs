//! From the values of a pixel to the BTDF of its point (Dai et al. 2009, Sec. 4.1).

use glam::{DVec2, DVec3};

use super::fit::Sample;

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

/// Part of the cells of directions that count as dark.
const LOWEST: f64 = 0.05;
/// Dots per cell, and the number of cells below which cells hold fewer.
const PER_CELL: usize = 8;
const LEAST_CELLS: usize = 20;

/// Eq. 14: the diffuse part of the BTDF, from the samples of each camera. Values that are no numbers take no part; 0 without any.
///
/// The paper takes the least of all values whose radiance exceeds 0.05 of the mean, against noise. A sheet without a diffuse
/// part has no dark value there, and the least of noisy values is too small. Here, the dots of at least the median
/// irradiance count, whose values have the least noise, and the median of values in the darkest cells of directions is taken.
/// One half of a cell's values decides whether the other half counts, so that noise does not select small values.
pub fn diffuse_part(views: &[&[Sample]]) -> f64 {
    let finite = |samples: &[Sample]| -> Vec<Sample> {
        samples.iter().filter(|sample| sample.btdf.is_finite()).copied().collect()
    };
    let views: Vec<Vec<Sample>> = views.iter().map(|samples| finite(samples)).collect();
    let Some(strong) = median(views.iter().flatten().map(|sample| sample.irradiance).collect()) else { return 0.0 };
    let mut halves = Vec::new();
    for samples in &views {
        let strong: Vec<Sample> = samples.iter().filter(|sample| sample.irradiance >= strong).copied().collect();
        for cell in cells(&strong) {
            let half = |k: usize| cell.iter().skip(k).step_by(2).copied().collect::<Vec<f64>>();
            let (even, odd) = (half(0), if cell.len() > 1 { half(1) } else { half(0) });
            halves.extend(median(even.clone()).map(|key| (key, odd.clone())));
            halves.extend(median(odd).map(|key| (key, even)));
        }
    }
    halves.sort_by(|a, b| a.0.total_cmp(&b.0));
    let count = ((LOWEST * halves.len() as f64) as usize).max(2);
    median(halves.into_iter().take(count).flat_map(|(_, values)| values).collect()).map_or(0.0, |value| value.max(0.0))
}

/// The values of samples by square cells of directions (i.x, i.y). A cell of one sample is left out if cells hold several.
fn cells(samples: &[Sample]) -> Vec<Vec<f64>> {
    let per_cell = (samples.len() / LEAST_CELLS).clamp(1, PER_CELL);
    let side = ((samples.len() / per_cell) as f64).sqrt().floor().max(1.0);
    let place = |sample: &Sample| sample.i.truncate();
    let low = samples.iter().map(place).fold(DVec2::MAX, DVec2::min);
    let span = (samples.iter().map(place).fold(DVec2::MIN, DVec2::max) - low).max(DVec2::splat(f64::MIN_POSITIVE));
    let mut cells = vec![Vec::new(); (side * side) as usize];
    for sample in samples {
        let at = ((place(sample) - low) / span * side).floor().min(DVec2::splat(side - 1.0));
        cells[(at.y * side + at.x) as usize].push(sample.btdf);
    }
    cells.retain(|cell| cell.len() > usize::from(per_cell > 1));
    cells
}

/// The upper median; `None` without a value.
fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

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

    /// A BTDF over a square of directions, with irradiance 1 but on one side, where dots are weak and their values wrong.
    fn samples(btdf: impl Fn(DVec2) -> f64) -> Vec<Sample> {
        let at = |k: usize| DVec2::new((k % 40) as f64, (k / 40) as f64) / 20.0 - 1.0;
        let sample = |k: usize| {
            let weak = k / 40 >= 20;
            let value = if weak { at(k).x } else { btdf(at(k)) };
            Sample { i: (0.7 * at(k)).extend(0.7), irradiance: if weak { 0.1 } else { 1.0 }, btdf: value }
        };
        (0..1600).map(sample).collect()
    }

    fn lobe(at: DVec2, width: f64) -> f64 {
        5.0 * (-(at / width).length_squared()).exp()
    }

    #[test]
    fn the_diffuse_part_is_the_floor_below_a_lobe_and_weak_dots_and_one_noisy_value_do_not_change_it() {
        let mut values = samples(|at| 0.02 + lobe(at + DVec2::new(0.0, 0.4), 0.2));
        assert!((diffuse_part(&[&values]) - 0.02).abs() < 1e-6);
        (values[39].btdf, values[1500].btdf) = (0.0, f64::NAN);
        assert!((diffuse_part(&[&values]) - 0.02).abs() < 1e-6);
        assert_eq!(diffuse_part(&[]), 0.0);
        assert_eq!(diffuse_part(&[&[Sample { i: DVec3::Z, irradiance: 0.0, btdf: 0.0 }; 4]]), 0.0);
        assert_eq!(diffuse_part(&[&[Sample { i: DVec3::Z, irradiance: 1.0, btdf: f64::NAN }]]), 0.0);
    }

    #[test]
    fn noise_does_not_make_the_diffuse_part_smaller() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let parts: Vec<f64> = (0..20)
            .map(|_| {
                let mut values = samples(|at| 0.02 + lobe(at + DVec2::new(0.0, 0.4), 0.2));
                values.iter_mut().for_each(|sample| sample.btdf += 0.004 * (rng.random::<f64>() - 0.5));
                diffuse_part(&[&values])
            })
            .collect();
        let mean = parts.iter().sum::<f64>() / 20.0;
        // The deviation of one value is 0.00115. The least 5 % of values have the median 0.0181.
        assert!((mean - 0.02).abs() < 4e-4, "{mean}");
        assert!(parts.iter().all(|part| (part - 0.02).abs() < 1e-3), "{parts:?}");
    }

    #[test]
    fn of_two_cameras_the_darker_one_decides() {
        let (dark, bright) = (samples(|_| 0.02), samples(|_| 0.5));
        assert_eq!(diffuse_part(&[&bright, &dark]), 0.02);
    }

    #[test]
    fn a_lobe_without_a_diffuse_part_has_none() {
        let values = samples(|at| lobe(at + DVec2::new(0.0, 0.4), 0.2));
        assert!(diffuse_part(&[&values]) < 1e-6);
    }
}
