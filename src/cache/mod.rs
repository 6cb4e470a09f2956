//! A disk cache of expensive results, addressed by a hash of their inputs.
//!
//! ```text
//! inputs of a stage ─▶ Key ─▶ Entry ─┬▶ read: the file of that name, bit for bit
//!                                    └▶ run the stage, then store: a thread writes the file
//! ```
//! The cache never changes a result: without a cache (the default) the program computes the same bits. The folder may be
//! deleted at any time. A file is valid for one build of the program on one kind of processor ([`Build`]). The total size
//! of all files is limited.

mod background_writer;
mod build;
mod folder;
mod key;
mod payload;
mod store;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use self::background_writer::BackgroundWriter;
pub use self::build::Build;
pub use self::folder::default_folder;
pub use self::key::{Key, KeyBuilder};
pub use self::payload::{Reader, Stored, Writer};
use self::store::Store;
pub use self::store::Usage;

/// Largest total size of all files, in bytes.
pub const MAX_BYTES: u64 = 512 << 20;

/// Shortest computation whose result is written. Reading a result takes some milliseconds (`cargo bench --bench measure --
/// cache-costs`).
const MIN_DURATION: Duration = Duration::from_millis(100);

/// A folder of results, or none. Clones share the folder. The default stores nothing.
#[derive(Debug, Clone, Default)]
pub struct Cache {
    open: Option<Arc<Open>>,
}

#[derive(Debug)]
struct Open {
    store: Arc<Store>,
    writer: BackgroundWriter,
    min_duration: Duration,
}

impl Cache {
    /// Returns a cache that stores and finds nothing.
    pub fn off() -> Self {
        Self::default()
    }

    /// Returns a cache of this program's results in a folder, which need not exist.
    pub fn at(folder: &Path) -> Self {
        Self::of(folder, MAX_BYTES, MIN_DURATION)
    }

    fn of(folder: &Path, max_bytes: u64, min_duration: Duration) -> Self {
        let store = Arc::new(Store::new(folder.to_owned(), max_bytes));
        let writer = BackgroundWriter::new(store.clone());
        Self { open: Some(Arc::new(Open { store, writer, min_duration })) }
    }

    /// Returns a cache that stores every result, in at most `max_bytes` bytes.
    #[cfg(test)]
    pub(crate) fn of_everything(folder: &Path, max_bytes: u64) -> Self {
        Self::of(folder, max_bytes, Duration::ZERO)
    }

    pub fn folder(&self) -> Option<PathBuf> {
        self.open.as_ref().map(|open| open.store.folder().to_owned())
    }

    /// The place of the result with a key.
    pub fn entry_of(&self, key: Key) -> Entry<'_> {
        Entry(self.open.as_deref().map(|open| (open, key)))
    }

    /// Waits until all results are written. Returns the first error; a failed write does not affect results.
    pub fn finish(&self) -> Option<String> {
        self.open.as_ref().and_then(|open| open.writer.finish())
    }

    /// Number and size of the files in the folder, of all builds.
    pub fn usage(&self) -> Usage {
        self.open.as_ref().map(|open| open.store.usage()).unwrap_or_default()
    }

    /// Removes all files of the cache and returns their number and size. Other files in the folder stay.
    pub fn clear(&self) -> Usage {
        self.open.as_ref().map(|open| open.store.clear()).unwrap_or_default()
    }
}

/// The place of one result, if the cache is on.
#[derive(Debug)]
pub struct Entry<'a>(Option<(&'a Open, Key)>);

impl Entry<'_> {
    /// Reads the cached result. A file with another content is removed.
    pub fn read<T>(&self, read: fn(&mut Reader<'_>) -> Option<T>) -> Option<T> {
        let (open, key) = self.0.as_ref()?;
        let payload = open.store.read(key)?;
        let mut reader = Reader::new(&payload);
        let result = read(&mut reader).filter(|_| reader.is_at_end());
        if result.is_none() {
            open.store.remove(key);
        }
        result
    }

    /// Stores a result whose computation began at `start`, if it took long enough. Another thread writes the file.
    pub fn store<T>(&self, start: Instant, result: &T, write: fn(&T, &mut Writer)) {
        if let Some((open, key)) = self.0.as_ref().filter(|(open, _)| start.elapsed() >= open.min_duration) {
            let mut payload = Writer::default();
            write(result, &mut payload);
            open.writer.submit(*key, payload.into_bytes());
        }
    }
}
