//! Atomic replacement of files: a file has either its old content or all of the new content.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::{Error, InputError, Progress, Result, progress};

/// Number of bytes that are written between two calls of the progress function.
const BYTES_PER_STEP: usize = 1 << 20;

/// Replaces the content of the file at `path`: writes `bytes` to a new file beside it and renames that file.
///
/// # Errors
/// The place cannot be written. The old file then stays.
pub fn replace_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomically(path, |out| out.write_all(bytes))
}

/// Replaces a file like [`replace_file`], and reports progress.
///
/// # Errors
/// As [`replace_file`], and [`Error::Cancelled`] if `progress` returns false.
pub(crate) fn replace_large_file(path: &Path, bytes: &[u8], progress: &Progress<'_>) -> Result<()> {
    write_atomically(path, |out| {
        for (k, chunk) in bytes.chunks(BYTES_PER_STEP).enumerate() {
            let part = (k * BYTES_PER_STEP) as f32 / bytes.len() as f32;
            progress::report(progress, part).map_err(io::Error::other)?;
            out.write_all(chunk)?;
        }
        progress::report(progress, 1.0).map_err(io::Error::other)
    })
}

/// Opens a file beside `path`, calls `content` to fill it, and renames it to `path`. Devices and pipes are written
/// directly.
///
/// # Errors
/// As [`replace_file`], and the errors of `content`.
pub(crate) fn write_atomically<T>(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<T>) -> Result<T> {
    // An error of this crate that `content` returns is passed on.
    let unwritable = |error: io::Error| {
        error.downcast::<Error>().unwrap_or_else(|error| {
            let full = matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded);
            let error = if full {
                InputError::new("output", "a full disk", "space for the file: free some, or choose another place")
            } else {
                InputError::new("output", error, "a place that can be written")
            };
            error.in_file(path).into()
        })
    };
    // If the path is a link, replace the file that it points to, not the link.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if let Ok(there) = fs::metadata(&target) {
        if there.is_dir() {
            return Err(InputError::new("output", "a folder", "a name for a file").in_file(path).into());
        }
        if there.permissions().readonly() {
            return Err(InputError::new("output", "a file that is read-only", "a place that can be written")
                .in_file(path)
                .into());
        }
        if !there.is_file() {
            // A device or a pipe has no content to preserve, and a file must not replace it.
            let mut device = BufWriter::new(File::options().write(true).open(&target).map_err(unwritable)?);
            let value = content(&mut device).map_err(unwritable)?;
            device.flush().map_err(unwritable)?;
            return Ok(value);
        }
    }
    let (temporary, file) = open_beside(&target).map_err(unwritable)?;
    let mut file = BufWriter::new(file);
    let value = content(&mut file).map_err(unwritable)?;
    file.into_inner().map_err(|error| unwritable(error.into_error()))?.sync_all().map_err(unwritable)?;
    fs::rename(&temporary.0, &target).map_err(unwritable)?;
    Ok(value)
}

/// A temporary file, which is removed when this value is dropped unless the file has been renamed.
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // After success the file no longer exists here, and after a failure the first error is the one to report.
        let _ = fs::remove_file(&self.0);
    }
}

/// Creates a new file beside `path`. A name may be taken by another thread, or by a killed process with the same id. In
/// containers, ids repeat.
fn open_beside(path: &Path) -> io::Result<(Temporary, File)> {
    const MAX_TRIES: u32 = 1000;
    let mut attempt = 0;
    loop {
        let mut name = OsString::from(".");
        name.push(path.file_name().unwrap_or_default());
        name.push(format!(".{}-{attempt}.part", std::process::id()));
        let temporary = path.with_file_name(name);
        match File::create_new(&temporary) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists && attempt < MAX_TRIES => attempt += 1,
            opened => return opened.map(|file| (Temporary(temporary), file)),
        }
    }
}
