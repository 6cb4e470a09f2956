//! Reader of MERL `.binary` files (Matusik et al. 2003), which are isotropic.
//!
//! A file has three int32 (90, 90, 180), then the R, G and B planes in little-endian f64. The index in a plane is
//! `φ_d + 180 (θ_d + 90 θ_h)`. Samples are at bin centres, `φ_d` covers [0, π), and `θ_h` has index `90 √(θ_h/90°)`.

use std::io::Read;
use std::path::Path;

use glam::{Vec3, Vec4};

use super::half_difference::{MERL_SHAPE, bin_angles, row_bins};
use super::{HalfDifferenceTable, MeasuredReport};
use crate::base::{InputError, Result, regular_file};

pub(crate) const BINS_H: usize = 90;
pub(crate) const BINS_D: usize = 90;
pub(crate) const BINS_PHI: usize = 180;
pub(crate) const PLANE: usize = BINS_H * BINS_D * BINS_PHI;
const HEADER_BYTES: usize = 12;
const FILE_BYTES: usize = HEADER_BYTES + 3 * 8 * PLANE;
/// Factors from stored numbers to 1/sr, per channel.
pub(crate) const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// Reads a file (35 MB) and converts it to a table.
pub(crate) fn load(path: &Path) -> Result<HalfDifferenceTable> {
    let unreadable = |error: std::io::Error| InputError::new("", error, "a MERL file that can be read").in_file(path);
    let file = regular_file::open(path).map_err(unreadable)?;
    let len = file.metadata().map_err(unreadable)?.len();
    // A file of the wrong size is read as well, because an error about its header is more helpful than one about its
    // size.
    let mut bytes = Vec::with_capacity(len.min(FILE_BYTES as u64) as usize);
    file.take(FILE_BYTES as u64).read_to_end(&mut bytes).map_err(unreadable)?;
    check_header(&bytes, len).map_err(|error| error.in_file(path))?;
    let name = path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into_owned());
    Ok(table_from_planes(name, &bytes[HEADER_BYTES..]))
}

/// Checks dimensions and size. After this check, the planes are complete.
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
            "the file is truncated"
        } else {
            "the file has bytes after its data"
        }));
    }
    Ok(())
}

/// Converts the planes to a table. A sample is the mean of the valid ones at `φ_d` and `π - φ_d`, which averages over
/// the swap of light and view and over mirror images.
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

/// Squared cosines times solid angle of every folded bin, so that residuals are those of `f`, not of `f_r`.
fn weights() -> impl Fn(usize, usize) -> f64 {
    // The cosines are sums of products of one factor per axis.
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

/// The sample at an index; `None` if a channel is negative, NaN, infinite or above [`MAX_F_R`].
fn sample_at(planes: &[u8], index: usize) -> Option<Vec3> {
    let channel = |c: usize| {
        let at = 8 * (c * PLANE + index);
        let value = f64::from_le_bytes(*planes.get(at..)?.first_chunk()?) * SCALES[c];
        // The comparison is false for NaN.
        (value >= 0.0 && value <= f64::from(MAX_F_R)).then_some(value as f32)
    };
    Some(Vec3::new(channel(0)?, channel(1)?, channel(2)?))
}

/// Largest valid value [1/sr]: the square of a sum of eight such values fits an f32.
const MAX_F_R: f32 = 1e15;

#[cfg(test)]
#[path = "merl_tests.rs"]
mod tests;
