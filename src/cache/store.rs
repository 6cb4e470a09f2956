//! Files of the cache: one per result, named by its key and checked when read. The least recently used are removed
//! first.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use super::Key;
use crate::base::regular_file;

const MAGIC: &[u8; 16] = b"biscale cache 1\n";

/// Size of magic, key and checksum, in bytes.
const HEADER: usize = 16 + 32 + 32;

/// Extension of a complete file.
const COMPLETE: &str = ".kept";
/// Extension of a file that is being written.
const UNFINISHED: &str = ".part";

/// Age of an unfinished file after which no program is writing it.
const ABANDONED: Duration = Duration::from_secs(3600);

/// Divisor of the cache's size limit that gives the largest size of one result.
const SHARES: u64 = 4;

/// Name and content of the file that marks the folder as a cache for backup tools (<https://bford.info/cachedir/>).
const TAG: (&str, &str) =
    ("CACHEDIR.TAG", "Signature: 8a477f597d28d172789f06886806bc55\n# Made by biscale. May be deleted.\n");

/// Number and total size of cached files.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Usage {
    pub files: usize,
    pub bytes: u64,
}

#[derive(Debug)]
pub(super) struct Store {
    folder: PathBuf,
    max_bytes: u64,
}

/// A file of the cache.
struct CachedFile {
    path: PathBuf,
    used: SystemTime,
    bytes: u64,
    unfinished: bool,
}

impl Store {
    pub(super) fn new(folder: PathBuf, max_bytes: u64) -> Self {
        Self { folder, max_bytes }
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    fn path(&self, key: &Key) -> PathBuf {
        self.folder.join(key.name() + COMPLETE)
    }

    /// Reads the result of a key. A damaged file is removed.
    pub(super) fn read(&self, key: &Key) -> Option<Vec<u8>> {
        let path = self.path(key);
        // The file is opened for writing so that its time can be set. Without that permission it is only read.
        let writable = regular_file::open_with(&path, OpenOptions::new().read(true).append(true));
        let Ok(file) = writable.or_else(|_| regular_file::open(&path)) else {
            // Nothing else may take the place of the next result.
            self.remove(key);
            return None;
        };
        let length = file.metadata().ok()?.len();
        let mut bytes = Vec::new();
        let whole = length <= self.max_bytes && (&file).take(length + 1).read_to_end(&mut bytes).is_ok();
        if !whole || !is_sound(&bytes, key) {
            self.remove(key);
            return None;
        }
        let _ = file.set_modified(SystemTime::now());
        bytes.drain(..HEADER);
        Some(bytes)
    }

    pub(super) fn remove(&self, key: &Key) {
        let _ = fs::remove_file(self.path(key));
    }

    /// Writes a new file and renames it, so that concurrent readers and writers see complete files only.
    pub(super) fn write(&self, key: &Key, payload: &[u8]) -> io::Result<()> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        if payload.len() as u64 > self.max_bytes / SHARES {
            return Ok(());
        }
        self.make_folder()?;
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let beside = self.folder.join(format!("{}-{}-{count}{UNFINISHED}", key.name(), std::process::id()));
        // A file of an ended process with the same id may be there, or anything else that has this name.
        let _ = fs::remove_file(&beside);
        let written = File::create_new(&beside).and_then(|mut file| {
            file.write_all(MAGIC)?;
            file.write_all(&key.0)?;
            file.write_all(&checksum(key, payload))?;
            file.write_all(payload)
        });
        let renamed = written.and_then(|()| fs::rename(&beside, self.path(key)));
        if renamed.is_err() {
            let _ = fs::remove_file(&beside);
        }
        self.enforce_limit();
        renamed
    }

    fn make_folder(&self) -> io::Result<()> {
        if !self.folder.is_dir() {
            fs::create_dir_all(&self.folder)?;
            let _ = fs::write(self.folder.join(TAG.0), TAG.1);
        }
        Ok(())
    }

    /// Removes the least recently used files until the rest is within the limit.
    fn enforce_limit(&self) {
        let mut found = self.found();
        let mut bytes: u64 = found.iter().map(|file| file.bytes).sum();
        found.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
        for file in found {
            // Another process may still rename an unfinished file.
            let is_abandoned = file.used.elapsed().is_ok_and(|age| age > ABANDONED);
            let is_over = bytes > self.max_bytes && !file.unfinished;
            if (is_over || file.unfinished && is_abandoned) && fs::remove_file(&file.path).is_ok() {
                bytes -= file.bytes;
            }
        }
    }

    pub(super) fn usage(&self) -> Usage {
        let found = self.found();
        Usage { files: found.len(), bytes: found.iter().map(|file| file.bytes).sum() }
    }

    pub(super) fn clear(&self) -> Usage {
        let mut removed = Usage::default();
        for file in self.found() {
            if fs::remove_file(&file.path).is_ok() {
                removed = Usage { files: removed.files + 1, bytes: removed.bytes + file.bytes };
            }
        }
        removed
    }

    /// Lists files with names of the cache, because the folder may contain other files.
    fn found(&self) -> Vec<CachedFile> {
        let Ok(entries) = fs::read_dir(&self.folder) else { return Vec::new() };
        let is_cached_file = |name: &str| {
            let is_key = name.len() > 64 && name.as_bytes()[..64].iter().all(u8::is_ascii_hexdigit);
            is_key && (&name[64..] == COMPLETE || name.ends_with(UNFINISHED))
        };
        let of = |entry: fs::DirEntry| {
            let name = entry.file_name().into_string().ok().filter(|name| is_cached_file(name))?;
            let metadata = entry.metadata().ok().filter(fs::Metadata::is_file)?;
            let used = metadata.modified().ok()?;
            Some(CachedFile { path: entry.path(), used, bytes: metadata.len(), unfinished: name.ends_with(UNFINISHED) })
        };
        entries.flatten().filter_map(of).collect()
    }
}

fn is_sound(bytes: &[u8], key: &Key) -> bool {
    let Some((header, payload)) = bytes.split_at_checked(HEADER) else { return false };
    header[..16] == *MAGIC && header[16..48] == key.0 && header[48..] == checksum(key, payload)
}

/// Checksum of the key and the payload, so that a file with another key's name counts as damaged.
fn checksum(key: &Key, payload: &[u8]) -> [u8; 32] {
    *blake3::keyed_hash(&key.0, payload).as_bytes()
}
