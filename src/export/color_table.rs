//! The prefiltered table of a colour map as a file: `.exr` or `.npz`.

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use crate::base::zip::ZipWriter;
use crate::base::{Error, InputError, Result, replace_file};
use crate::color_map::{DEVIATIONS, MEANS, Normal, PrefilteredTable, StopMap};

/// Reads per axis between which the table is compared with the closed form.
const READS: usize = 150;

/// Size of a table, and its errors against the closed form.
#[derive(Debug, Clone, Serialize)]
pub struct TableError {
    pub means: usize,
    pub deviations: usize,
    pub rms: f64,
    pub worst: f64,
}

/// Axes and errors, as files state them.
#[derive(Serialize)]
struct Notes<'a> {
    layout: &'static str,
    means: [f64; 2],
    deviations: &'a [f64],
    #[serde(flatten)]
    error: &'a TableError,
}

/// Checks that the ending of a file is that of a table.
///
/// # Errors
/// The ending is neither `.exr` nor `.npz`.
pub fn check(path: &Path) -> Result<()> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    if matches!(ending, "exr" | "npz") {
        return Ok(());
    }
    Err(InputError::new("--table", path.display(), "a file that ends in .exr or .npz").into())
}

/// Writes a table. Columns are means and rows are deviations.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, table: &PrefilteredTable, map: &StopMap) -> Result<TableError> {
    let error = compare(table, map);
    let (means, deviations) = table.axes();
    let notes = Notes {
        layout: "column = mean, row = deviation, linear RGB; the axis of deviations is their square root",
        means: [means[0], means[means.len() - 1]],
        deviations: &deviations,
        error: &error,
    };
    let notes = serde_json::to_string(&notes).map_err(|error| Error::failed(error.to_string()))?;
    let mut bytes = Vec::new();
    let written = if path.extension().is_some_and(|ending| ending == "npz") {
        npz(table, &means, &deviations, &notes, &mut bytes)
    } else {
        super::exr_atlas::rgb([MEANS, DEVIATIONS], &notes, table.colors(), &mut bytes)
    };
    written.map_err(|error| Error::failed(format!("cannot write {}: {error}", path.display())))?;
    replace_file(path, &bytes)?;
    Ok(error)
}

fn npz(
    table: &PrefilteredTable,
    means: &[f64],
    deviations: &[f64],
    notes: &str,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut zip = ZipWriter::new(out);
    super::npz::array(&mut zip, "mean", "f8", &[means.len()], bytemuck::cast_slice(means))?;
    super::npz::array(&mut zip, "deviation", "f8", &[deviations.len()], bytemuck::cast_slice(deviations))?;
    let shape = [deviations.len(), means.len(), 3];
    super::npz::array(&mut zip, "color", "f4", &shape, bytemuck::cast_slice(table.colors()))?;
    let notes: Vec<u32> = notes.chars().map(u32::from).collect();
    super::npz::array(&mut zip, "meta", &format!("U{}", notes.len()), &[], bytemuck::cast_slice(&notes))?;
    zip.finish()
}

/// Errors at points between the entries, the deviations even in their logarithm.
fn compare(table: &PrefilteredTable, map: &StopMap) -> TableError {
    let (means, deviations) = table.axes();
    let (low, high) = (means[0], means[means.len() - 1]);
    let most = deviations[deviations.len() - 1];
    let (mut square, mut worst) = (0.0, 0.0_f64);
    for j in 0..READS {
        let deviation = most * (2e-3_f64).powf(j as f64 / READS as f64);
        for i in 0..READS {
            let mean = low + (high - low) * (i as f64 + 0.37) / READS as f64;
            let at = Normal { mean, deviation };
            let error: DVec3 = table.mean(&at) - map.mean(&at);
            square += error.length_squared() / 3.0;
            worst = worst.max(error.abs().max_element());
        }
    }
    TableError { means: MEANS, deviations: DEVIATIONS, rms: (square / (READS * READS) as f64).sqrt(), worst }
}
