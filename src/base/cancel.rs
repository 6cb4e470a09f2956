//! Cancellation of long operations, and how much of them is done.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::{Error, Result};

/// A flag that a long operation checks between its steps. Clones share the flag. The operation may also count its
/// steps, so that another thread can show what is done.
#[derive(Debug, Clone, Default)]
pub struct Cancel {
    flag: Arc<AtomicBool>,
    running: Arc<Mutex<Option<Running>>>,
    /// Until this moment the flag counts as not set.
    not_before: Option<Instant>,
}

/// The operation that runs.
#[derive(Debug, Clone, Copy)]
pub struct Running {
    pub name: &'static str,
    pub since: Instant,
    /// Number of steps that are done.
    pub done: usize,
    /// Number of all steps; 0 if the operation does not count them.
    pub all: usize,
}

impl Cancel {
    /// Notes that the operation `name` begins. [`Cancel::end`] ends it.
    pub fn begin(&self, name: &'static str) {
        *self.lock() = Some(Running { name, since: Instant::now(), done: 0, all: 0 });
    }

    /// Counts one of `all` equal steps of the operation.
    pub fn step(&self, all: usize) {
        if let Some(running) = self.lock().as_mut() {
            (running.done, running.all) = (running.done + 1, all);
        }
    }

    pub fn end(&self) {
        *self.lock() = None;
    }

    pub fn running(&self) -> Option<Running> {
        *self.lock()
    }

    fn lock(&self) -> MutexGuard<'_, Option<Running>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the flag. The caller must not use what the operation returns after this.
    pub fn set(&self) {
        self.flag.store(true, Ordering::Relaxed);
    }

    pub fn is_set(&self) -> bool {
        self.flag.load(Ordering::Relaxed) && self.not_before.is_none_or(|moment| Instant::now() >= moment)
    }

    /// Returns a clone for which the flag counts only after `delay` from now.
    pub fn after(&self, delay: Duration) -> Self {
        Self { not_before: Instant::now().checked_add(delay), ..self.clone() }
    }

    /// Calls `work` for every index in parallel and returns the results in order. The operation `name` counts blocks of
    /// indices.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn map<T: Clone + Default + Send>(
        &self,
        name: &'static str,
        count: usize,
        work: impl Fn(usize) -> T + Sync,
    ) -> Result<Vec<T>> {
        /// Indices per block.
        const BLOCK: usize = 64;
        self.begin(name);
        let mut results = vec![T::default(); count];
        results.par_chunks_mut(BLOCK).enumerate().for_each(|(block, results)| {
            for (k, result) in results.iter_mut().enumerate() {
                if self.is_set() {
                    return;
                }
                *result = work(block * BLOCK + k);
            }
            self.step(count.div_ceil(BLOCK));
        });
        self.end();
        self.check()?;
        Ok(results)
    }

    /// Returns an error if the flag is set.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn check(&self) -> Result<()> {
        if self.is_set() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delayed_clone_shares_the_flag_and_is_cancelled_only_after_its_delay() {
        let cancel = Cancel::default();
        let (long, short) = (cancel.after(Duration::from_secs(3600)), cancel.after(Duration::ZERO));
        assert!(!short.is_set());
        cancel.set();
        assert!(cancel.is_set() && short.is_set() && !long.is_set());
        assert!(short.check().is_err() && long.check().is_ok());
    }

    #[test]
    fn a_parallel_operation_returns_results_in_order_or_is_cancelled_between_two_of_them() {
        let cancel = Cancel::default();
        assert_eq!(cancel.map("squares", 1000, |k| k * k).unwrap(), (0..1000).map(|k| k * k).collect::<Vec<_>>());
        let stop = |k: usize| {
            if k == 10 {
                cancel.set();
            }
        };
        assert!(matches!(cancel.map("stopped", 1000, stop), Err(Error::Cancelled)));
        assert!(cancel.running().is_none());
    }

    #[test]
    fn steps_of_an_operation_are_counted_from_its_begin_to_its_end() {
        let cancel = Cancel::default();
        let counts = || cancel.running().map(|running| (running.name, running.done, running.all));
        cancel.step(9);
        assert_eq!(counts(), None, "no operation runs");
        cancel.begin("a");
        let clone = cancel.clone();
        (0..3).for_each(|_| clone.step(4));
        assert_eq!(counts(), Some(("a", 3, 4)));
        cancel.begin("b");
        assert_eq!(counts(), Some(("b", 0, 0)));
        cancel.end();
        assert_eq!(counts(), None);
    }
}
