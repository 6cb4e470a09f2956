//! ASTM E1392 text (`.astm`) as in the Cornell measurements and in libbsdf: keywords, then one row per pair.

use std::io::{self, Write};

use super::table::ExportTable;
use super::{ExportResolution, ExportTask, Written};

/// The default of 8 x 24 directions each: 37 thousand rows.
const DEFAULT_RESOLUTION: ExportResolution = ExportResolution { theta_i: 8, phi_i: 24, theta_o: 8, phi_o: 24 };

pub fn write(task: &ExportTask<'_>, out: &mut dyn Write) -> io::Result<Written> {
    let grid = task.options.resolution.unwrap_or(DEFAULT_RESOLUTION).grid();
    let table = ExportTable::new(task.brdf, grid, task.progress)?;
    let summary = task.summary().replace(['\n', '\r'], " ");
    writeln!(out, "TYPE BRDF")?;
    writeln!(out, "COMMENT {summary}")?;
    writeln!(out, "NUM_POINTS {}", table.grid.pairs())?;
    writeln!(out, "VARS theta_i,phi_i,theta_s,phi_s,R,G,B")?;
    for (entry, value) in table.brdf.iter().enumerate() {
        let [theta_i, phi_i, theta_o, phi_o] = table.grid.angles(entry);
        writeln!(out, "{theta_i:?},{phi_i:?},{theta_o:?},{phi_o:?},{:?},{:?},{:?}", value.x, value.y, value.z)?;
    }
    let conventions = [
        "ASTM E1392 text: keywords, `VARS theta_i,phi_i,theta_s,phi_s,R,G,B`, then a row a pair; i the light, s the viewer.",
        "Angles in radians; values are the BRDF in 1/sr, no cosine.",
        "theta at the middles of equal steps from 0 to pi/2, phi at equal steps from 0.",
    ];
    let conventions = conventions.map(str::to_owned).to_vec();
    let reading = table.resampling(task.brdf);
    Ok(Written { pairs: table.grid.pairs(), reading, conventions, anisotropy_lost: None })
}
