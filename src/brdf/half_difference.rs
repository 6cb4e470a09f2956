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
#[path = "half_difference_tests.rs"]
mod tests;
