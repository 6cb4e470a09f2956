//! Display of computations that take long: a progress bar on terminals, and a note with an estimate of the time.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::base::{Cancel, Running, print_on_stderr};
use indicatif::ProgressBar;

use super::progress_bar;

/// Interval between two checks of the computation.
const INTERVAL: Duration = Duration::from_millis(100);
/// A computation that takes longer is noted, with an estimate of its time.
const UNNOTED: Duration = Duration::from_secs(2);
/// A computation that counts no steps is noted without an estimate after this time.
const UNESTIMATED: Duration = Duration::from_secs(10);

/// Shows the operations of a [`Cancel`] as long as it exists.
pub struct Watch {
    cancel: Cancel,
    /// Ends the thread when it is dropped.
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Watch {
    /// Starts to watch. With `quiet`, nothing is shown.
    pub fn new(quiet: bool) -> Self {
        let cancel = Cancel::default();
        if quiet {
            return Self::unseen(cancel);
        }
        let (end, ended) = channel::<()>();
        let watched = cancel.clone();
        let show = move || {
            let mut shown = Shown::default();
            while ended.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
                shown.update(watched.running());
            }
            shown.update(None);
        };
        // Without a thread, nothing is shown.
        let thread = std::thread::Builder::new().name("watch".to_owned()).spawn(show).ok();
        Self { cancel, end: Some(end), thread }
    }

    /// Shows nothing, for a caller that reads `cancel` itself.
    pub fn unseen(cancel: Cancel) -> Self {
        Self { cancel, end: None, thread: None }
    }

    /// The handle that the watched computation takes.
    pub fn cancel(&self) -> Cancel {
        self.cancel.clone()
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.end = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The progress bar and the notes of the operation that runs.
#[derive(Default)]
struct Shown {
    bar: Option<(Running, ProgressBar)>,
    noted: Vec<&'static str>,
}

impl Shown {
    fn update(&mut self, running: Option<Running>) {
        let is_same = |bar: &(Running, ProgressBar)| running.is_some_and(|running| running.since == bar.0.since);
        if let Some((_, bar)) = self.bar.take_if(|bar| !is_same(bar)) {
            bar.finish_and_clear();
        }
        let Some(running) = running else { return };
        if running.since.elapsed() < UNNOTED {
            return;
        }
        let (_, bar) = self.bar.get_or_insert_with(|| (running, progress_bar(label(running.name), false)));
        bar.set_position(running.done as u64 * 1000 / running.all.max(1) as u64);
        if let Some(note) = note(&running).filter(|_| !self.noted.contains(&running.name)) {
            self.noted.push(running.name);
            bar.suspend(|| print_on_stderr(note));
        }
    }
}

/// The note on an operation that takes long, once its time can be estimated.
fn note(running: &Running) -> Option<String> {
    let elapsed = running.since.elapsed();
    let name = label(running.name);
    // Steps run in parallel, so that the time of the first ones says little.
    if running.done >= rayon::current_num_threads() {
        let seconds = elapsed.as_secs_f64() * running.all as f64 / running.done as f64;
        return Some(format!(
            "note: {name} takes about {seconds:.0} s; --quality draft or fewer quality.facets take less"
        ));
    }
    (elapsed > UNESTIMATED)
        .then(|| format!("note: {name} takes long; --quality draft or fewer quality.facets take less"))
}

/// The name of an operation in notes.
fn label(name: &'static str) -> &'static str {
    match name {
        "picture_table" => "the table that images read",
        "bases" | "rows" | "factors" => "the factorization",
        "pairs" => "the evaluation",
        name => name,
    }
}
