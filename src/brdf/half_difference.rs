//! Table of a measured BRDF over half and difference angles (Rusinkiewicz 1998), with the spacing of MERL.
//! All measured formats are converted to this table.
//!
//! With `h` the half vector and `d` the light's direction in `h`'s frame (`n` at azimuth π),
//! `n·i = cosθ_h cosθ_d - sinθ_h sinθ_d cosφ_d` and `n·o = cosθ_h cosθ_d + sinθ_h sinθ_d cosφ_d`. Swapping `i` and `o`
//! adds π to `φ_d`, and mirroring in the plane of `n` and `h` negates it. The table stores the mean of a BRDF over both
//! operations. It therefore depends on `|cosφ_d|` only, and `φ_d` covers [0, π/2].

use std::f32::consts::FRAC_2_PI;
use std::f64::consts::FRAC_PI_2;
use std::sync::OnceLock;

use glam::{Vec3, Vec4};

use super::albedo::max_albedo;
use super::fast_math::acos_over_sqrt_one_minus;
use super::{LobeAngles, Measured, MeasuredReport};
use crate::cache::Key;

/// Samples at bin centres: `θ_h` has index `N √(θ_h / 90°)`, and `θ_d` and `φ_d` are even over [0, π/2].
#[derive(Clone)]
pub struct HalfDifferenceTable {
    name: String,
    /// Bins in `θ_h`, `θ_d`, `φ_d`; i32 converts to f32 in one instruction.
    shape: [i32; 3],
    /// `[θ_d][θ_h][φ_d]`, `φ_d` fastest. The facets of one direction pair share `θ_d`, so their reads are close in
    /// memory. A valid sample is RGB [1/sr] and 1; an invalid one is 0.
    samples: Vec<Vec4>,
    report: MeasuredReport,
    /// Computed at the first request.
    content: OnceLock<Key>,
}

/// Bins in `θ_h`, `θ_d`, `φ_d` of a MERL file, with `φ_d` folded to [0, π/2].
pub(super) const MERL_SHAPE: [usize; 3] = [90, 90, 90];

/// Angles [rad] of a bin's centre. A fractional `bin` is a position between centres.
pub(super) fn bin_angles(shape: [usize; 3], bin: [f64; 3]) -> [f64; 3] {
    let at = |axis: usize| (bin[axis] + 0.5) / shape[axis] as f64;
    [at(0).powi(2) * FRAC_PI_2, at(1) * FRAC_PI_2, at(2) * FRAC_PI_2]
}

/// Bins in `θ_h` and `θ_d` of a row of `φ_d`.
pub(super) fn row_bins(shape: [usize; 3], row: usize) -> [usize; 2] {
    [row % shape[0], row / shape[0]]
}

/// The cosines `n·i` and `n·o` of half and difference angles.
pub(super) fn cosines([theta_h, theta_d, phi_d]: [f64; 3]) -> (f64, f64) {
    let common = theta_h.cos() * theta_d.cos();
    let apart = theta_h.sin() * theta_d.sin() * phi_d.cos();
    (common - apart, common + apart)
}

impl HalfDifferenceTable {
    /// Creates a table of `samples`: rows of `φ_d` in the order of [`row_bins`]. The fourth component of a valid sample
    /// is 1; an invalid sample is 0. Each axis has at least two bins.
    pub(super) fn new(name: String, shape: [usize; 3], samples: Vec<Vec4>, report: MeasuredReport) -> Self {
        debug_assert!(shape.iter().all(|&n| n >= 2) && samples.len() == shape.iter().product::<usize>());
        let mut table = Self { name, shape: shape.map(|n| n as i32), samples, report, content: OnceLock::new() };
        table.report.max_albedo = max_albedo(|angles| table.f_r(angles) * (angles.n_dot_i * angles.n_dot_o));
        table
    }

    /// Sets the error of the table against the file that it was resampled from.
    pub(super) fn with_resampling_error(mut self, error: f32) -> Self {
        self.report.resampling_error = error;
        self
    }

    /// Linear interpolation along an axis at `unit` (0 to 1): index of the lower bin and weight of the upper one. The
    /// table is constant beyond the outer centres.
    #[inline]
    fn tap(unit: f32, bins: i32) -> (i32, f32) {
        let position = (unit * bins as f32 - 0.5).max(0.0).min((bins - 1) as f32);
        let lower = (position as i32).min(bins - 2);
        (lower, position - lower as f32)
    }

    /// Finds the cell of any angles, with arithmetic only and no branch.
    #[inline]
    fn locate(&self, angles: &LobeAngles) -> Cell {
        let [bins_h, bins_d, bins_phi] = self.shape;
        let cos_h = angles.n_dot_h.clamp(0.0, 1.0);
        let sin2_h = angles.sin2_theta_h.clamp(0.0, 1.0);
        let cos_d = angles.i_dot_h.clamp(0.0, 1.0);
        let sin2_d = 1.0 - cos_d * cos_d;
        // If either sine is 0, every azimuth gives the same direction.
        let double_sines = 2.0 * (sin2_h * sin2_d).sqrt();
        let cosine_difference = (angles.n_dot_o - angles.n_dot_i).abs();
        let cos_phi = (cosine_difference / double_sines.max(f32::MIN_POSITIVE)).min(1.0);
        // acos of each over π/2; 1 - cosθ_h = sin²/(1 + cos) is exact at the pole.
        let unit = |one_minus: f32, cos: f32| one_minus.sqrt() * acos_over_sqrt_one_minus(cos) * FRAC_2_PI;
        let (h, t_h) = Self::tap(unit(sin2_h / (1.0 + cos_h), cos_h).sqrt(), bins_h);
        let (d, t_d) = Self::tap(unit(1.0 - cos_d, cos_d), bins_d);
        let (p, t_p) = Self::tap(unit(1.0 - cos_phi, cos_phi), bins_phi);
        Cell { first: (d * bins_h + h) * bins_phi + p, t: [t_h, t_d, t_p] }
    }

    /// Interpolates the valid corners of a cell, with renormalized weights.
    #[inline]
    fn interpolate(&self, Cell { first, t: [t_h, t_d, t_p] }: Cell) -> Vec3 {
        let [bins_h, _, bins_phi] = self.shape;
        let (first, to_next_h, to_next_d) = (first as usize, bins_phi as usize, (bins_h * bins_phi) as usize);
        let along_phi = |at: usize| self.samples[at] * (1.0 - t_p) + self.samples[at + 1] * t_p;
        let along_h = |at: usize| along_phi(at) * (1.0 - t_h) + along_phi(at + to_next_h) * t_h;
        let sum = along_h(first) * (1.0 - t_d) + along_h(first + to_next_d) * t_d;
        if sum.w > 0.0 { sum.truncate() / sum.w } else { Vec3::ZERO }
    }
}

/// A cell of the table: the index of its first corner, and the weights of the upper corners along `θ_h`, `θ_d`, `φ_d`.
#[derive(Clone, Copy, Default)]
struct Cell {
    first: i32,
    t: [f32; 3],
}

impl Measured for HalfDifferenceTable {
    fn f_r(&self, angles: &LobeAngles) -> Vec3 {
        if angles.above() { self.interpolate(self.locate(angles)) } else { Vec3::ZERO }
    }

    /// Locates the cells of a block and then reads them, so that the arithmetic vectorises and reads overlap.
    fn f_r_many(&self, angles: &[LobeAngles], out: &mut [Vec3]) {
        const BLOCK: usize = 32;
        let mut cells = [Cell::default(); BLOCK];
        for (angles, out) in angles.chunks(BLOCK).zip(out.chunks_mut(BLOCK)) {
            for (cell, angles) in cells.iter_mut().zip(angles) {
                *cell = self.locate(angles);
            }
            for ((out, &cell), angles) in out.iter_mut().zip(&cells).zip(angles) {
                // A factor instead of a branch, because a misprediction would discard pending reads.
                *out = self.interpolate(cell) * f32::from(u8::from(angles.above()));
            }
        }
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn content(&self) -> Key {
        *self.content.get_or_init(|| {
            let samples = Key::of_numbers(&self.samples);
            Key::of_numbers(&[bytemuck::cast_slice(&self.shape), &samples.bytes()[..]].concat())
        })
    }

    fn report(&self) -> &MeasuredReport {
        &self.report
    }
}

impl std::fmt::Debug for HalfDifferenceTable {
    /// Omits the samples.
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("HalfDifferenceTable")
            .field("name", &self.name)
            .field("shape", &self.shape)
            .field("report", &self.report)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::math::directions::{from_angles, half_vector};

    /// A small table of random values, of which a few percent are invalid.
    fn random_table(rng: &mut ChaCha8Rng) -> HalfDifferenceTable {
        let shape = [7, 6, 5];
        let samples = (0..shape.iter().product::<usize>())
            .map(|_| {
                if rng.random_bool(0.05) {
                    Vec4::ZERO
                } else {
                    Vec4::new(rng.random(), rng.random(), rng.random::<f32>() * 100.0, 1.0)
                }
            })
            .collect();
        HalfDifferenceTable::new("random".to_owned(), shape, samples, MeasuredReport::default())
    }

    /// Half and difference angles in f64, by rotating the light direction; `φ_d` in (-π, π].
    fn rotated_angles(i: Vec3, o: Vec3) -> [f64; 3] {
        let (i, o) = (i.as_dvec3(), o.as_dvec3());
        let h = (i + o) / (i + o).length();
        let (theta_h, phi_h) = (h.x.hypot(h.y).atan2(h.z), h.y.atan2(h.x));
        let rotated = glam::DQuat::from_rotation_y(-theta_h) * (glam::DQuat::from_rotation_z(-phi_h) * i);
        [theta_h, rotated.x.hypot(rotated.y).atan2(rotated.z), rotated.y.atan2(rotated.x)]
    }

    #[test]
    fn lookup_equals_trilinear_interpolation_over_valid_neighbours_from_rotated_angles() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let table = random_table(&mut rng);
        let [bins_h, bins_d, bins_phi] = table.shape.map(i64::from);
        for _ in 0..20_000 {
            let i = from_angles(rng.random_range(0.0..1.5), rng.random_range(0.0..TAU));
            let o = from_angles(rng.random_range(0.0..1.5), rng.random_range(0.0..TAU));
            let [theta_h, theta_d, phi_d] = rotated_angles(i, o);
            // Fold the swap of i and o (+π) and the mirror image (negation).
            let folded = phi_d.abs().min(std::f64::consts::PI - phi_d.abs());
            let x = bins_h as f64 * (theta_h / FRAC_PI_2).sqrt() - 0.5;
            let y = bins_d as f64 * theta_d / FRAC_PI_2 - 0.5;
            let z = bins_phi as f64 * folded / FRAC_PI_2 - 0.5;
            let (mut sum, mut weights) = (glam::DVec3::ZERO, 0.0);
            for corner in 0..8_i64 {
                let bins = [x, y, z].map(f64::floor);
                let upper = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
                let weight: f64 = (0..3)
                    .map(|k| {
                        let t = [x, y, z][k] - bins[k];
                        if upper[k] == 1 { t } else { 1.0 - t }
                    })
                    .product();
                let at = |k: usize, n: i64| (bins[k] as i64 + upper[k]).clamp(0, n - 1);
                let sample =
                    table.samples[((at(1, bins_d) * bins_h + at(0, bins_h)) * bins_phi + at(2, bins_phi)) as usize];
                if sample.w > 0.0 {
                    sum += weight * sample.truncate().as_dvec3();
                    weights += weight;
                }
            }
            if weights < 1e-3 || theta_d < 0.05 || theta_h < 0.01 {
                continue;
            }
            let expected = sum / weights;
            let found = table.f_r(&LobeAngles::new(Vec3::Z, i, o, half_vector(i, o))).as_dvec3();
            assert!(
                (found - expected).abs().max_element() < 2e-3 * expected.max_element(),
                "{i} {o}: {found} {expected}"
            );
        }
    }

    #[test]
    fn cosines_agree_with_vectors() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..1000 {
            let i = from_angles(rng.random_range(0.0..1.5), rng.random_range(0.0..TAU));
            let o = from_angles(rng.random_range(0.0..1.5), rng.random_range(0.0..TAU));
            let (n_dot_i, n_dot_o) = cosines(rotated_angles(i, o));
            assert!((n_dot_i - f64::from(i.z)).abs() < 1e-6 && (n_dot_o - f64::from(o.z)).abs() < 1e-6);
        }
    }

    #[test]
    fn lookups_are_reciprocal_to_the_bit_and_bounded_at_degenerate_angles() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let table = random_table(&mut rng);
        let edge = [f32::MIN_POSITIVE, 1e-20, 1e-7, 1e-3, 0.5, 0.999_999_9, 1.0, 1.000_000_2];
        for n_dot_i in edge {
            for n_dot_o in edge {
                for n_dot_h in edge {
                    for sin2_theta_h in edge.iter().copied().chain([0.0]) {
                        for i_dot_h in edge.iter().copied().chain([0.0, -1e-7]) {
                            let there = LobeAngles { n_dot_i, n_dot_o, n_dot_h, sin2_theta_h, i_dot_h };
                            let back = LobeAngles { n_dot_i: n_dot_o, n_dot_o: n_dot_i, ..there };
                            let value = table.f_r(&there);
                            assert_eq!(value, table.f_r(&back));
                            assert!(value.min_element() >= 0.0 && value.max_element() <= 100.1, "{there:?}: {value}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn many_lookups_are_the_same_bits_as_one_at_a_time() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let table = random_table(&mut rng);
        let angles: Vec<LobeAngles> = (0..1001)
            .map(|_| {
                let i = from_angles(rng.random_range(0.0..1.7), rng.random_range(0.0..TAU));
                let o = from_angles(rng.random_range(0.0..1.7), rng.random_range(0.0..TAU));
                LobeAngles::new(Vec3::Z, i, o, half_vector(i, o))
            })
            .collect();
        let mut many = vec![Vec3::NAN; angles.len()];
        table.f_r_many(&angles, &mut many);
        for (angles, found) in angles.iter().zip(many) {
            assert_eq!(found, table.f_r(angles));
        }
    }

    #[test]
    fn content_depends_on_shape_and_samples_and_not_on_the_name() {
        let samples = vec![Vec4::splat(0.5); 24];
        let table = |name: &str, shape, samples: &[Vec4]| {
            HalfDifferenceTable::new(name.to_owned(), shape, samples.to_vec(), MeasuredReport::default()).content()
        };
        let content = table("a", [2, 3, 4], &samples);
        assert_eq!(content, table("b", [2, 3, 4], &samples));
        assert_ne!(content, table("a", [4, 3, 2], &samples));
        let mut others = samples.clone();
        others[17].y += 1e-6;
        assert_ne!(content, table("a", [2, 3, 4], &others));
    }

    #[test]
    fn no_valid_neighbour_gives_zero() {
        let table =
            HalfDifferenceTable::new("none".to_owned(), [2, 2, 2], vec![Vec4::ZERO; 8], MeasuredReport::default());
        let angles = LobeAngles::new(Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Z);
        assert_eq!(table.f_r(&angles), Vec3::ZERO);
    }
}
