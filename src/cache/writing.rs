//! Files are written behind whoever made the results, and before the program ends.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};

use super::Key;
use super::store::Store;

/// Results that wait to be written; further ones are not kept.
const WAITING: usize = 16;

type Job = (Key, Vec<u8>);

/// One thread, started by the first result; waited for when the last owner goes.
#[derive(Debug)]
pub(super) struct Writing {
    store: Arc<Store>,
    thread: Mutex<Option<(SyncSender<Job>, JoinHandle<()>)>>,
    trouble: Arc<Mutex<Option<String>>>,
}

impl Writing {
    pub(super) fn new(store: Arc<Store>) -> Self {
        Self { store, thread: Mutex::default(), trouble: Arc::default() }
    }

    /// Returns at once. Where the system gives no thread, or writing falls behind, nothing is kept.
    pub(super) fn ask(&self, key: Key, payload: Vec<u8>) {
        let mut thread = lock(&self.thread);
        if thread.is_none() {
            let (sender, receiver) = sync_channel(WAITING);
            let (store, trouble) = (self.store.clone(), self.trouble.clone());
            let started = Builder::new().name("cache".to_owned()).spawn(move || write_all(&store, &trouble, &receiver));
            *thread = started.ok().map(|handle| (sender, handle));
        }
        if let Some((sender, _)) = &*thread {
            let _ = sender.try_send((key, payload));
        }
    }

    /// Waits until all is written; says what the first failure was.
    pub(super) fn finish(&self) -> Option<String> {
        let thread = lock(&self.thread).take();
        if let Some((sender, handle)) = thread {
            drop(sender);
            let _ = handle.join();
        }
        lock(&self.trouble).clone()
    }
}

impl Drop for Writing {
    fn drop(&mut self) {
        self.finish();
    }
}

fn write_all(store: &Store, trouble: &Mutex<Option<String>>, jobs: &Receiver<Job>) {
    for (key, payload) in jobs {
        if let Err(error) = store.write(&key, &payload) {
            lock(trouble).get_or_insert_with(|| format!("{}: {error}", store.folder().display()));
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
