//! A thread that runs the newest submitted job. A new job cancels older ones. After a panic, the thread reports it and
//! continues.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use thread_priority::{ThreadPriority, set_current_thread_priority};

use crate::base::{Cancel, Running, threads};

/// The threads of a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Threads {
    /// One per core.
    All,
    /// One per core, with a lower priority: they run while other threads leave the cores idle, and little at other times.
    AllInBackground,
    One,
    /// A single one with a lower priority.
    OneInBackground,
}

/// The lower priority, on a scale from 0 to 99. On Linux, such a thread gets about a tenth of a core that another one uses
/// (nice 11).
const BACKGROUND: u8 = 20;

impl Threads {
    fn count(self) -> usize {
        if matches!(self, Self::One | Self::OneInBackground) { 1 } else { threads::requested() }
    }

    /// Gives the calling thread its priority.
    fn set_priority(self) {
        if matches!(self, Self::AllInBackground | Self::OneInBackground)
            && let Ok(priority) = BACKGROUND.try_into()
        {
            // A system that does not allow it runs the thread as any other.
            let _ = set_current_thread_priority(ThreadPriority::Crossplatform(priority));
        }
    }
}

/// Context of a job: its cancel flag and the queue that it came from.
pub struct JobContext<'a, J> {
    /// Set as soon as a newer job is submitted.
    pub cancel: &'a Cancel,
    mailbox: &'a Mailbox<J>,
}

impl<J> JobContext<'_, J> {
    /// Waits up to `pause` for a newer job; returns true if the current job is still the newest.
    pub fn is_newest_after(&self, pause: Duration) -> bool {
        let state = self.mailbox.lock();
        let waited =
            self.mailbox.changed.wait_timeout_while(state, pause, |state| state.job.is_none() && !state.closed);
        let state = waited.map_or_else(|poisoned| poisoned.into_inner().0, |(state, _)| state);
        state.job.is_none() && !state.closed
    }
}

struct State<J> {
    job: Option<J>,
    running: Option<Cancel>,
    closed: bool,
}

struct Mailbox<J> {
    state: Mutex<State<J>>,
    changed: Condvar,
}

impl<J> Mailbox<J> {
    fn lock(&self) -> MutexGuard<'_, State<J>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The handle of the thread. Dropping it cancels the work; the thread ends when it next checks the flag.
pub struct Worker<J> {
    mailbox: Arc<Mailbox<J>>,
    thread: Option<JoinHandle<()>>,
}

impl<J: Send + 'static> Worker<J> {
    /// Starts the thread.
    ///
    /// `threads` are those of its thread pool, whose priority the thread has as well. `start` creates the state that jobs
    /// share, and does so again after a panic. `work` runs a job, and `panicked` receives the message of a panic.
    pub fn spawn<S: Send + 'static>(
        name: &str,
        threads: Threads,
        start: impl Fn() -> S + Send + 'static,
        work: impl Fn(&mut S, J, &JobContext<J>) + Send + Sync + 'static,
        panicked: impl Fn(String) + Send + 'static,
    ) -> std::io::Result<Self> {
        let state = State { job: None, running: None, closed: false };
        let mailbox = Arc::new(Mailbox { state: Mutex::new(state), changed: Condvar::new() });
        let inside = mailbox.clone();
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            threads.set_priority();
            let mut state = start();
            // A separate pool, so that other workers do not block this one.
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.count());
            let pool = pool.start_handler(move |_| threads.set_priority()).build().ok();
            while let Some((job, cancel)) = next(&inside) {
                let context = JobContext { cancel: &cancel, mailbox: &inside };
                let work = || match &pool {
                    Some(pool) => pool.install(|| work(&mut state, job, &context)),
                    None => work(&mut state, job, &context),
                };
                if let Err(panic) = catch_unwind(AssertUnwindSafe(work)) {
                    panicked(message(panic.as_ref()));
                    state = start();
                }
                inside.lock().running = None;
            }
        })?;
        Ok(Self { mailbox, thread: Some(thread) })
    }

    /// Submits a job that replaces all earlier ones.
    pub fn submit(&self, job: J) {
        let mut state = self.mailbox.lock();
        state.job = Some(job);
        if let Some(cancel) = &state.running {
            cancel.set();
        }
        self.mailbox.changed.notify_all();
    }

    /// Cancels all work and waits at most `longest` for the thread to end.
    pub fn finish(mut self, longest: Duration) {
        self.close();
        let Some(thread) = self.thread.take() else { return };
        let start = Instant::now();
        while !thread.is_finished() && start.elapsed() < longest {
            std::thread::sleep(Duration::from_millis(2));
        }
        if thread.is_finished() {
            // A panic inside the thread was reported already.
            let _ = thread.join();
        }
    }

    /// Cancels the running job and drops the waiting one.
    pub fn cancel(&self) {
        let mut state = self.mailbox.lock();
        state.job = None;
        if let Some(cancel) = &state.running {
            cancel.set();
        }
    }
}

fn next<J>(mailbox: &Mailbox<J>) -> Option<(J, Cancel)> {
    let mut state = mailbox.lock();
    loop {
        if state.closed {
            return None;
        }
        if let Some(job) = state.job.take() {
            let cancel = Cancel::default();
            state.running = Some(cancel.clone());
            return Some((job, cancel));
        }
        state = mailbox.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
    }
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".to_owned())
}

impl<J> Worker<J> {
    /// The computation of the running job.
    pub fn running(&self) -> Option<Running> {
        self.mailbox.lock().running.as_ref().and_then(Cancel::running)
    }

    fn close(&self) {
        let mut state = self.mailbox.lock();
        state.closed = true;
        if let Some(cancel) = &state.running {
            cancel.set();
        }
        self.mailbox.changed.notify_all();
    }
}

impl<J> Drop for Worker<J> {
    fn drop(&mut self) {
        self.close();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    #[test]
    fn a_worker_that_panics_reports_it_and_runs_the_next_job_with_a_fresh_state() {
        let (sender, results) = mpsc::channel();
        let report_fault = sender.clone();
        let worker = Worker::spawn(
            "test",
            Threads::OneInBackground,
            || 0_u32,
            move |state: &mut u32, job: u32, _: &JobContext<u32>| {
                *state += 1;
                assert!(job != 7, "job seven fails");
                let _ = sender.send(format!("job {job}, {state} since the start"));
            },
            move |text| drop(report_fault.send(format!("fault: {text}"))),
        )
        .unwrap();
        let run = |job: u32| {
            worker.submit(job);
            results.recv_timeout(Duration::from_secs(20)).unwrap()
        };
        assert_eq!(run(1), "job 1, 1 since the start");
        assert_eq!(run(2), "job 2, 2 since the start");
        assert!(run(7).starts_with("fault: job seven fails"));
        // The state that the panic left is discarded.
        assert_eq!(run(3), "job 3, 1 since the start");
        // The thread that panicked can still be joined.
        worker.finish(Duration::from_secs(4));
    }
}
