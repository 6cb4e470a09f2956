//! Stages: pure functions from inputs to one output, identified by the key of everything that they depend on.

use std::any::Any;
use std::collections::HashMap;
use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::Env;
use crate::base::Result;
use crate::cache::{Cache, Key, KeyBuilder, Reader, Stored, Writer};

/// Milliseconds of the stages that ran, in the order of their first runs. A stage whose result was known is not listed.
pub type StageTimes = Vec<(&'static str, f64)>;

/// Adds the time since `start` to that of a stage. Refinement runs a stage more than once.
pub(super) fn add_time(times: &mut StageTimes, stage: &'static str, start: Instant) {
    match times.iter_mut().find(|(name, _)| *name == stage) {
        Some((_, ms)) => *ms += elapsed_ms(start),
        None => times.push((stage, elapsed_ms(start))),
    }
}

/// A pure function of settings and of the results of earlier stages.
pub trait Stage {
    type Output: Send + Sync + 'static;
    /// The name in times and JSON.
    const NAME: &'static str;
    /// The functions that store the output on disk; `None` if it never is stored.
    const CODEC: Option<Codec<Self::Output>> = None;

    /// Adds the settings of this stage and the keys of its inputs. Files count by their content.
    fn hash_into(&self, key: &mut KeyBuilder);

    /// Computes the output. `env` never decides a result.
    ///
    /// # Errors
    /// A file that cannot be used, a computation that fails, or [`crate::base::Error::Cancelled`].
    fn run(&self, env: &Env) -> Result<Self::Output>;

    /// True if `run` never returns early on cancellation. Its output is then stored even if the operation was cancelled.
    const IGNORES_CANCEL: bool = false;

    /// The entry in the memo. Two entries keep two results of one stage that different callers need in turns.
    fn slot(&self) -> &'static str {
        Self::NAME
    }

    /// Returns true if an output of this stage may be read from disk and written there.
    fn may_be_stored(&self) -> bool {
        true
    }

    /// Returns true if a stored output has the shape that the inputs call for.
    fn accepts(&self, _: &Self::Output) -> bool {
        true
    }
}

/// The functions that write an output to disk and read it back, bit for bit.
pub struct Codec<T> {
    write: fn(&T, &mut Writer),
    read: fn(&mut Reader<'_>) -> Option<T>,
    /// The name in times of an output that was read.
    cached_name: &'static str,
}

impl<T: Stored> Codec<T> {
    pub const fn new(cached_name: &'static str) -> Self {
        Self { write: T::write, read: T::read, cached_name }
    }
}

/// A result and the key of everything that it depends on.
#[derive(Debug)]
pub struct Keyed<T> {
    pub key: Key,
    pub value: Arc<T>,
}

impl<T> Clone for Keyed<T> {
    fn clone(&self) -> Self {
        Self { key: self.key, value: self.value.clone() }
    }
}

impl<T> Deref for Keyed<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

/// The last result of each stage, by the stage's name.
#[derive(Debug, Default)]
pub(super) struct Memo(Mutex<HashMap<&'static str, Slot>>);

#[derive(Debug)]
struct Slot {
    key: Key,
    /// Absent once it was freed.
    value: Option<Arc<dyn Any + Send + Sync>>,
    runs: u64,
}

impl Memo {
    fn get<T: Send + Sync + 'static>(&self, name: &'static str, key: Key) -> Option<Arc<T>> {
        let slots = lock(&self.0);
        let slot = slots.get(name).filter(|slot| slot.key == key)?;
        slot.value.clone()?.downcast().ok()
    }

    fn put<T: Send + Sync + 'static>(&self, name: &'static str, key: Key, value: &Arc<T>) {
        let mut slots = lock(&self.0);
        let runs = slots.get(name).map_or(0, |slot| slot.runs) + 1;
        let old = slots.insert(name, Slot { key, value: Some(value.clone()), runs });
        drop(slots);
        drop(old);
    }

    /// The number of times that a stage ran or was read from disk.
    pub(super) fn runs(&self, name: &str) -> u64 {
        lock(&self.0).get(name).map_or(0, |slot| slot.runs)
    }

    /// Returns the memoized output of a stage, or computes it. A cancelled stage is not stored.
    pub(super) fn get_or_run<S: Stage>(
        &self,
        stage: &S,
        env: &Env,
        disk: &Cache,
        times: &mut StageTimes,
    ) -> Result<Keyed<S::Output>> {
        let key = key_of(stage);
        if let Some(value) = self.get(stage.slot(), key) {
            return Ok(Keyed { key, value });
        }
        let value = Arc::new(compute(stage, key, env, disk, times)?);
        self.put(stage.slot(), key, &value);
        env.cancel.check()?;
        Ok(Keyed { key, value })
    }

    /// The memoized output of a stage.
    pub(super) fn known<S: Stage>(&self, stage: &S) -> Option<Arc<S::Output>> {
        self.get(stage.slot(), key_of(stage))
    }

    /// Frees the memoized output of a stage.
    pub(super) fn forget(&self, name: &str) {
        let value = lock(&self.0).get_mut(name).and_then(|slot| slot.value.take());
        // The value is dropped after the lock is released.
        drop(value);
    }
}

/// The key of everything that the output of a stage depends on.
pub(super) fn key_of<S: Stage>(stage: &S) -> Key {
    let mut key = KeyBuilder::of_stage(S::NAME);
    stage.hash_into(&mut key);
    key.finish()
}

/// Reads the output of a stage from disk, or runs the stage and stores the output if that took long enough.
fn compute<S: Stage>(stage: &S, key: Key, env: &Env, disk: &Cache, times: &mut StageTimes) -> Result<S::Output> {
    env.cancel.check()?;
    let start = Instant::now();
    let stored = S::CODEC.filter(|_| stage.may_be_stored()).map(|codec| (codec, disk.entry_of(key)));
    if let Some((codec, entry)) = &stored
        && let Some(value) = entry.read(codec.read).filter(|value| stage.accepts(value))
    {
        add_time(times, codec.cached_name, start);
        return Ok(value);
    }
    env.cancel.begin(S::NAME);
    let result = stage.run(env);
    env.cancel.end();
    let value = result?;
    if !S::IGNORES_CANCEL {
        // A cancelled stage may have returned anything.
        env.cancel.check()?;
    }
    add_time(times, S::NAME, start);
    if let Some((codec, entry)) = &stored {
        entry.store(start, &value, codec.write);
    }
    Ok(value)
}

/// Runs a stage whose output is not memoized, only cached on disk.
pub(super) fn run_without_memo<S: Stage>(
    stage: &S,
    env: &Env,
    disk: &Cache,
    times: &mut StageTimes,
) -> Result<S::Output> {
    compute(stage, key_of(stage), env, disk, times)
}

pub(super) fn elapsed_ms(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
