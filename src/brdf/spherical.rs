//! Tables over `(theta_i, phi_i, theta_o, phi_o)` from UTIA and `.npz` files, and their conversion to isotropic tables.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec3, Vec4};

use super::half_difference::{bin_angles, cosines, row_bins};
use super::{HalfDifferenceTable, MeasuredReport};

/// Largest valid value [1/sr]: sums and squares of such values fit an f32.
pub(super) const MAX_F_R: f64 = 1e15;

/// Bins in `θ_h`, `θ_d`, `φ_d` of the converted table; the files are coarser than these bins.
const SHAPE: [usize; 3] = [90, 45, 30];
/// Largest polar angle [rad] at which `f_r` is interpolated; larger angles take the value at this one.
const HORIZON: f64 = 89.9 / 90.0 * FRAC_PI_2;

/// A table of `f_r` [1/sr]. Azimuths are even from 0 over a full turn, and light and view have the same number of them.
pub(super) struct SphericalTable {
    pub theta_i: Vec<f64>,
    pub theta_o: Vec<f64>,
    pub azimuths: usize,
    /// `[theta_i][phi_i][theta_o][phi_o]`.
    pub values: Vec<DVec3>,
}

/// Mean of a table over azimuths: `[theta_i][theta_o][phi_o - phi_i]`.
struct Mean<'a> {
    table: &'a SphericalTable,
    values: Vec<DVec3>,
}

impl SphericalTable {
    fn at(&self, ti: usize, pi: usize, to: usize, po: usize) -> DVec3 {
        self.values[((ti * self.azimuths + pi) * self.theta_o.len() + to) * self.azimuths + po]
    }

    fn mean(&self) -> Mean<'_> {
        let n = self.azimuths;
        let mut values = Vec::with_capacity(self.theta_i.len() * self.theta_o.len() * n);
        for ti in 0..self.theta_i.len() {
            for to in 0..self.theta_o.len() {
                for difference in 0..n {
                    let sum: DVec3 = (0..n).map(|pi| self.at(ti, pi, to, (pi + difference) % n)).sum();
                    values.push(sum / n as f64);
                }
            }
        }
        Mean { table: self, values }
    }

    /// Relative L2 difference between azimuths of `f_r` times both cosines.
    pub(super) fn anisotropy(&self) -> f64 {
        let mean = self.mean();
        let (mut changed, mut power) = (0.0, 0.0);
        for (ti, theta_i) in self.theta_i.iter().enumerate() {
            for (to, theta_o) in self.theta_o.iter().enumerate() {
                // Squared cosines times both solid angles; the offset gives a ring at the pole a small weight.
                let weight = (theta_i.cos() * theta_o.cos()).powi(2) * (theta_i.sin() + 0.05) * (theta_o.sin() + 0.05);
                for pi in 0..self.azimuths {
                    for po in 0..self.azimuths {
                        let difference = (po + self.azimuths - pi) % self.azimuths;
                        let expected = mean.values[(ti * self.theta_o.len() + to) * self.azimuths + difference];
                        changed += weight * (self.at(ti, pi, to, po) - expected).length_squared();
                        power += weight * expected.length_squared();
                    }
                }
            }
        }
        if power > 0.0 { (changed / power).sqrt() } else { 0.0 }
    }

    /// Converts the table: the mean over azimuths, over the swap of light and viewer, and over mirror images.
    pub(super) fn resample(&self, name: String) -> HalfDifferenceTable {
        let mean = self.mean();
        let (mut difference, mut power) = (0.0, 0.0);
        let samples = (0..SHAPE[0] * SHAPE[1])
            .flat_map(|row| (0..SHAPE[2]).map(move |phi| (row, phi)))
            .map(|(row, phi)| {
                let [h, d] = row_bins(SHAPE, row);
                let [theta_h, theta_d, phi_d] = bin_angles(SHAPE, [h as f64, d as f64, phi as f64]);
                let (n_dot_i, n_dot_o) = cosines([theta_h, theta_d, phi_d]);
                if n_dot_i <= 0.0 || n_dot_o <= 0.0 {
                    return Vec4::ZERO;
                }
                let (theta_i, theta_o) = (n_dot_i.min(1.0).acos(), n_dot_o.min(1.0).acos());
                // The azimuth between the directions follows from the angle between them.
                let between = 2.0 * theta_d;
                let sines = theta_i.sin() * theta_o.sin();
                let azimuth = if sines > 1e-9 {
                    ((between.cos() - n_dot_i * n_dot_o) / sines).clamp(-1.0, 1.0).acos()
                } else {
                    0.0
                };
                let there = 0.5 * (mean.at(theta_i, theta_o, azimuth) + mean.at(theta_i, theta_o, TAU - azimuth));
                let back = 0.5 * (mean.at(theta_o, theta_i, azimuth) + mean.at(theta_o, theta_i, TAU - azimuth));
                let weight = (n_dot_i * n_dot_o).powi(2);
                difference += weight * (there - back).length_squared();
                power += weight * there.length_squared();
                (0.5 * (there + back)).clamp(DVec3::ZERO, DVec3::splat(MAX_F_R)).as_vec3().extend(1.0)
            })
            .collect();
        let report = MeasuredReport {
            total: self.values.len(),
            reciprocity_residual: if power > 0.0 { (difference / power).sqrt() as f32 } else { 0.0 },
            invalid_samples: self.values.iter().filter(|value| value.min_element() < 0.0).count(),
            ..MeasuredReport::default()
        };
        HalfDifferenceTable::new(name, SHAPE, samples, report)
    }
}

impl Mean<'_> {
    /// Interpolates linearly in polar angles, constant beyond the outer ones, and linearly and periodically in azimuth.
    fn at(&self, theta_i: f64, theta_o: f64, azimuth: f64) -> DVec3 {
        let (i, o) =
            (split(&self.table.theta_i, theta_i.min(HORIZON)), split(&self.table.theta_o, theta_o.min(HORIZON)));
        let n = self.table.azimuths;
        let along = azimuth.rem_euclid(TAU) / TAU * n as f64;
        let (first, part) = (along.floor() as usize % n, along - along.floor());
        let value = |ti: usize, to: usize| {
            let row = (ti * self.table.theta_o.len() + to) * n;
            self.values[row + first].lerp(self.values[row + (first + 1) % n], part)
        };
        let along_o = |ti: usize| value(ti, o.0).lerp(value(ti, o.1), o.2);
        along_o(i.0).lerp(along_o(i.1), i.2)
    }
}

/// Indices of the two samples around a value in increasing `values`, and the weight of the upper sample.
fn split(values: &[f64], at: f64) -> (usize, usize, f64) {
    let upper = values.partition_point(|&value| value <= at);
    match upper {
        0 => (0, 0, 0.0),
        _ if upper == values.len() => (upper - 1, upper - 1, 0.0),
        _ => (upper - 1, upper, (at - values[upper - 1]) / (values[upper] - values[upper - 1])),
    }
}

/// Returns true if `angles` are even steps from 0 over a full turn.
pub(super) fn even_turn(angles: &[f64]) -> bool {
    let step = TAU / angles.len().max(1) as f64;
    angles.iter().enumerate().all(|(k, angle)| (angle - k as f64 * step).abs() < 1e-4 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{LobeAngles, Measured};
    use crate::math::directions::{from_angles, half_vector};

    fn table(of: impl Fn(f64, f64, f64, f64) -> f64) -> SphericalTable {
        let theta: Vec<f64> = (0..7).map(|k| (f64::from(k) * 12.5).to_radians()).collect();
        let azimuths = 24;
        let phi = |k: usize| k as f64 / azimuths as f64 * TAU;
        let mut values = Vec::new();
        for &ti in &theta {
            for pi in 0..azimuths {
                for &to in &theta {
                    values.extend((0..azimuths).map(|po| DVec3::new(1.0, 0.5, 0.0) * of(ti, phi(pi), to, phi(po))));
                }
            }
        }
        SphericalTable { theta_i: theta.clone(), theta_o: theta, azimuths, values }
    }

    #[test]
    fn an_isotropic_reciprocal_table_is_preserved_and_anisotropy_is_measured() {
        let isotropic = table(|ti, pi, to, po| 1.0 + 0.3 * ti.sin() * to.sin() * (pi - po).cos());
        assert!(isotropic.anisotropy() < 1e-9);
        let found = isotropic.resample("test".to_owned());
        for (ti, to, azimuth) in [(0.2_f32, 0.6_f32, 0.4_f32), (1.0, 0.3, 2.0), (0.7, 0.7, 3.0)] {
            let (i, o) = (from_angles(ti, 0.0), from_angles(to, azimuth));
            let value = found.f_r(&LobeAngles::new(glam::Vec3::Z, i, o, half_vector(i, o)));
            let expected = 1.0 + 0.3 * ti.sin() * to.sin() * azimuth.cos();
            assert!(
                (value.x / expected - 1.0).abs() < 0.02 && (value.y * 2.0 - value.x).abs() < 1e-5,
                "{value} {expected}"
            );
        }
        let brushed = table(|_, pi, _, po| 1.0 + 0.5 * (2.0 * pi).cos() * (2.0 * po).cos());
        assert!(brushed.anisotropy() > 0.1, "{}", brushed.anisotropy());
    }
}
