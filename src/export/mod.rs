//! The effective BRDF as a table that other programs load: `.npz` (numpy), `.csv`, `.exr` (an atlas of pictures).
//!
//! Every file holds the BRDF `f̄ / cos θ_i` and the reciprocal `G = a_v f̄ / A` on one grid of
//! `(theta_i, phi_i, theta_o, phi_o)`, and says so itself ([`ExportMeta`]). Same inputs, same bytes.

mod csv;
mod exr_atlas;
mod grid;
mod meta;
mod npz;
mod replace;
mod table;
mod zip;

use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::accuracy::Errors;
use crate::error::{Error, InputError, Result};
use crate::filtering::EffectiveBrdf;

pub use grid::ExportResolution;
pub use meta::ExportMeta;
pub use replace::replace_file;

use meta::Description;
use table::Table;

/// What was written, and how well the table stands for the function it was read from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExportReport {
    /// Pairs of directions in the table.
    pub pairs: usize,
    pub bytes: u64,
    /// Bilinear reading of the table against `eval`, on `f̄`, over a fixed set of pairs up to 85°.
    pub resampling: Errors,
}

/// The endings that can be written.
const WRITTEN: &str = ".npz, .csv or .exr";

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Npz,
    Csv,
    Exr,
}

impl Format {
    fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        let complaint = match ending.as_deref() {
            Some("npz") => return Ok(Self::Npz),
            Some("csv") => return Ok(Self::Csv),
            Some("exr") => return Ok(Self::Exr),
            Some(later @ ("bsdf" | "binary" | "xml")) => {
                let found = format!("the ending .{later}, which this version does not write yet");
                InputError::new("output", found, format!("a name that ends in {WRITTEN}"))
            }
            Some(other) => {
                InputError::new("output", format!("the ending .{other}"), format!("a name that ends in {WRITTEN}"))
            }
            None => InputError::new("output", "a name without an ending", format!("a name that ends in {WRITTEN}")),
        };
        Err(complaint.in_file(path).into())
    }
}

/// Whether [`write`] knows the ending of `path`: to be asked before any long work.
///
/// # Errors
/// An ending that is not written, with the ones that are.
pub fn check_ending(path: &Path) -> Result<()> {
    Format::of(path).map(|_| ())
}

/// Tabulates `brdf` and writes it by the ending of `path`. `progress` is told the part that is done, 0 to 1.
///
/// # Errors
/// An unknown ending, a resolution out of range, a place that cannot be written. An old file stays whole then.
pub fn write(
    brdf: &EffectiveBrdf,
    meta: &ExportMeta,
    resolution: &ExportResolution,
    path: &Path,
    progress: &dyn Fn(f32),
) -> Result<ExportReport> {
    let format = Format::of(path)?;
    let grid = resolution.grid()?;
    // The place is opened first, so that one that cannot be written is found before the long work.
    replace::replacing(path, |out| {
        let table = Table::new(brdf, grid, progress);
        let description = Description::new(meta, &table, brdf);
        let mut counted = Counted { inner: out, bytes: 0 };
        match format {
            Format::Npz => npz::write(&table, &description, &mut counted)?,
            Format::Csv => csv::write(&table, &description, &mut counted)?,
            Format::Exr => exr_atlas::write(&table, &description, &mut counted)?,
        }
        Ok(ExportReport { pairs: table.grid.pairs(), bytes: counted.bytes, resampling: description.resampling })
    })
}

/// [`write`] for `.csv` into an open stream, such as standard output. A reader that hangs up early is no failure.
///
/// # Errors
/// A resolution out of range, a stream that cannot be written.
pub fn write_csv(
    brdf: &EffectiveBrdf,
    meta: &ExportMeta,
    resolution: &ExportResolution,
    out: &mut dyn Write,
    progress: &dyn Fn(f32),
) -> Result<ExportReport> {
    let grid = resolution.grid()?;
    let table = Table::new(brdf, grid, progress);
    let description = Description::new(meta, &table, brdf);
    let mut counted = Counted { inner: out, bytes: 0 };
    let written = {
        let mut buffered = BufWriter::new(&mut counted);
        csv::write(&table, &description, &mut buffered).and_then(|()| buffered.flush())
    };
    match written {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            return Err(Error::failed(format!("standard output: {error}")));
        }
        _ => {}
    }
    Ok(ExportReport { pairs: table.grid.pairs(), bytes: counted.bytes, resampling: description.resampling })
}

/// Counts what passes through.
struct Counted<'a> {
    inner: &'a mut dyn Write,
    bytes: u64,
}

impl Write for Counted<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests;
