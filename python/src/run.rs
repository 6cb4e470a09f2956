//! Calls into the library: without the interpreter's lock, on threads that survive a fork, and stopped by Ctrl-C.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::Result as Unwound;
use std::time::Duration;

use biscale::Cancel;
use biscale::base::threads;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::{self, OrRaise};

/// Interval between two looks at signals and at the progress.
const INTERVAL: Duration = Duration::from_millis(20);
/// Stack of the threads. Work that runs on the main thread of the program runs on them here.
const STACK: usize = 8 << 20;

/// The threads of this process.
struct Engine {
    process: u32,
    pool: ThreadPool,
    /// Held by calls that compute results that later calls share. While such a call waits for parallel work, its thread may begin
    /// another call, which must not wait for the first one.
    exclusive: Mutex<()>,
}

static ENGINE: Mutex<Option<Arc<Engine>>> = Mutex::new(None);

/// The threads of this process. A process that was forked has none, so that it starts its own.
fn engine() -> anyhow::Result<Arc<Engine>> {
    let mut engine = ENGINE.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some(engine) = engine.as_ref().filter(|engine| engine.process == process) {
        return Ok(engine.clone());
    }
    // Dropping the pool would wait for threads that only the parent has.
    std::mem::forget(engine.take());
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads::requested())
        .stack_size(STACK)
        .thread_name(|k| format!("biscale-{k}"))
        .build()?;
    let new = Arc::new(Engine { process, pool, exclusive: Mutex::new(()) });
    *engine = Some(new.clone());
    Ok(new)
}

/// State that a call shares with the thread that waits for it.
#[derive(Default)]
pub struct Job {
    pub cancel: Cancel,
    /// Bits of the completed fraction that the work reported.
    reported: AtomicU32,
    /// Bits of the largest fraction that the caller was told. Stages count from 0; the fraction of the call does not fall.
    told: AtomicU32,
}

impl Job {
    /// A progress function for the library.
    pub fn progress(&self) -> impl Fn(f32) -> bool + Sync {
        |part| {
            self.reported.store(part.to_bits(), Ordering::Relaxed);
            !self.cancel.is_set()
        }
    }

    /// The completed fraction.
    fn part(&self) -> f32 {
        let part = match self.cancel.running() {
            Some(running) if running.all > 0 => running.done as f32 / running.all as f32,
            _ => f32::from_bits(self.reported.load(Ordering::Relaxed)),
        };
        // The bits of positive numbers are in the order of the numbers.
        let bits = part.clamp(0.0, 1.0).to_bits();
        f32::from_bits(self.told.fetch_max(bits, Ordering::Relaxed).max(bits))
    }

    /// Raises the exception of a signal, or calls the caller's progress function.
    fn poll(&self, progress: Option<&Py<PyAny>>) -> PyResult<()> {
        Python::attach(|py| {
            py.check_signals()?;
            let Some(progress) = progress else { return Ok(()) };
            let answer = progress.call1(py, (self.part(),))?;
            if !answer.is_none(py) && !answer.is_truthy(py)? {
                Err(biscale::Error::Cancelled).or_raise(py)
            } else {
                Ok(())
            }
        })
    }
}

/// Whether a call computes results that later calls share.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// It only reads results.
    Shared,
    /// It computes results that later calls read.
    Exclusive,
}

/// Runs `work` on the threads of the library. A signal or a progress function that returns false cancels it.
pub fn run<T: Send>(
    py: Python<'_>,
    access: Access,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Job) -> anyhow::Result<T> + Send,
) -> PyResult<T> {
    let progress = progress.map(|progress| progress.clone().unbind());
    let job = Job::default();
    let engine = engine().or_raise(py)?;
    let done: PyResult<Unwound<anyhow::Result<T>>> = py.detach(|| {
        let _guard = if access == Access::Exclusive { Some(wait_for_turn(&engine, &job)?) } else { None };
        let (sender, receiver) = sync_channel(1);
        engine.pool.in_place_scope(|scope| {
            scope.spawn(|_| {
                let _ = sender.send(catch_unwind(AssertUnwindSafe(|| work(&job))));
            });
            wait_for(&receiver, &job, progress.as_ref())
        })
    });
    match done? {
        Ok(result) => result.map_err(|error| errors::raised(py, &error)),
        Err(payload) => Err(errors::panicked(py, &*payload)),
    }
}

thread_local! {
    /// True on a thread that holds [`Engine::exclusive`].
    static HAS_TURN: Cell<bool> = const { Cell::new(false) };
}

/// The turn of an exclusive call.
struct Turn<'a> {
    _guard: MutexGuard<'a, ()>,
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        HAS_TURN.set(false);
    }
}

/// Waits until other exclusive calls have ended. A progress function that asks for a turn would wait for its own caller.
fn wait_for_turn<'a>(engine: &'a Engine, job: &Job) -> PyResult<Turn<'a>> {
    if HAS_TURN.get() {
        let text = "a progress function cannot start a computation: the one that calls it has not ended";
        return Err(PyRuntimeError::new_err(text));
    }
    let guard = loop {
        match engine.exclusive.try_lock() {
            Ok(guard) => break guard,
            Err(TryLockError::Poisoned(poisoned)) => break poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                std::thread::sleep(Duration::from_millis(1));
                job.poll(None)?;
            }
        }
    };
    HAS_TURN.set(true);
    Ok(Turn { _guard: guard })
}

fn wait_for<T>(receiver: &Receiver<T>, job: &Job, progress: Option<&Py<PyAny>>) -> PyResult<T> {
    let mut stopped = None;
    loop {
        match receiver.recv_timeout(INTERVAL) {
            Ok(done) => return stopped.map_or(Ok(done), Err),
            Err(RecvTimeoutError::Timeout) if stopped.is_none() => {
                if let Err(error) = job.poll(progress) {
                    job.cancel.set();
                    stopped = Some(error);
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                let lost = anyhow::anyhow!("a computation ended without a result");
                return Err(Python::attach(|py| errors::raised(py, &lost)));
            }
        }
    }
}
