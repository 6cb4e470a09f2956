//! Results that take long to make, kept on disk by the content of what they were made from.
//!
//! ```text
//! inputs of a stage ─▶ Key ─▶ Entry ─┬▶ read: the file of that name, bit for bit
//!                                    └▶ the stage itself, then keep: the file is written behind it
//! ```
//! Nothing here decides a result: without a cache (the default) the same bits are made. The folder may be deleted at any time.
//! Files hold what one build of the program makes on one kind of processor ([`Build`]), and are bounded in sum.

mod build;
mod folder;
mod key;
mod payload;
mod store;
#[cfg(test)]
mod tests;
mod writing;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

pub use self::build::Build;
pub use self::folder::usual_folder;
pub use self::key::{Key, KeyBuilder};
pub use self::payload::{Reader, Stored, Writer};
use self::store::Store;
pub use self::store::Usage;
use self::writing::Writing;

/// Bytes that all files together may take.
pub const MAX: u64 = 512 << 20;

/// What is made sooner than this is not written: reading it back takes some milliseconds.
const WORTH_KEEPING: Duration = Duration::from_millis(100);

/// A folder of results, or none. Clones share it; the default keeps nothing.
#[derive(Debug, Clone, Default)]
pub struct Cache {
    open: Option<Arc<Open>>,
}

#[derive(Debug)]
struct Open {
    store: Arc<Store>,
    writing: Writing,
    build: Build,
    worth_keeping: Duration,
}

impl Cache {
    /// Keeps nothing, finds nothing.
    pub fn off() -> Self {
        Self::default()
    }

    /// Results of this program in a folder, which need not exist yet. Off where the system does not tell which build of the
    /// program this is.
    pub fn at(folder: &Path) -> Self {
        match Build::of_this_program() {
            Some(build) => Self::of(build, folder, MAX, WORTH_KEEPING),
            None => Self::off(),
        }
    }

    fn of(build: Build, folder: &Path, largest: u64, worth_keeping: Duration) -> Self {
        let store = Arc::new(Store::new(folder.to_owned(), largest));
        let writing = Writing::new(store.clone());
        Self { open: Some(Arc::new(Open { store, writing, build, worth_keeping })) }
    }

    /// Keeps whatever is made, however soon, in at most `largest` bytes.
    #[cfg(test)]
    pub(crate) fn of_everything(folder: &Path, largest: u64) -> Self {
        Build::of_this_program().map_or_else(Self::off, |build| Self::of(build, folder, largest, Duration::ZERO))
    }

    pub fn folder(&self) -> Option<PathBuf> {
        self.open.as_ref().map(|open| open.store.folder().to_owned())
    }

    /// The place of a result of the stage `kind` in all that `inputs` tells.
    pub fn entry(&self, kind: &str, inputs: impl FnOnce(&mut KeyBuilder)) -> Entry<'_> {
        Entry(self.open.as_deref().map(|open| {
            let mut key = KeyBuilder::new(kind, &open.build);
            inputs(&mut key);
            (open, key.finish())
        }))
    }

    /// Waits for what is still being written. Says why, where something could not be: results are as good without.
    pub fn finish(&self) -> Option<String> {
        self.open.as_ref().and_then(|open| open.writing.finish())
    }

    /// Files and bytes in the folder, of any build.
    pub fn usage(&self) -> Usage {
        self.open.as_ref().map(|open| open.store.usage()).unwrap_or_default()
    }

    /// Removes all that a cache ever wrote, and tells what that was. Other files in the folder stay.
    pub fn clear(&self) -> Usage {
        self.open.as_ref().map(|open| open.store.clear()).unwrap_or_default()
    }
}

/// Where one result is kept, if anything is.
#[derive(Debug)]
pub struct Entry<'a>(Option<(&'a Open, Key)>);

impl Entry<'_> {
    /// What was kept; a file that holds no such result is removed.
    pub fn read<T: Stored>(&self) -> Option<T> {
        let (open, key) = self.0.as_ref()?;
        let payload = open.store.read(key)?;
        let mut reader = Reader::new(&payload);
        let kept = T::read(&mut reader).filter(|_| reader.is_at_end());
        if kept.is_none() {
            open.store.remove(key);
        }
        kept
    }

    /// Keeps what took from `start` until now, if that is worth it; writing goes on behind.
    pub fn keep(&self, start: Instant, made: &impl Stored) {
        if let Some((open, key)) = self.0.as_ref().filter(|(open, _)| start.elapsed() >= open.worth_keeping) {
            let mut payload = Writer::default();
            made.write(&mut payload);
            open.writing.ask(*key, payload.into_bytes());
        }
    }
}
