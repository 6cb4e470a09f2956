//! Cancellation of long operations.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::{Error, Result};

/// A flag that a long operation checks between its steps. Clones share the flag.
#[derive(Debug, Clone, Default)]
pub struct Cancel {
    flag: Arc<AtomicBool>,
    /// Until this moment the flag counts as not set.
    not_before: Option<Instant>,
}

impl Cancel {
    /// Sets the flag. The caller must not use what the operation returns after this.
    pub fn set(&self) {
        self.flag.store(true, Ordering::Relaxed);
    }

    pub fn is_set(&self) -> bool {
        self.flag.load(Ordering::Relaxed) && self.not_before.is_none_or(|moment| Instant::now() >= moment)
    }

    /// Returns a clone for which the flag counts only after `delay` from now.
    pub fn after(&self, delay: Duration) -> Self {
        Self { flag: self.flag.clone(), not_before: Instant::now().checked_add(delay) }
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
}
