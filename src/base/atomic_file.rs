//! Writing a file so that it holds either its old content or all of the new.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::{Error, InputError, Progress, Result, progress};

/// Bytes that are written between two calls of the progress function.
const BYTES_A_STEP: usize = 1 << 20;

/// Writes `bytes` beside `path` and renames.
///
/// # Errors
/// A place that cannot be written; what was there stays.
pub fn replace_file(path: &Path, bytes: &[u8]) -> Result<()> {
    replacing(path, |out| out.write_all(bytes))
}

/// [`replace_file`] of what takes long to write.
///
/// # Errors
/// As [`replace_file`], and [`Error::Cancelled`] when `progress` says so.
pub(crate) fn replace_large_file(path: &Path, bytes: &[u8], progress: &Progress<'_>) -> Result<()> {
    replacing(path, |out| {
        for (k, chunk) in bytes.chunks(BYTES_A_STEP).enumerate() {
            let part = (k * BYTES_A_STEP) as f32 / bytes.len() as f32;
            progress::tell(progress, part).map_err(io::Error::other)?;
            out.write_all(chunk)?;
        }
        progress::tell(progress, 1.0).map_err(io::Error::other)
    })
}

/// Opens a file beside `path`, lets `content` fill it, and renames it to `path`. Devices and pipes are written to.
pub(crate) fn replacing<T>(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<T>) -> Result<T> {
    // What `content` says in our own words stays so.
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
    // Through a link, the file it leads to is replaced, not the link.
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
            // A device or a pipe holds nothing to keep; a file in its place would be another thing.
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

/// Removed when it goes, unless it has been renamed by then.
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // Gone already where all went well; else the first error is the one that matters.
        let _ = fs::remove_file(&self.0);
    }
}

/// A new file beside `path`. Its name may be taken: by another thread, or by a process of the same number that was killed
/// (in a container all have the same).
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
