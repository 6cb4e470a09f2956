//! Atomic replacement of files: a file has either its old content or all of the new content.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::{Error, InputError, Progress, Result, progress, regular_file};

/// Number of bytes that are written at once, and between two calls of the progress function.
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

/// Calls `content` to fill a file beside `path`, and renames that file to `path`. The file is opened when the first
/// bytes are written to it. Devices and pipes are written directly.
///
/// # Errors
/// As [`replace_file`], and the errors of `content`.
pub(crate) fn write_atomically<T>(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<T>) -> Result<T> {
    let unwritable = |error: io::Error| unwritable(error, path);
    let Place { target, is_device } = Place::of(path)?;
    if is_device {
        // A device or a pipe has no content to preserve, and a file must not replace it.
        let mut device = BufWriter::new(File::options().write(true).open(&target).map_err(unwritable)?);
        let value = content(&mut device).map_err(unwritable)?;
        device.flush().map_err(unwritable)?;
        return Ok(value);
    }
    let mut out = BufWriter::with_capacity(BYTES_PER_STEP, Beside { target: &target, temporary: None });
    let value = match content(&mut out) {
        Ok(value) => value,
        Err(error) => {
            // Without this, the buffer would write the rest of the abandoned content.
            let _ = out.into_parts();
            return Err(unwritable(error));
        }
    };
    let mut beside = out.into_inner().map_err(|error| unwritable(error.into_error()))?;
    beside.open().and_then(|temporary| temporary.rename(&target)).map_err(unwritable)?;
    Ok(value)
}

/// An error of the file system, as an error of the output file. An error of this crate is passed on.
fn unwritable(error: io::Error, path: &Path) -> Error {
    error.downcast::<Error>().unwrap_or_else(|error| {
        let full = matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded);
        if full {
            // The disk is no fault of the input.
            let expected = "space for the file: free some, or choose another place";
            return Error::failed(InputError::new("output", "a full disk", expected).in_file(path));
        }
        InputError::new("output", error, "a place that can be written").in_file(path).into()
    })
}

/// The file that a write replaces.
struct Place {
    target: PathBuf,
    /// The target is a device or a pipe.
    is_device: bool,
}

impl Place {
    fn of(path: &Path) -> Result<Self> {
        let refused = |found: &str, expected: &str| InputError::new("output", found, expected).in_file(path).into();
        // If the path is a link, the file that it points to is replaced, not the link.
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let there = match fs::metadata(&target) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            // For example, the name is too long.
            there => Some(there.map_err(|error| unwritable(error, path))?),
        };
        if there.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(refused("a folder", "a name for a file"));
        }
        if there.as_ref().is_some_and(|there| there.permissions().readonly()) {
            return Err(refused("a file that is read-only", "a place that can be written"));
        }
        Ok(Self { target, is_device: there.is_some_and(|there| !there.is_file()) })
    }
}

/// A writer to a temporary file beside the target, which the first write opens.
struct Beside<'a> {
    target: &'a Path,
    temporary: Option<Temporary>,
}

impl Beside<'_> {
    fn open(&mut self) -> io::Result<&mut Temporary> {
        match &mut self.temporary {
            Some(temporary) => Ok(temporary),
            closed => Ok(closed.insert(Temporary::beside(self.target)?)),
        }
    }
}

impl Write for Beside<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.open()?.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A temporary file, which is removed when this value is dropped unless the file has been renamed. It is locked as
/// long as it is open. The system releases the lock of a process that ends, so an unlocked temporary file is abandoned.
struct Temporary {
    path: PathBuf,
    file: File,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // After success the file no longer exists here, and after a failure the first error is the one to report.
        let _ = fs::remove_file(&self.path);
    }
}

/// Extension of temporary files.
const TEMPORARY: &str = ".part";
/// Bounds the bytes of the target's name in the name of a temporary file. The whole name then stays below the limits of
/// file systems: 255 bytes, and 143 with eCryptfs.
const MAX_STEM: usize = 100;

impl Temporary {
    /// Creates a file beside `target`, and removes the abandoned ones there.
    fn beside(target: &Path) -> io::Result<Self> {
        const MAX_TRIES: u32 = 1000;
        /// Number of files of this process, which tells their names apart.
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let prefix = prefix(target);
        remove_abandoned(target, &prefix);
        for _ in 0..MAX_TRIES {
            let count = COUNT.fetch_add(1, Ordering::Relaxed);
            let path = target.with_file_name(format!("{prefix}{}-{count}{TEMPORARY}", std::process::id()));
            // Another process may have the same id, because containers have ids of their own.
            let file = match File::create_new(&path) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => continue,
                created => created?,
            };
            // Another process may have found the file between its creation and its lock, and may remove it. Where the
            // file system has no locks, nothing is removed.
            if !matches!(file.try_lock(), Err(TryLockError::WouldBlock)) && path.exists() {
                return Ok(Self { path, file });
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }

    fn rename(&self, target: &Path) -> io::Result<()> {
        self.file.sync_all()?;
        fs::rename(&self.path, target)
    }
}

/// The first characters of the names of the temporary files of `target`.
fn prefix(target: &Path) -> String {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    format!(".{}.", &name[..name.floor_char_boundary(MAX_STEM)])
}

/// Removes the temporary files of ended processes beside `target`.
fn remove_abandoned(target: &Path, prefix: &str) {
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let is_temporary = |name: &str| {
        let numbers = name.strip_prefix(prefix).and_then(|rest| rest.strip_suffix(TEMPORARY));
        numbers.and_then(|numbers| numbers.split_once('-')).is_some_and(|(id, count)| is_number(id) && is_number(count))
    };
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_file = || entry.file_type().is_ok_and(|kind| kind.is_file());
        if !entry.file_name().to_str().is_some_and(is_temporary) || !is_file() {
            continue;
        }
        let path = entry.path();
        if let Ok(file) = regular_file::open_with(&path, OpenOptions::new().read(true).write(true))
            && file.try_lock().is_ok()
        {
            // A file that cannot be removed does no harm.
            let _ = fs::remove_file(path);
        }
    }
}

#[cfg(test)]
#[path = "atomic_file_tests.rs"]
mod tests;
