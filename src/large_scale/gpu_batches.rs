//! Work cut into submissions that are short on any device: a slow one stays far from its driver's watchdog, and a picture
//! that nobody waits for any more is soon given up.

use std::ops::Range;
use std::time::{Duration, Instant};

use crate::cancel::Cancel;
use crate::error::Result;
use crate::gpu::{Gpu, GpuError};

/// Submissions grow while they take less than this.
const SHORT: Duration = Duration::from_millis(25);

/// The most workgroups of a dispatch along one axis.
const MAX_GROUPS: u64 = 65_535;

/// Points to be worked on, some at a time.
#[derive(Debug, Clone)]
pub(super) struct Batches {
    count: usize,
    /// Points of the next submission, and the most of any.
    size: usize,
    most: usize,
}

impl Batches {
    /// `work`: of one point; `bounds`: that of the first submission and the most of any; `threads`: of a workgroup.
    pub fn of(count: usize, work: u64, bounds: [u64; 2], threads: u32) -> Self {
        let threads = u64::from(threads);
        let [size, most] = bounds.map(|bound| (bound / work.max(1)).clamp(threads, MAX_GROUPS * threads) as usize);
        Self { count, size, most }
    }

    /// Submits all points, each time waiting until the device is done.
    ///
    /// # Errors
    /// What `submit` fails with, or [`crate::Error::Cancelled`].
    pub fn each(
        mut self,
        gpu: &Gpu,
        cancel: &Cancel,
        mut submit: impl FnMut(Range<usize>) -> std::result::Result<(), GpuError>,
    ) -> Result<()> {
        let mut first = 0;
        while first < self.count {
            cancel.check()?;
            let start = Instant::now();
            let end = (first + self.size).min(self.count);
            submit(first..end)?;
            gpu.wait("computing")?;
            self.took(start.elapsed());
            first = end;
        }
        Ok(())
    }

    /// A longer submission next time where this one was short.
    fn took(&mut self, time: Duration) {
        if time < SHORT {
            self.size = (2 * self.size).min(self.most);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn submissions_cover_every_point_once_and_grow_within_their_bounds() {
        let gpu = match Gpu::open() {
            Ok(gpu) => gpu,
            Err(error) => return eprintln!("SKIPPED: {error}"),
        };
        let mut next = 0;
        let mut sizes = Vec::new();
        let batches = Batches::of(10_000, 8, [1024, 16_384], 64);
        batches
            .each(&gpu, &Cancel::default(), |points| {
                assert_eq!(points.start, next);
                next = points.end;
                sizes.push(points.len());
                Ok(())
            })
            .unwrap();
        assert_eq!(next, 10_000);
        assert_eq!(sizes[0], 128);
        assert!(sizes.iter().all(|&size| size <= 2048), "{sizes:?}");
        // A pixel of huge work is still a workgroup of pixels.
        assert_eq!(Batches::of(10, 1 << 40, [1024, 16_384], 64).size, 64);
    }

    #[test]
    fn a_long_submission_is_followed_by_none_that_is_longer() {
        let mut batches = Batches::of(1 << 20, 1, [1 << 10, 1 << 16], 64);
        batches.took(2 * SHORT);
        assert_eq!(batches.size, 1 << 10);
        batches.took(SHORT / 2);
        assert_eq!(batches.size, 1 << 11);
    }
}
