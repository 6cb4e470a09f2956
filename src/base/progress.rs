//! How far long work is, told to whoever waits for it, who may say in answer that it is to stop.

use rayon::prelude::*;

use super::{Error, Result};

/// Is told the part that is done, 0 to 1, and returns whether to go on.
pub type Progress<'a> = dyn Fn(f32) -> bool + 'a;

/// Items between two calls of the progress function: of work in parallel, and of quick steps one after the other.
const ITEMS_A_STEP: usize = 32;
const QUICK_A_STEP: usize = 4096;

/// Tells that `part` is done.
///
/// # Errors
/// [`Error::Cancelled`] when `progress` says so.
pub fn tell(progress: &Progress<'_>, part: f32) -> Result<()> {
    if progress(part) { Ok(()) } else { Err(Error::Cancelled) }
}

/// To be called before the `done`-th of `all` quick steps: tells of one in some thousands.
///
/// # Errors
/// As [`tell`].
pub fn step(progress: &Progress<'_>, done: usize, all: usize) -> Result<()> {
    if done.is_multiple_of(QUICK_A_STEP) { tell(progress, done as f32 / all.max(1) as f32) } else { Ok(()) }
}

/// The progress of a part of the work: what is told of it stands between `from` and `to` of the whole.
pub fn part<'a>(progress: &'a Progress<'_>, from: f32, to: f32) -> impl Fn(f32) -> bool + 'a {
    // Rounding must not make it go back at the seam of two parts.
    move |part: f32| progress((from + part * (to - from)).min(to))
}

/// `work` of every index in parallel, in order.
///
/// # Errors
/// As [`tell`].
pub fn in_parallel<T: Send>(count: usize, progress: &Progress<'_>, work: impl Fn(usize) -> T + Sync) -> Result<Vec<T>> {
    let mut results = Vec::with_capacity(count);
    while results.len() < count {
        tell(progress, results.len() as f32 / count as f32)?;
        let end = (results.len() + ITEMS_A_STEP).min(count);
        results.par_extend((results.len()..end).into_par_iter().map(&work));
    }
    tell(progress, 1.0)?;
    Ok(results)
}

#[cfg(test)]
mod tests {
    use std::cell::{Cell, RefCell};

    use super::*;

    #[test]
    fn parts_of_the_work_fill_the_whole_and_an_answer_of_no_stops_it_between_steps() {
        let told = RefCell::new(Vec::new());
        let tell = |part| {
            told.borrow_mut().push(part);
            true
        };
        for (from, to) in [(0.0, 0.25), (0.25, 1.0)] {
            assert_eq!(in_parallel(50, &part(&tell, from, to), |k| k).unwrap(), (0..50).collect::<Vec<_>>());
        }
        assert_eq!(*told.borrow(), [0.0, 0.16, 0.25, 0.25, 0.73, 1.0]);
        let left = Cell::new(2);
        let soon = |_| left.replace(left.get() - 1) > 0;
        let done = (0..100_000).take_while(|&k| step(&soon, k, 100_000).is_ok()).count();
        assert_eq!(done, 2 * QUICK_A_STEP);
    }
}
