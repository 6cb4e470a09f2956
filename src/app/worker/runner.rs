//! A thread that does the newest thing asked of it: older work is cancelled, a panic is reported and survived.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::base::Cancel;

/// What a worker hands to its work besides the job.
pub struct Desk<'a, J> {
    /// Set as soon as newer work is there.
    pub cancel: &'a Cancel,
    mailbox: &'a Mailbox<J>,
}

impl<J> Desk<'_, J> {
    /// Waits a little for newer work; whether the present one is still the newest.
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

/// The handle of the thread. Dropping it cancels the work; the thread ends by itself at its next look at the flag.
pub struct Worker<J> {
    mailbox: Arc<Mailbox<J>>,
    thread: Option<JoinHandle<()>>,
}

impl<J: Send + 'static> Worker<J> {
    /// `threads`: what it computes on, 0 for all cores. `start` makes what the work keeps between jobs (anew after a panic); `work` does a job; `panicked` is told.
    pub fn spawn<S: Send + 'static>(
        name: &str,
        threads: usize,
        start: impl Fn() -> S + Send + 'static,
        work: impl Fn(&mut S, J, &Desk<J>) + Send + Sync + 'static,
        panicked: impl Fn(String) + Send + 'static,
    ) -> std::io::Result<Self> {
        let state = State { job: None, running: None, closed: false };
        let mailbox = Arc::new(Mailbox { state: Mutex::new(state), changed: Condvar::new() });
        let inside = mailbox.clone();
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            let mut kept = start();
            // A pool of its own: what others compute does not stand in its way.
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok();
            while let Some((job, cancel)) = next(&inside) {
                let desk = Desk { cancel: &cancel, mailbox: &inside };
                let work = || match &pool {
                    Some(pool) => pool.install(|| work(&mut kept, job, &desk)),
                    None => work(&mut kept, job, &desk),
                };
                if let Err(panic) = catch_unwind(AssertUnwindSafe(work)) {
                    panicked(message(panic.as_ref()));
                    kept = start();
                }
                inside.lock().running = None;
            }
        })?;
        Ok(Self { mailbox, thread: Some(thread) })
    }

    /// Asks for a job in place of all that was asked before.
    pub fn ask(&self, job: J) {
        let mut state = self.mailbox.lock();
        state.job = Some(job);
        if let Some(cancel) = &state.running {
            cancel.set();
        }
        self.mailbox.changed.notify_all();
    }

    /// Gives up all work and waits for the thread to end, no longer than this.
    pub fn finish(mut self, longest: Duration) {
        self.close();
        let Some(thread) = self.thread.take() else { return };
        let start = Instant::now();
        while !thread.is_finished() && start.elapsed() < longest {
            std::thread::sleep(Duration::from_millis(2));
        }
        if thread.is_finished() {
            // A panic inside was reported already.
            let _ = thread.join();
        }
    }

    /// Gives up what is being done and what waits.
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
    fn a_worker_that_panics_says_so_and_does_the_next_job_with_a_fresh_state() {
        let (to_us, answers) = mpsc::channel();
        let told = to_us.clone();
        let worker = Worker::spawn(
            "test",
            1,
            || 0_u32,
            move |kept: &mut u32, job: u32, _: &Desk<u32>| {
                *kept += 1;
                assert!(job != 7, "job seven fails");
                let _ = to_us.send(format!("job {job}, {kept} since the start"));
            },
            move |text| drop(told.send(format!("fault: {text}"))),
        )
        .unwrap();
        let ask = |job: u32| {
            worker.ask(job);
            answers.recv_timeout(Duration::from_secs(20)).unwrap()
        };
        assert_eq!(ask(1), "job 1, 1 since the start");
        assert_eq!(ask(2), "job 2, 2 since the start");
        assert!(ask(7).starts_with("fault: job seven fails"));
        // What the panic left half done is gone.
        assert_eq!(ask(3), "job 3, 1 since the start");
        // A panic inside of the worker's own threads is one too.
        worker.finish(Duration::from_secs(4));
    }
}
