//! The effective BRDF as a table that other programs load, one file here a format. Same inputs, same bytes.
//!
//! `.npz` (numpy), `.csv` and `.exr` hold everything there is on one grid ([`ExportMeta`] inside). The others are the
//! formats of other programs, by their published layouts: RGL tensor files (Mitsuba, pbrt), MERL, Radiance, UTIA, ASTM. Each
//! has a note in plain words beside it.

mod astm;
mod csv;
mod exr_atlas;
mod grid;
mod merl;
mod meta;
mod note;
mod npz;
mod radiance;
mod rgl;
mod sampler;
mod table;
pub mod tile;
mod utia;
mod zip;

use std::ffi::OsString;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::base::{Error, InputError, Progress, Result, atomic_file, replace_file};
use crate::effective::EffectiveBrdf;

pub use grid::ExportResolution;
pub use meta::ExportMeta;
pub use note::Reflectances;
pub use radiance::RadianceBasis;
pub use sampler::ReadingError;

use meta::Description;
use table::Table;

/// What may be chosen about a table.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ExportOptions {
    /// Sizes of the grids; each format has its own default. Formats whose grid is part of the layout do without.
    pub resolution: Option<ExportResolution>,
    /// What a Radiance `.xml` holds.
    pub radiance: RadianceBasis,
}

/// What was written, and how well the table stands for the function it was read from.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportReport {
    /// Pairs of directions in the table.
    pub pairs: usize,
    pub bytes: u64,
    /// What a program that reads the table gets against `eval`, on `f̄`, over a fixed set of pairs up to 85°.
    pub reading: ReadingError,
    /// The file of plain words beside the table; `None` where the table itself holds them.
    pub note: Option<PathBuf>,
    /// Relative L2 between azimuths of the tile, where the format is isotropic and cannot tell them apart.
    pub anisotropy_lost: Option<f64>,
    pub reflectances: Reflectances,
}

/// What is being written: the function, where it comes from, what was asked for, and whom to tell the part that is done.
#[derive(Clone, Copy)]
struct Job<'a> {
    brdf: &'a EffectiveBrdf,
    meta: &'a ExportMeta,
    options: &'a ExportOptions,
    progress: &'a Progress<'a>,
}

impl Job<'_> {
    /// A line that says what the table is.
    fn summary(&self) -> String {
        let ExportMeta { scene, quality, .. } = self.meta;
        format!("{}: effective BRDF of {scene} ({quality})", meta::PROGRAM)
    }
}

/// What a format says of the file it wrote.
struct Written {
    pairs: usize,
    reading: ReadingError,
    /// Sentences on how its numbers are to be read.
    conventions: Vec<String>,
    /// Relative L2 between azimuths, where the format cannot tell them apart.
    anisotropy_lost: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Npz,
    Csv,
    Exr,
    Rgl,
    /// With spectra in place of RGB.
    RglSpectral,
    Merl,
    Radiance,
    Utia,
    Astm,
}

/// Endings and what is written for them.
const FORMATS: &[(&str, Format)] = &[
    ("npz", Format::Npz),
    ("csv", Format::Csv),
    ("exr", Format::Exr),
    ("bsdf", Format::Rgl),
    ("binary", Format::Merl),
    ("xml", Format::Radiance),
    ("bin", Format::Utia),
    ("astm", Format::Astm),
];

impl Format {
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

    /// Whether everything there is to say is in the file itself.
    fn describes_itself(self) -> bool {
        matches!(self, Self::Npz | Self::Csv | Self::Exr)
    }
}

/// The endings that [`write`] knows.
pub fn endings() -> impl Iterator<Item = &'static str> {
    FORMATS.iter().map(|(ending, _)| *ending)
}

/// Whether steps of theta and phi may be chosen for a file of this name; other formats bring their own grid.
pub fn grid_is_free(path: &Path) -> bool {
    Format::of(path).is_ok_and(|format| format.describes_itself() || format == Format::Astm)
}

/// Whether [`write`] knows the ending of `path`: to be asked before any long work.
///
/// # Errors
/// An ending that is not written, with the ones that are.
pub fn check_ending(path: &Path) -> Result<()> {
    Format::of(path).map(|_| ())
}

/// Tabulates `brdf` and writes it by the ending of `path`, and a note in plain words beside it (`NAME.ENDING.txt`).
///
/// # Errors
/// [`Error::Cancelled`] when `progress` says so, an unknown ending, a resolution out of range, a place that cannot be written. An old file stays whole then.
pub fn write(
    brdf: &EffectiveBrdf,
    meta: &ExportMeta,
    options: &ExportOptions,
    path: &Path,
    progress: &Progress<'_>,
) -> Result<ExportReport> {
    let format = Format::of(path)?;
    if let Some(resolution) = &options.resolution {
        resolution.check()?;
    }
    let job = Job { brdf, meta, options, progress };
    // The place is opened first, so that one that cannot be written is found before the long work.
    let (written, bytes) = atomic_file::replacing(path, |out| {
        let mut counted = Counted { inner: out, bytes: 0 };
        let written = match format {
            Format::Npz => on_grid(&job, &mut counted, npz::write)?,
            Format::Csv => on_grid(&job, &mut counted, csv::write)?,
            Format::Exr => on_grid(&job, &mut counted, exr_atlas::write)?,
            Format::Rgl => rgl::write(&job, &mut counted, rgl::Colors::Rgb)?,
            Format::RglSpectral => rgl::write(&job, &mut counted, rgl::Colors::Spectra)?,
            Format::Merl => merl::write(&job, &mut counted)?,
            Format::Radiance => radiance::write(&job, &mut counted)?,
            Format::Utia => utia::write(&job, &mut counted)?,
            Format::Astm => astm::write(&job, &mut counted)?,
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
        let place = note_path(path);
        replace_file(&place, note::text(&job, path, &written, &report.reflectances).as_bytes())?;
        report.note = Some(place);
    }
    Ok(report)
}

/// The place of the note on a table: `cup.bsdf.txt` beside `cup.bsdf`.
pub fn note_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".txt");
    path.with_file_name(name)
}

/// A file that holds everything on one grid.
fn on_grid(
    job: &Job<'_>,
    out: &mut dyn Write,
    write: impl Fn(&Table, &Description<'_>, &mut dyn Write) -> io::Result<()>,
) -> io::Result<Written> {
    let grid = job.options.resolution.unwrap_or_default().grid();
    let table = Table::new(job.brdf, grid, job.progress)?;
    let reading = table.resampling(job.brdf);
    write(&table, &Description::new(job, reading.errors), out)?;
    Ok(Written { pairs: table.grid.pairs(), reading, conventions: Vec::new(), anisotropy_lost: None })
}

/// [`write`] for `.csv` into an open stream, such as standard output. A reader that hangs up early is no failure.
///
/// # Errors
/// A resolution out of range, a stream that cannot be written.
pub fn write_csv(
    brdf: &EffectiveBrdf,
    meta: &ExportMeta,
    options: &ExportOptions,
    out: &mut dyn Write,
    progress: &Progress<'_>,
) -> Result<()> {
    if let Some(resolution) = &options.resolution {
        resolution.check()?;
    }
    let mut buffered = BufWriter::new(out);
    let job = Job { brdf, meta, options, progress };
    match on_grid(&job, &mut buffered, csv::write).and_then(|_| buffered.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::failed(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
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
