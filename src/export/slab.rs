//! Formats of scenes with a slab, by the ending of the file.

use std::path::{Path, PathBuf};

use super::{ExportOptions, mitsuba, radiance_slab, slab_npz};
use crate::base::{InputError, Progress, Result};
use crate::scene::LoadedScene;
use crate::slab::Slab;

/// A format of slabs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SlabFormat {
    /// Klems matrices or tensor trees for Radiance.
    Radiance,
    Npz,
    /// A scene of Mitsuba 3.
    Mitsuba,
}

/// A report on the files that were written.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SlabWritten {
    /// A file beside it that describes the conventions.
    pub note: Option<PathBuf>,
    /// Number of pairs of directions; 0 for a scene.
    pub pairs: usize,
}

impl SlabFormat {
    /// The format of a file name.
    ///
    /// # Errors
    /// Another ending.
    pub fn of(path: &Path) -> Result<Self> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let endings = [(mitsuba::ENDING, Self::Mitsuba), (".xml", Self::Radiance), (".npz", Self::Npz)];
        let known = endings.into_iter().find(|(ending, _)| name.ends_with(ending));
        known.map(|(_, format)| format).ok_or_else(|| {
            let found = format!("`{}` for a scene with a slab", path.display());
            let expected = format!("a name that ends in .npz, {} or .xml (Radiance)", mitsuba::ENDING);
            InputError::new("output", found, expected).into()
        })
    }

    /// Writes a slab.
    ///
    /// # Errors
    /// A slab that the format cannot hold, a path that cannot be written, or [`crate::Error::Cancelled`].
    pub fn write(
        self,
        slab: &Slab,
        loaded: &LoadedScene,
        options: &ExportOptions,
        path: &Path,
        progress: &Progress<'_>,
    ) -> Result<SlabWritten> {
        Ok(match self {
            Self::Radiance => {
                let (note, pairs) = radiance_slab::write(slab, loaded, options, path, progress)?;
                SlabWritten { note: Some(note), pairs }
            }
            Self::Npz => {
                let pairs = slab_npz::write(slab, loaded, options.resolution.unwrap_or_default(), path, progress)?;
                SlabWritten { note: None, pairs }
            }
            Self::Mitsuba => {
                mitsuba::write(loaded, path)?;
                SlabWritten::default()
            }
        })
    }
}
