//! A stage of the pipeline: its last result, and what it was made from.

use std::sync::Arc;
use std::time::Instant;

use super::StageTimes;
use crate::base::{Cancel, Result};

/// Counts the results that a stage has made.
pub(super) type Version = u64;

/// A stage's last result and the key it was made from.
///
/// The key holds the versions of all upstream results it was made from. (A flag "upstream is new" will not do: whoever
/// asks for the mesh or the materials alone, as the reference does, would swallow it.)
#[derive(Debug)]
pub(super) struct Stage<K, T> {
    last: Option<(K, Arc<T>)>,
    /// Counts the results made.
    version: Version,
}

impl<K, T> Default for Stage<K, T> {
    fn default() -> Self {
        Self { last: None, version: 0 }
    }
}

impl<K, T> Stage<K, T> {
    /// How often the stage ran.
    pub(super) fn runs(&self) -> u64 {
        self.version
    }
}

impl<K: PartialEq, T> Stage<K, T> {
    /// The last result if `key` is the same, else a new one, timed; with its version.
    pub(super) fn get(
        &mut self,
        name: &'static str,
        key: K,
        times: &mut StageTimes,
        cancel: &Cancel,
        make: impl FnOnce() -> Result<T>,
    ) -> Result<(Arc<T>, Version)> {
        if let Some((last, value)) = &self.last
            && *last == key
        {
            return Ok((value.clone(), self.version));
        }
        cancel.check()?;
        let start = Instant::now();
        let value = Arc::new(make()?);
        // A stage that was told to stop may have made anything.
        cancel.check()?;
        times.push((name, start.elapsed().as_secs_f64() * 1e3));
        self.last = Some((key, value.clone()));
        self.version += 1;
        Ok((value, self.version))
    }
}
