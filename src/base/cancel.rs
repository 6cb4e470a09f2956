//! Giving up work whose result nobody waits for any more.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::{Error, Result};

/// A flag that long work looks at between its parts. Clones share it; the default is never set by anyone else.
#[derive(Debug, Clone, Default)]
pub struct Cancel {
    flag: Arc<AtomicBool>,
    /// Before this the flag counts as not set.
    not_before: Option<Instant>,
}

impl Cancel {
    /// Asks the work to stop. What it returns after that is not to be used.
    pub fn set(&self) {
        self.flag.store(true, Ordering::Relaxed);
    }

    pub fn is_set(&self) -> bool {
        self.flag.load(Ordering::Relaxed) && self.not_before.is_none_or(|moment| Instant::now() >= moment)
    }

    /// The same flag for work that is only given up once it has taken `patience` from now on.
    pub fn after(&self, patience: Duration) -> Self {
        Self { flag: self.flag.clone(), not_before: Instant::now().checked_add(patience) }
    }

    /// # Errors
    /// [`Error::Cancelled`] once the flag is set.
    pub fn check(&self) -> Result<()> {
        if self.is_set() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patient_work_is_given_up_only_after_its_time_and_shares_the_flag() {
        let cancel = Cancel::default();
        let (long, short) = (cancel.after(Duration::from_secs(3600)), cancel.after(Duration::ZERO));
        assert!(!short.is_set());
        cancel.set();
        assert!(cancel.is_set() && short.is_set() && !long.is_set());
        assert!(short.check().is_err() && long.check().is_ok());
    }
}
