//! Export of the effective BRDF as a table that other programs load; one module per format. The same input gives the
//! same bytes.
//!
//! `.npz` (numpy), `.csv` and `.exr` contain all quantities on one grid, and [`ExportMeta`]. The other formats follow
//! the published layouts of other programs: RGL tensor files (Mitsuba, pbrt), MERL, Radiance, UTIA, ASTM. A text note
//! is written beside each of those files.

mod astm;
pub mod color_table;
mod csv;
mod exr_atlas;
mod grid;
mod merl;
mod meta;
pub mod mitsuba;
mod note;
mod npz;
mod radiance;
mod rgl;
mod sampler;
mod table;
pub mod slab;
mod slab_npz;
pub mod tile;
mod utia;

use std::ffi::OsString;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::base::{Error, InputError, Progress, Result, atomic_file, check_output, replace_file};
use crate::effective::EffectiveBrdf;
use crate::scene::millimetres;

pub use grid::ExportResolution;
pub use meta::ExportMeta;
pub use note::{Reflectances, reflectances};
pub use radiance::RadianceBasis;
pub use radiance::slab as radiance_slab;
pub use rgl::sampling::{DirectionSampler, Sampled, SamplerTables};
pub use sampler::ReadingError;

use meta::Description;
use table::ExportTable;

/// Options of an exported table.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ExportOptions {
    /// Size of the grid; `None` selects the format's default. Formats with a fixed grid ignore it.
    pub resolution: Option<ExportResolution>,
    /// Basis of a Radiance `.xml`.
    pub radiance: RadianceBasis,
}

/// The size of a written table and its error.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportReport {
    /// Number of direction pairs in the table.
    pub pairs: usize,
    pub bytes: u64,
    /// Error of `f̄` as a program reads it from the table, over a fixed set of pairs up to 85° from the normal.
    pub reading: ReadingError,
    /// Path of the text note beside the table; `None` if the table contains its description.
    pub note: Option<PathBuf>,
    /// Relative L2 between azimuths of the tile, if the format is isotropic and cannot represent them.
    pub anisotropy_lost: Option<f64>,
    pub reflectances: Reflectances,
}

/// Input of a format's writer: the function, its origin, the options and the progress.
#[derive(Clone, Copy)]
struct ExportTask<'a> {
    brdf: &'a EffectiveBrdf,
    meta: &'a ExportMeta,
    options: &'a ExportOptions,
    progress: &'a Progress<'a>,
}

impl ExportTask<'_> {
    /// Returns a line that describes the table.
    fn summary(&self) -> String {
        let ExportMeta { scene, quality, .. } = self.meta;
        format!("{}: effective BRDF of {scene} ({quality})", meta::PROGRAM)
    }
}

/// Result of a format's writer.
struct Written {
    pairs: usize,
    reading: ReadingError,
    /// Sentences that define the layout and the units of the file.
    conventions: Vec<String>,
    /// Relative L2 between azimuths, if the format cannot represent them.
    anisotropy_lost: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ExportFormat {
    Npz,
    Csv,
    Exr,
    Rgl,
    /// An RGL file with spectra instead of RGB.
    RglSpectral,
    Merl,
    Radiance,
    Utia,
    Astm,
}

/// File extensions and their formats.
const FORMATS: &[(&str, ExportFormat)] = &[
    ("npz", ExportFormat::Npz),
    ("csv", ExportFormat::Csv),
    ("exr", ExportFormat::Exr),
    ("bsdf", ExportFormat::Rgl),
    ("binary", ExportFormat::Merl),
    ("xml", ExportFormat::Radiance),
    ("bin", ExportFormat::Utia),
    ("astm", ExportFormat::Astm),
];

impl ExportFormat {
    fn of(path: &Path) -> Result<Self> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        if name.ends_with("_spec.bsdf") {
            return Ok(Self::RglSpectral);
        }
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        let known = ending.as_deref().and_then(|ending| FORMATS.iter().find(|(known, _)| *known == ending));
        if let Some((_, format)) = known {
            return Ok(*format);
        }
        let found =
            ending.map_or_else(|| "a name without an ending".to_owned(), |other| format!("the ending .{other}"));
        let endings: Vec<String> = FORMATS.iter().map(|(ending, _)| format!(".{ending}")).collect();
        let expected = format!("a name that ends in {}", endings.join(", "));
        Err(InputError::new("output", found, expected).in_file(path).into())
    }

    /// Returns whether the file contains its description, so that it needs no note.
    fn describes_itself(self) -> bool {
        matches!(self, Self::Npz | Self::Csv | Self::Exr)
    }
}

/// Returns the file extensions that [`write`] supports.
pub fn endings() -> impl Iterator<Item = &'static str> {
    FORMATS.iter().map(|(ending, _)| *ending)
}

/// Returns whether the format of `path` lets the caller choose the steps of theta and phi.
pub fn grid_is_free(path: &Path) -> bool {
    ExportFormat::of(path).is_ok_and(|format| format.describes_itself() || format == ExportFormat::Astm)
}

/// Checks that [`write`] supports the extension of `path`. Callers check it before a long computation.
///
/// # Errors
/// An unsupported extension; the message lists the supported ones.
pub fn check_ending(path: &Path) -> Result<()> {
    ExportFormat::of(path).map(|_| ())
}

/// Returns the files that [`write`] writes for `path`: the table, and its note if the format needs one.
///
/// # Errors
/// As [`check_ending`].
pub fn outputs(path: &Path) -> Result<Vec<PathBuf>> {
    let note = (!ExportFormat::of(path)?.describes_itself()).then(|| note_path(path));
    Ok(std::iter::once(path.to_owned()).chain(note).collect())
}

/// Tabulates `brdf` and writes it in the format of the extension of `path`. Formats without a description get a text
/// note beside the file (`NAME.EXTENSION.txt`).
///
/// # Errors
/// [`Error::Cancelled`] if `progress` cancels, an unknown extension, a resolution out of range, or an unwritable path. An
/// existing file then stays unchanged.
pub fn write(
    brdf: &EffectiveBrdf,
    meta: &ExportMeta,
    options: &ExportOptions,
    path: &Path,
    progress: &Progress<'_>,
) -> Result<ExportReport> {
    let format = ExportFormat::of(path)?;
    if let Some(resolution) = &options.resolution {
        resolution.check()?;
    }
    if format == ExportFormat::Radiance {
        millimetres(&meta.tile_unit)?;
    }
    let task = ExportTask { brdf, meta, options, progress };
    // An unwritable path is reported before the long computation.
    check_output(path, &[])?;
    if !format.describes_itself() {
        check_output(&note_path(path), &[])?;
    }
    let (written, bytes) = atomic_file::write_atomically(path, |out| {
        let mut counted = CountingWriter { inner: out, bytes: 0 };
        let written = match format {
            ExportFormat::Npz => on_grid(&task, &mut counted, npz::write)?,
            ExportFormat::Csv => on_grid(&task, &mut counted, csv::write)?,
            ExportFormat::Exr => on_grid(&task, &mut counted, exr_atlas::write)?,
            ExportFormat::Rgl => rgl::write(&task, &mut counted, rgl::Colors::Rgb)?,
            ExportFormat::RglSpectral => rgl::write(&task, &mut counted, rgl::Colors::Spectra)?,
            ExportFormat::Merl => merl::write(&task, &mut counted)?,
            ExportFormat::Radiance => radiance::write(&task, &mut counted)?,
            ExportFormat::Utia => utia::write(&task, &mut counted)?,
            ExportFormat::Astm => astm::write(&task, &mut counted)?,
        };
        Ok((written, counted.bytes))
    })?;
    let reflectances = Reflectances::of(brdf);
    let mut report = ExportReport {
        pairs: written.pairs,
        bytes,
        reading: written.reading,
        note: None,
        anisotropy_lost: written.anisotropy_lost,
        reflectances,
    };
    if !format.describes_itself() {
        let note_path = note_path(path);
        replace_file(&note_path, note::text(&task, path, &written, &report.reflectances).as_bytes())?;
        report.note = Some(note_path);
    }
    Ok(report)
}

/// Returns the path of the note on a table: `cup.bsdf.txt` beside `cup.bsdf`.
pub fn note_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".txt");
    path.with_file_name(name)
}

/// Tabulates all quantities on one grid and writes them with `write`.
fn on_grid(
    task: &ExportTask<'_>,
    out: &mut dyn Write,
    write: impl Fn(&ExportTable, &Description<'_>, &mut dyn Write) -> io::Result<()>,
) -> io::Result<Written> {
    let grid = task.options.resolution.unwrap_or_default().grid();
    let table = ExportTable::new(task.brdf, grid, task.progress)?;
    let reading = table.resampling(task.brdf);
    write(&table, &Description::new(task, reading.errors), out)?;
    Ok(Written { pairs: table.grid.pairs(), reading, conventions: Vec::new(), anisotropy_lost: None })
}

/// Writes a `.csv` to an open stream, such as standard output. It is not an error if the reader closes the stream
/// early.
///
/// # Errors
/// A resolution out of range, or a stream that cannot be written.
pub fn write_csv(
    brdf: &EffectiveBrdf,
    meta: &ExportMeta,
    options: &ExportOptions,
    out: &mut dyn Write,
    progress: &Progress<'_>,
) -> Result<()> {
    to_stream(&ExportTask { brdf, meta, options, progress }, out, csv::write)
}

/// The content of an `.npz` file.
///
/// # Errors
/// A resolution out of range, or [`Error::Cancelled`].
pub fn npz_bytes(
    brdf: &EffectiveBrdf,
    meta: &ExportMeta,
    options: &ExportOptions,
    progress: &Progress<'_>,
) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    to_stream(&ExportTask { brdf, meta, options, progress }, &mut bytes, npz::write)?;
    Ok(bytes)
}

fn to_stream(
    task: &ExportTask<'_>,
    out: &mut dyn Write,
    write: impl Fn(&ExportTable, &Description<'_>, &mut dyn Write) -> io::Result<()>,
) -> Result<()> {
    if let Some(resolution) = &task.options.resolution {
        resolution.check()?;
    }
    let mut buffered = BufWriter::new(out);
    match on_grid(task, &mut buffered, write).and_then(|_| buffered.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            // An error of this crate is passed on.
            Err(error.downcast::<Error>().unwrap_or_else(|error| Error::failed(format!("the stream: {error}"))))
        }
        _ => Ok(()),
    }
}

/// A writer that counts the bytes.
struct CountingWriter<'a> {
    inner: &'a mut dyn Write,
    bytes: u64,
}

impl Write for CountingWriter<'_> {
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
