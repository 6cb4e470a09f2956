//! MERL `.binary` files (Matusik et al. 2003), isotropic.
//!
//! Three int32 (90, 90, 180), then the R, G and B planes of f64, little-endian, index `φ_d + 180 (θ_d + 90 θ_h)`, the
//! samples at bin centres, `φ_d` over [0, π), `θ_h` index `90 √(θ_h/90°)`.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use glam::{Vec3, Vec4};

use super::half_difference::{MERL_SHAPE, bin_angles, row_bins};
use super::{HalfDifferenceTable, MeasuredReport};
use crate::base::{InputError, Result};

pub(crate) const BINS_H: usize = 90;
pub(crate) const BINS_D: usize = 90;
pub(crate) const BINS_PHI: usize = 180;
pub(crate) const PLANE: usize = BINS_H * BINS_D * BINS_PHI;
const HEADER_BYTES: usize = 12;
const FILE_BYTES: usize = HEADER_BYTES + 3 * 8 * PLANE;
/// From stored numbers to 1/sr.
pub(crate) const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// Reads a file whole (35 MB) and keeps a third of it.
pub(crate) fn load(path: &Path) -> Result<HalfDifferenceTable> {
    let unreadable = |error: std::io::Error| InputError::new("", error, "a MERL file that can be read").in_file(path);
    let file = File::open(path).map_err(unreadable)?;
    let len = file.metadata().map_err(unreadable)?.len();
    // A wrong header says more than a wrong size, so as much as there is is read up to the size of a real one.
    let mut bytes = Vec::with_capacity(len.min(FILE_BYTES as u64) as usize);
    file.take(FILE_BYTES as u64).read_to_end(&mut bytes).map_err(unreadable)?;
    check_header(&bytes, len).map_err(|error| error.in_file(path))?;
    let name = path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into_owned());
    Ok(table_from_planes(name, &bytes[HEADER_BYTES..]))
}

/// Dimensions and size; after it, the planes are whole.
fn check_header(bytes: &[u8], len: u64) -> std::result::Result<(), InputError> {
    let Some(header) = bytes.first_chunk::<HEADER_BYTES>() else {
        return Err(InputError::new("header", format!("{len} bytes"), format!("{FILE_BYTES} bytes (MERL .binary)")));
    };
    let dims = [0, 4, 8].map(|at| i32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]));
    if dims != [BINS_H as i32, BINS_D as i32, BINS_PHI as i32] {
        return Err(InputError::new("header", format!("dimensions {dims:?}"), "[90, 90, 180]")
            .with_hint("is this a MERL .binary file?"));
    }
    if len != FILE_BYTES as u64 || bytes.len() != FILE_BYTES {
        return Err(InputError::new(
            "file size",
            format!("{len} bytes"),
            format!("{FILE_BYTES} bytes (90 x 90 x 180 x 3 f64)"),
        )
        .with_hint(if len < FILE_BYTES as u64 {
            "the file is cut short"
        } else {
            "the file has bytes after its data"
        }));
    }
    Ok(())
}

/// The mean over the swap of light and view, and the mirror image: `φ_d` and `π - φ_d`, whichever are valid.
pub(crate) fn table_from_planes(name: String, planes: &[u8]) -> HalfDifferenceTable {
    let mut report = MeasuredReport { total: PLANE, ..MeasuredReport::default() };
    let mut samples = Vec::with_capacity(PLANE / 2);
    let (mut difference, mut power) = (0.0, 0.0);
    let weight = weights();
    for row in 0..BINS_H * BINS_D {
        let [h, d] = row_bins(MERL_SHAPE, row);
        let first = (h * BINS_D + d) * BINS_PHI;
        for phi in 0..BINS_PHI / 2 {
            let there = sample_at(planes, first + phi);
            let back = sample_at(planes, first + BINS_PHI - 1 - phi);
            report.invalid_samples += usize::from(there.is_none()) + usize::from(back.is_none());
            samples.push(match (there, back) {
                (Some(there), Some(back)) => {
                    let mean = 0.5 * (there + back);
                    let weight = weight(row, phi);
                    difference += weight * f64::from((there - back).length_squared());
                    power += weight * f64::from(mean.length_squared());
                    mean.extend(1.0)
                }
                (Some(one), None) | (None, Some(one)) => one.extend(1.0),
                (None, None) => Vec4::ZERO,
            });
        }
    }
    if power > 0.0 {
        report.reciprocity_residual = (difference / power).sqrt() as f32;
    }
    HalfDifferenceTable::new(name, MERL_SHAPE, samples, report)
}

/// Squared cosines times solid angle of every folded bin: residuals are those of `f`, not of `f_r`.
fn weights() -> impl Fn(usize, usize) -> f64 {
    // One bin per axis is enough: the cosines are products of the axes' own.
    let [h, d, phi]: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        (0..MERL_SHAPE[axis]).map(|bin| bin_angles(MERL_SHAPE, [bin as f64; 3])[axis]).collect()
    });
    // dω_h = sinθ_h dθ_h and dθ_h ∝ √θ_h on the stretched axis.
    let rows: Vec<[f64; 3]> = (0..BINS_H * BINS_D)
        .map(|row| {
            let [row_h, row_d] = row_bins(MERL_SHAPE, row);
            let (h, d) = (h[row_h], d[row_d]);
            [h.cos() * d.cos(), h.sin() * d.sin(), h.sin() * h.sqrt() * d.sin() * d.cos()]
        })
        .collect();
    let cos_phi: Vec<f64> = phi.into_iter().map(f64::cos).collect();
    move |row, phi| {
        let [common, sines, solid_angle] = rows[row];
        let apart = sines * cos_phi[phi];
        ((common - apart).max(0.0) * (common + apart)).powi(2) * solid_angle
    }
}

/// `None` where a channel is negative, NaN, infinite or beyond f32.
fn sample_at(planes: &[u8], index: usize) -> Option<Vec3> {
    let channel = |c: usize| {
        let at = 8 * (c * PLANE + index);
        let value = f64::from_le_bytes(*planes.get(at..)?.first_chunk()?) * SCALES[c];
        // A comparison that NaN fails.
        (value >= 0.0 && value <= f64::from(MAX)).then_some(value as f32)
    };
    Some(Vec3::new(channel(0)?, channel(1)?, channel(2)?))
}

/// No reflectance is above this [1/sr]; sums of eight such still fit an f32, squared too.
const MAX: f32 = 1e15;

#[cfg(test)]
#[path = "merl_tests.rs"]
mod tests;
