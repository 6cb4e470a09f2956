//! UTIA `.bin` (Filip and Vávra 2014): anisotropic, with steps of 15° in polar angle and 7.5° in azimuth.

use std::io::{self, Write};

use glam::Vec3;

use super::grid::{Axes, ExportGrid};
use super::sampler::reading_error;
use super::table::ExportTable;
use super::{ExportTask, Written};

/// Number of polar angles: 0, 15 ... 75°.
const THETAS: usize = 6;
const STEP_DEG: f32 = 15.0;
/// Number of azimuths: 0, 7.5 ... 352.5°.
const AZIMUTHS: usize = 48;

/// Writes f64 planes of R, G and B, each as `[theta_i][phi_i][theta_o][phi_o]`.
pub fn write(task: &ExportTask<'_>, out: &mut dyn Write) -> io::Result<Written> {
    let axes = Axes::at((0..THETAS).map(|k| (k as f32 * STEP_DEG).to_radians()).collect(), AZIMUTHS);
    let table = ExportTable::new(task.brdf, ExportGrid { light: axes.clone(), view: axes }, task.progress)?;
    for channel in 0..3 {
        let plane: Vec<u8> = table.brdf.iter().flat_map(|value| f64::from(value[channel]).to_le_bytes()).collect();
        out.write_all(&plane)?;
    }
    let reading = reading_error(task.brdf, |i: Vec3, o: Vec3| table.f_bar(i, o));
    let conventions = [
        "UTIA .bin: planes of R, G, B in f64, little-endian, no header; in each [theta_i][phi_i][theta_v][phi_v], 6 x 48 x 6 x 48.",
        "theta 0, 15 ... 75 degrees, phi 0, 7.5 ... 352.5 degrees from +x towards +y; nothing is known beyond 75 degrees.",
        "Values are the BRDF in 1/sr, no cosine, unscaled.",
        "The steps are coarse: lobes narrower than 15 degrees are lost between them.",
    ];
    let conventions = conventions.map(str::to_owned).to_vec();
    Ok(Written { pairs: table.grid.pairs(), reading, conventions, anisotropy_lost: None })
}
