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

/// Part of the half cells of directions that count as dark.
const LOWEST: f64 = 0.05;
/// Dots per cell, and the number of cells below which cells hold fewer, but at least two.
const PER_CELL: usize = 8;
const LEAST_CELLS: usize = 20;

/// Eq. 14: the diffuse part of the BTDF, from the samples of each camera. Values that are not a number are ignored; 0 without any.
///
/// The paper takes the least of all values whose radiance exceeds 0.05 of the mean, against noise. A sheet without a diffuse
/// part has no dark value there, and the least of noisy values is too small. Here, the dots of at least the median
/// irradiance count, whose values have the least noise, and the median of [dark](dark_samples) values is taken.
pub fn diffuse_part(views: &[&[Sample]]) -> f64 {
    diffuse_of(&dark_samples(views), |view, k| views[view][k].btdf)
}

/// The diffuse part of one channel from the values of dark samples, given by camera and number.
pub(super) fn diffuse_of(dark: &[(usize, usize)], btdf: impl Fn(usize, usize) -> f64) -> f64 {
    median(dark.iter().map(|(view, k)| btdf(*view, *k)).collect()).map_or(0.0, |value| value.max(0.0))
}

/// The samples in the darkest cells of directions, by camera and number. One half of a cell decides whether the other half counts,
/// so that noise does not select small values.
pub(super) fn dark_samples(views: &[&[Sample]]) -> Vec<(usize, usize)> {
    let finite =
        |samples: &&[Sample]| -> Vec<usize> { (0..samples.len()).filter(|k| samples[*k].btdf.is_finite()).collect() };
    let finite: Vec<Vec<usize>> = views.iter().map(finite).collect();
    let irradiances = finite.iter().zip(views).flat_map(|(all, samples)| all.iter().map(|k| samples[*k].irradiance));
    let Some(strong) = median(irradiances.collect()) else { return Vec::new() };
    let mut halves = Vec::new();
    for (view, (mut all, samples)) in finite.into_iter().zip(views).enumerate() {
        all.retain(|k| samples[*k].irradiance >= strong);
        for cell in cells(samples, all) {
            let half = |first: usize| cell.iter().skip(first).step_by(2).copied().collect::<Vec<usize>>();
            let (even, odd) = (half(0), if cell.len() > 1 { half(1) } else { half(0) });
            let darkness = |half: &[usize]| median(half.iter().map(|k| samples[*k].btdf).collect());
            let keys = (darkness(&even), darkness(&odd));
            halves.extend(keys.0.map(|key| (key, view, odd)));
            halves.extend(keys.1.map(|key| (key, view, even)));
        }
    }
    halves.sort_by(|a, b| a.0.total_cmp(&b.0));
    let count = ((LOWEST * halves.len() as f64) as usize).max(2);
    let half = |(_, view, half): (f64, usize, Vec<usize>)| half.into_iter().map(move |k| (view, k));
    halves.into_iter().take(count).flat_map(half).collect()
}

/// Some of the samples by even cells of directions (i.x, i.y). Cells of one sample are left out unless all samples are few.
fn cells(samples: &[Sample], chosen: Vec<usize>) -> Vec<Vec<usize>> {
    let least = if chosen.len() < 2 * PER_CELL { 1 } else { 2 };
    let per_cell = (chosen.len() / LEAST_CELLS).clamp(least, PER_CELL);
    let side = ((chosen.len() / per_cell) as f64).sqrt().floor().max(1.0);
    let place = |k: &usize| samples[*k].i.truncate();
    let low = chosen.iter().map(place).fold(DVec2::MAX, DVec2::min);
    let span = (chosen.iter().map(place).fold(DVec2::MIN, DVec2::max) - low).max(DVec2::splat(f64::MIN_POSITIVE));
    let mut cells = vec![Vec::new(); (side * side) as usize];
    for k in chosen {
        let at = ((place(&k) - low) / span * side).floor().min(DVec2::splat(side - 1.0));
        cells[(at.y * side + at.x) as usize].push(k);
    }
    cells.retain(|cell| cell.len() > usize::from(per_cell > 1));
    cells
}

/// The median; `None` without a value.
fn median(mut values: Vec<f64>) -> Option<f64> {
    let (middle, is_even) = (values.len() / 2, values.len().is_multiple_of(2));
    if values.is_empty() {
        return None;
    }
    let (below, upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let lower = below.iter().copied().fold(f64::MIN, f64::max);
    Some(if is_even { 0.5 * (lower + *upper) } else { *upper })
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
            let weak = k / 40 >= 21;
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
        values[39].btdf = 0.0;
        assert!((diffuse_part(&[&values]) - 0.02).abs() < 1e-6);
        values[..40].iter_mut().step_by(3).for_each(|sample| sample.btdf = f64::NAN);
        assert!((diffuse_part(&[&values]) - 0.02).abs() < 1e-6);
        assert_eq!(diffuse_part(&[]), 0.0);
        assert_eq!(diffuse_part(&[&[Sample { i: DVec3::Z, irradiance: 0.0, btdf: 0.0 }; 4]]), 0.0);
        assert_eq!(diffuse_part(&[&[Sample { i: DVec3::Z, irradiance: 1.0, btdf: f64::NAN }]]), 0.0);
    }

    #[test]
    fn one_dark_value_of_few_dots_does_not_decide() {
        let mut values: Vec<Sample> = samples(|_| 0.02).into_iter().step_by(25).collect();
        assert_eq!(values.len(), 64);
        values[3].btdf = 0.0;
        assert!((diffuse_part(&[&values]) - 0.02).abs() < 1e-6, "{}", diffuse_part(&[&values]));
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
