//! Reader of isotropic RGL `.bsdf` files (Dupuy and Jakob 2018, "An adaptive parameterization for efficient material
//! acquisition and rendering"). A file is evaluated by the published method and resampled into a
//! [`HalfDifferenceTable`].
//!
//! Let `u(θ, φ) = (√(2θ/π), (φ+π)/2π)`, and `s` the inverse of the warp by the visible normals (`vndf` for this `θ_i`)
//! at `u(h)`. Then `rgb(s) ndf(u(h)) / (4 sigma(u(i)))` is `f_r(i,o) cosθ_o`. Samples are on the vertices of each grid.

pub(crate) mod table;
pub(crate) mod tensor_file;
pub(crate) mod warp;

use std::f64::consts::PI;
use std::path::Path;

use glam::{DQuat, DVec3, Vec4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::LobeAngles;
use super::half_difference::{bin_angles, cosines, row_bins};
use super::{HalfDifferenceTable, Measured, MeasuredReport};
use crate::base::{InputError, Result};
use table::RglTable;
use tensor_file::TensorFile;

/// Smallest cosine that `f` is divided by to get `f_r`. Smaller cosines are not measured, and the quotient would spread
/// noise from the horizon to neighbouring bins.
const MIN_COSINE: f64 = 0.01;

/// Bins in `θ_h`, `θ_d`, `φ_d` of the table. The health reports the resampling error that they leave; `cargo test --lib
/// measured_files -- --ignored --nocapture` prints it for the files in `BISCALE_DATA`.
const SHAPE: [usize; 3] = [180, 90, 20];

/// Largest relative L2 difference between azimuths of a file that counts as isotropic; interpolation causes some.
const MAX_ANISOTROPY: f32 = 0.05;
/// Number of direction pairs that measure the difference between azimuths.
const CHECKED_ROTATIONS: usize = 500;

/// Number of direction pairs that measure the resampling error.
const CHECKED_PAIRS: usize = 10_000;

/// Reads, evaluates and resamples an isotropic file.
pub(crate) fn load(path: &Path) -> Result<HalfDifferenceTable> {
    let read = || {
        let table = RglTable::from_fields(&TensorFile::read(path)?)?;
        table.check_isotropic().map(|()| table)
    };
    let brdf = read().map_err(|error| error.in_file(path))?;
    let name = path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into_owned());
    Ok(brdf.resample(name))
}

impl RglTable {
    /// Checks that rotating the surface changes little. Files with one or two azimuths are isotropic by definition.
    ///
    /// # Errors
    /// Returns an error that states the change if it is larger than interpolation explains.
    fn check_isotropic(&self) -> std::result::Result<(), InputError> {
        if self.is_isotropic() {
            return Ok(());
        }
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut residual = Residual::default();
        for _ in 0..CHECKED_ROTATIONS {
            let mut direction = || from_square(rng.random(), rng.random());
            let (i, o) = (direction(), direction());
            let values: Vec<DVec3> = (0..8).map(|k| self.eval_rotated(i, o, f64::from(k) / 8.0)).collect();
            let mean = values.iter().sum::<DVec3>() / 8.0;
            values.iter().for_each(|value| residual.add(*value - mean, mean, 1.0));
        }
        let change = residual.relative();
        if change <= MAX_ANISOTROPY {
            return Ok(());
        }
        let found = format!("{} azimuths, over which values change by {:.0} %", self.phi_i.len(), 100.0 * change);
        Err(InputError::new("field \"phi_i\"", found, "an isotropic file (values that do not depend on the azimuth)")
            .with_hint("anisotropic BRDFs depend on a tangent direction, which facets do not have"))
    }

    /// Computes [`RglTable::eval`] of a pair that is rotated about the normal by a fraction of a full turn.
    fn eval_rotated(&self, i: DVec3, o: DVec3, fraction: f64) -> DVec3 {
        let rotation = DQuat::from_rotation_z(fraction * 2.0 * PI);
        self.eval(rotation * i, rotation * o)
    }

    /// Returns `f(i,o)` and `f(o,i)`, with both cosines. Each is the mean with its mirror image, and the mean over
    /// azimuths if the file has more than two.
    fn both_ways(&self, i: DVec3, o: DVec3) -> [DVec3; 2] {
        let mirrored = |v: DVec3| DVec3::new(v.x, -v.y, v.z);
        let rotations = if self.is_isotropic() { 1 } else { 4 };
        let all = |i: DVec3, o: DVec3| {
            (0..rotations).map(|k| self.eval_rotated(i, o, f64::from(k) / f64::from(rotations))).sum::<DVec3>()
                / f64::from(rotations)
        };
        let one_way = |i: DVec3, o: DVec3| 0.5 * i.z * (all(i, o) + all(mirrored(i), mirrored(o)));
        [one_way(i, o), one_way(o, i)]
    }

    /// Resamples the file into a reciprocal table and measures the table's error.
    fn resample(&self, name: String) -> HalfDifferenceTable {
        let [bins_h, bins_d, bins_phi] = SHAPE;
        let rows: Vec<(Vec<Vec4>, Residual)> = (0..bins_h * bins_d)
            .into_par_iter()
            .map(|row| {
                let [h, d] = row_bins(SHAPE, row);
                let mut residual = Residual::default();
                let samples = (0..bins_phi)
                    .map(|phi| {
                        let bin = [h as f64, d as f64, phi as f64];
                        let angles = bin_angles(SHAPE, bin);
                        let Some((i, o)) = directions(angles) else {
                            return Vec4::ZERO;
                        };
                        let [there, back] = self.both_ways(i, o);
                        // dω_h dω_d on the bins' non-uniform axes.
                        let [theta_h, theta_d, _] = angles;
                        residual.add(
                            there - back,
                            there,
                            theta_h.sin() * theta_h.sqrt() * theta_d.sin() * theta_d.cos(),
                        );
                        let f_r = 0.5 * (there + back) / (i.z.max(MIN_COSINE) * o.z.max(MIN_COSINE));
                        f_r.min(DVec3::splat(1e15)).as_vec3().extend(1.0)
                    })
                    .collect();
                (samples, residual)
            })
            .collect();
        let mut residual = Residual::default();
        rows.iter().for_each(|(_, row)| residual.merge(row));
        let (rgb_grid, rgb) = &self.rgb;
        let report = MeasuredReport {
            total: rgb.len() / 3,
            invalid_samples: invalid_triples(rgb, rgb_grid.len()),
            reciprocity_residual: residual.relative(),
            ..MeasuredReport::default()
        };
        let samples = rows.into_iter().flat_map(|(samples, _)| samples).collect();
        let table = HalfDifferenceTable::new(name, SHAPE, samples, report);
        let error = self.resampling_error(&table);
        table.with_resampling_error(error)
    }

    /// Relative L2 error of `f` at random pairs up to 85°, half of them near the mirror direction.
    fn resampling_error(&self, table: &HalfDifferenceTable) -> f32 {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut random = || from_square(rng.random(), rng.random());
        let mut residual = Residual::default();
        for pair in 0..CHECKED_PAIRS {
            let (i, other) = (random(), random());
            let mirror = DVec3::new(-i.x, -i.y, i.z) + 0.1 * DVec3::new(other.x, other.y, 0.0);
            let o = if pair % 2 == 0 { mirror.try_normalize().unwrap_or(DVec3::Z) } else { other };
            let [there, back] = self.both_ways(i, o);
            let exact = 0.5 * (there + back);
            let h = (i + o).try_normalize().unwrap_or(DVec3::Z);
            let angles = LobeAngles {
                n_dot_i: i.z as f32,
                n_dot_o: o.z as f32,
                n_dot_h: h.z as f32,
                sin2_theta_h: (h.x * h.x + h.y * h.y) as f32,
                i_dot_h: i.dot(h) as f32,
            };
            residual.add(table.f_r(&angles).as_dvec3() * (i.z * o.z) - exact, exact, 1.0);
        }
        residual.relative()
    }
}

/// A direction up to 85° from two numbers in [0, 1), uniform in solid angle.
fn from_square(a: f64, b: f64) -> DVec3 {
    let (z, phi) = (0.087 + (1.0 - 0.087) * a, b * 2.0 * PI);
    let s = (1.0 - z * z).sqrt();
    DVec3::new(s * phi.cos(), s * phi.sin(), z)
}

/// Light and view directions of half and difference angles, with `h` in the xz plane; `None` unless both are above the
/// surface.
fn directions(angles: [f64; 3]) -> Option<(DVec3, DVec3)> {
    let [theta_h, theta_d, phi_d] = angles;
    let (n_dot_i, n_dot_o) = cosines(angles);
    let h = DVec3::new(theta_h.sin(), 0.0, theta_h.cos());
    // In the frame of h, x points away from n along the meridian.
    let x = DVec3::new(theta_h.cos(), 0.0, -theta_h.sin());
    let across = theta_d.sin() * (phi_d.cos() * x + phi_d.sin() * DVec3::Y);
    let (i, o) = (theta_d.cos() * h + across, theta_d.cos() * h - across);
    (n_dot_i > 0.0 && n_dot_o > 0.0).then_some((i, o))
}

/// Accumulator of a weighted relative L2 difference.
#[derive(Default)]
struct Residual {
    difference: f64,
    power: f64,
}

impl Residual {
    fn add(&mut self, difference: DVec3, reference: DVec3, weight: f64) {
        self.difference += weight * difference.length_squared();
        self.power += weight * reference.length_squared();
    }

    fn merge(&mut self, other: &Self) {
        self.difference += other.difference;
        self.power += other.power;
    }

    fn relative(&self) -> f32 {
        if self.power > 0.0 { (self.difference / self.power).sqrt() as f32 } else { 0.0 }
    }
}

/// Number of stored triples with a negative channel.
fn invalid_triples(rgb: &[f64], plane: usize) -> usize {
    let slices = rgb.chunks_exact(3 * plane);
    slices.map(|slice| (0..plane).filter(|&k| (0..3).any(|c| slice[c * plane + k] < 0.0)).count()).sum()
}

#[cfg(test)]
#[path = "rgl_tests.rs"]
mod tests;
