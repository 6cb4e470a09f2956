//! Reader of UTIA `.bin` files (Filip and Vávra 2014). They are anisotropic; the reader averages over azimuths.
//!
//! A file has no header. It stores the planes R, G, B of the BRDF in little-endian f64, each
//! `[theta_i][phi_i][theta_v][phi_v]`, with polar angles 0, 15 ... 75° and azimuths 0, 7.5 ... 352.5°.

use std::path::Path;

use glam::DVec3;

use super::HalfDifferenceTable;
use super::spherical::{MAX_F_R, SphericalTable};
use crate::base::{InputError, Result, regular_file};

const POLAR_ANGLES: usize = 6;
const STEP_DEG: f64 = 15.0;
const AZIMUTHS: usize = 48;
const PLANE: usize = POLAR_ANGLES * AZIMUTHS * POLAR_ANGLES * AZIMUTHS;
const FILE_BYTES: u64 = 3 * 8 * PLANE as u64;

pub(crate) fn load(path: &Path) -> Result<HalfDifferenceTable> {
    let input_error = |error: InputError| error.in_file(path);
    let unreadable = |error: std::io::Error| input_error(InputError::new("", error, "a UTIA file that can be read"));
    let length = regular_file::open(path).and_then(|file| file.metadata()).map_err(unreadable)?.len();
    if length != FILE_BYTES {
        let expected = format!("{FILE_BYTES} bytes (3 x 288 x 288 f64)");
        return Err(input_error(InputError::new("file size", format!("{length} bytes"), expected)).into());
    }
    let bytes = regular_file::read(path).map_err(unreadable)?;
    let numbers: Vec<f64> = bytes.as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect();
    if let Some(at) = numbers.iter().position(|value| !(-MAX_F_R..=MAX_F_R).contains(value)) {
        let expected = format!("a finite number no larger than {MAX_F_R:e}");
        return Err(input_error(InputError::new(format!("number {at}"), numbers[at], expected)).into());
    }
    let values = (0..PLANE).map(|k| DVec3::new(numbers[k], numbers[PLANE + k], numbers[2 * PLANE + k])).collect();
    let theta: Vec<f64> = (0..POLAR_ANGLES).map(|k| (k as f64 * STEP_DEG).to_radians()).collect();
    let table = SphericalTable { theta_i: theta.clone(), theta_o: theta, azimuths: AZIMUTHS, values };
    let name = path.file_stem().map_or_else(|| path.display().to_string(), |stem| stem.to_string_lossy().into_owned());
    Ok(table.resample(name))
}
