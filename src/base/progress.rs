//! Progress of long operations, reported to a function of the caller, which can stop the operation.

use rayon::prelude::*;

use super::{Error, Result};

/// Receives the completed fraction, 0 to 1, and returns false to stop the operation.
pub type Progress<'a> = dyn Fn(f32) -> bool + 'a;

/// Number of parallel items between two calls of the progress function.
const ITEMS_PER_REPORT: usize = 32;
/// Number of short sequential steps between two calls of the progress function.
const STEPS_PER_REPORT: usize = 4096;

/// Reports the completed fraction `part`.
///
/// # Errors
/// [`Error::Cancelled`] if `progress` returns false.
pub fn report(progress: &Progress<'_>, part: f32) -> Result<()> {
    if progress(part) { Ok(()) } else { Err(Error::Cancelled) }
}

/// Reports progress at regular intervals. The operation calls this function before the `done`-th of `all` short steps.
///
/// # Errors
/// As [`report`].
pub fn step(progress: &Progress<'_>, done: usize, all: usize) -> Result<()> {
    if done.is_multiple_of(STEPS_PER_REPORT) { report(progress, done as f32 / all.max(1) as f32) } else { Ok(()) }
}

/// Returns the progress function of a part of the operation, which covers `from` to `to` of the whole.
pub fn part<'a>(progress: &'a Progress<'_>, from: f32, to: f32) -> impl Fn(f32) -> bool + 'a {
    // Without the minimum, rounding could make progress decrease between two parts.
    move |part: f32| progress((from + part * (to - from)).min(to))
}

/// Calls `work` for every index in parallel and returns the results in order.
///
/// # Errors
/// As [`report`].
pub fn in_parallel<T: Send>(count: usize, progress: &Progress<'_>, work: impl Fn(usize) -> T + Sync) -> Result<Vec<T>> {
    let mut results = Vec::with_capacity(count);
    while results.len() < count {
        report(progress, results.len() as f32 / count as f32)?;
        let end = (results.len() + ITEMS_PER_REPORT).min(count);
        results.par_extend((results.len()..end).into_par_iter().map(&work));
    }
    report(progress, 1.0)?;
    Ok(results)
}

#[cfg(test)]
mod tests {
    use std::cell::{Cell, RefCell};

    use super::*;

    #[test]
    fn parts_of_an_operation_cover_the_whole_and_a_refusal_stops_it_between_steps() {
        let reported = RefCell::new(Vec::new());
        let record = |part| {
            reported.borrow_mut().push(part);
            true
        };
        for (from, to) in [(0.0, 0.25), (0.25, 1.0)] {
            assert_eq!(in_parallel(50, &part(&record, from, to), |k| k).unwrap(), (0..50).collect::<Vec<_>>());
        }
        assert_eq!(*reported.borrow(), [0.0, 0.16, 0.25, 0.25, 0.73, 1.0]);
        let remaining = Cell::new(2);
        let stop_soon = |_| remaining.replace(remaining.get() - 1) > 0;
        let done = (0..100_000).take_while(|&k| step(&stop_soon, k, 100_000).is_ok()).count();
        assert_eq!(done, 2 * STEPS_PER_REPORT);
    }
}
