//! Number of threads of parallel loops.

use std::num::NonZero;

/// Bounds the threads on machines with fewer processors. With thousands of threads, idle ones that look for work take
/// all the time.
const MAX_THREADS: usize = 256;

/// The number of threads that the environment variable `RAYON_NUM_THREADS` asks for, at most the larger of 256 and the
/// number of processors. It is 0 without the variable, which stands for one thread per processor.
pub fn requested() -> usize {
    let asked = std::env::var("RAYON_NUM_THREADS").ok().and_then(|text| text.parse::<usize>().ok()).unwrap_or(0);
    // Asking for the processors reads files on Linux.
    if asked <= MAX_THREADS {
        return asked;
    }
    asked.min(std::thread::available_parallelism().map_or(1, NonZero::get).max(MAX_THREADS))
}

/// Limits the threads of this process to [`requested`]. It has an effect only before the first parallel loop.
pub fn limit() {
    let threads = requested();
    if threads >= MAX_THREADS {
        // If a loop has run, its threads stay.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    }
}
