//! The files: a result each, named by its key, checked when read, the least recently used dropped first.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use super::Key;

const MAGIC: &[u8; 16] = b"biscale cache 1\n";

/// Magic, key, checksum.
const HEADER: usize = 16 + 32 + 32;

const ENDING: &str = ".kept";
const UNFINISHED: &str = ".part";

/// What a program left unfinished so long ago is not being written any more.
const ABANDONED: Duration = Duration::from_secs(3600);

/// One result may take this part of all there is room for.
const MAX_SHARE: u64 = 4;

/// Tells those who tidy and back up that nothing here is of worth (<https://bford.info/cachedir/>).
const TAG: (&str, &str) =
    ("CACHEDIR.TAG", "Signature: 8a477f597d28d172789f06886806bc55\n# Made by biscale. May be deleted.\n");

/// How much is kept.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Usage {
    pub files: usize,
    pub bytes: u64,
}

#[derive(Debug)]
pub(super) struct Store {
    folder: PathBuf,
    largest: u64,
}

/// A file of ours.
struct Found {
    path: PathBuf,
    used: SystemTime,
    bytes: u64,
    unfinished: bool,
}

impl Store {
    pub(super) fn new(folder: PathBuf, largest: u64) -> Self {
        Self { folder, largest }
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    fn path(&self, key: &Key) -> PathBuf {
        self.folder.join(key.name() + ENDING)
    }

    /// What was written under a key. A file that is not whole is removed.
    pub(super) fn read(&self, key: &Key) -> Option<Vec<u8>> {
        let path = self.path(key);
        // Opened for writing only so that its time can be set; where that is forbidden it can still be read.
        let file = OpenOptions::new().read(true).append(true).open(&path).or_else(|_| File::open(&path)).ok()?;
        let length = file.metadata().ok()?.len();
        let mut bytes = Vec::new();
        let whole = length <= self.largest && (&file).take(length + 1).read_to_end(&mut bytes).is_ok();
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

    /// Writes beside the place and renames: who reads meanwhile, or writes the same, meets a whole file.
    pub(super) fn write(&self, key: &Key, payload: &[u8]) -> io::Result<()> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        if payload.len() as u64 > self.largest / MAX_SHARE {
            return Ok(());
        }
        self.make_folder()?;
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let beside = self.folder.join(format!("{}-{}-{count}{UNFINISHED}", key.name(), std::process::id()));
        let written = File::create(&beside).and_then(|mut file| {
            file.write_all(MAGIC)?;
            file.write_all(&key.0)?;
            file.write_all(&checksum(key, payload))?;
            file.write_all(payload)
        });
        let renamed = written.and_then(|()| fs::rename(&beside, self.path(key)));
        if renamed.is_err() {
            let _ = fs::remove_file(&beside);
        }
        self.keep_bound();
        renamed
    }

    fn make_folder(&self) -> io::Result<()> {
        if !self.folder.is_dir() {
            fs::create_dir_all(&self.folder)?;
            let _ = fs::write(self.folder.join(TAG.0), TAG.1);
        }
        Ok(())
    }

    /// Drops what was not used for longest until the rest is within bounds.
    fn keep_bound(&self) {
        let mut found = self.found();
        let mut bytes: u64 = found.iter().map(|file| file.bytes).sum();
        found.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
        for file in found {
            // Another process may be about to rename it.
            let is_abandoned = file.used.elapsed().is_ok_and(|age| age > ABANDONED);
            let is_over = bytes > self.largest && !file.unfinished;
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
        let mut gone = Usage::default();
        for file in self.found() {
            if fs::remove_file(&file.path).is_ok() {
                gone = Usage { files: gone.files + 1, bytes: gone.bytes + file.bytes };
            }
        }
        gone
    }

    /// Only what has a name that we give: the folder may be anybody's.
    fn found(&self) -> Vec<Found> {
        let Ok(entries) = fs::read_dir(&self.folder) else { return Vec::new() };
        let ours = |name: &str| {
            let is_key = name.len() > 64 && name.as_bytes()[..64].iter().all(u8::is_ascii_hexdigit);
            is_key && (&name[64..] == ENDING || name.ends_with(UNFINISHED))
        };
        let of = |entry: fs::DirEntry| {
            let name = entry.file_name().into_string().ok().filter(|name| ours(name))?;
            let about = entry.metadata().ok().filter(fs::Metadata::is_file)?;
            let used = about.modified().ok()?;
            Some(Found { path: entry.path(), used, bytes: about.len(), unfinished: name.ends_with(UNFINISHED) })
        };
        entries.flatten().filter_map(of).collect()
    }
}

fn is_sound(bytes: &[u8], key: &Key) -> bool {
    let Some((header, payload)) = bytes.split_at_checked(HEADER) else { return false };
    header[..16] == *MAGIC && header[16..48] == key.0 && header[48..] == checksum(key, payload)
}

/// Of the key too: a file under another's name is damaged.
fn checksum(key: &Key, payload: &[u8]) -> [u8; 32] {
    *blake3::keyed_hash(&key.0, payload).as_bytes()
}
