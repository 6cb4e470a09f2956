//! A thread that writes cached results to files while the program continues.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};

use super::Key;
use super::store::Store;

/// Largest number of results that wait to be written; further results are not cached.
const MAX_WAITING: usize = 16;

type Job = (Key, Vec<u8>);

/// A thread that the first result starts. Dropping the last owner waits for the thread.
#[derive(Debug)]
pub(super) struct BackgroundWriter {
    store: Arc<Store>,
    thread: Mutex<Option<(SyncSender<Job>, JoinHandle<()>)>>,
    first_error: Arc<Mutex<Option<String>>>,
}

impl BackgroundWriter {
    pub(super) fn new(store: Arc<Store>) -> Self {
        Self { store, thread: Mutex::default(), first_error: Arc::default() }
    }

    /// Submits a result and returns at once. The result is dropped if no thread can be started or too many results
    /// wait.
    pub(super) fn submit(&self, key: Key, payload: Vec<u8>) {
        let mut thread = lock(&self.thread);
        if thread.is_none() {
            let (sender, receiver) = sync_channel(MAX_WAITING);
            let (store, first_error) = (self.store.clone(), self.first_error.clone());
            let started =
                Builder::new().name("cache".to_owned()).spawn(move || write_all(&store, &first_error, &receiver));
            *thread = started.ok().map(|handle| (sender, handle));
        }
        if let Some((sender, _)) = &*thread {
            let _ = sender.try_send((key, payload));
        }
    }

    /// Waits until all results are written. Returns the first error.
    pub(super) fn finish(&self) -> Option<String> {
        let thread = lock(&self.thread).take();
        if let Some((sender, handle)) = thread {
            drop(sender);
            let _ = handle.join();
        }
        lock(&self.first_error).clone()
    }
}

impl Drop for BackgroundWriter {
    fn drop(&mut self) {
        self.finish();
    }
}

fn write_all(store: &Store, first_error: &Mutex<Option<String>>, jobs: &Receiver<Job>) {
    for (key, payload) in jobs {
        if let Err(error) = store.write(&key, &payload) {
            lock(first_error).get_or_insert_with(|| format!("{}: {error}", store.folder().display()));
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
