//! Mutational fuzzing of everything that reads a file, on the stable toolchain: seeds that are right, mutated byte by byte and
//! field by field, by a seeded generator. Whatever comes, a reader gives a result that is sound or an error that is the
//! caller's to mend (exit code 2), in bounded time and memory; never a panic.
//!
//! The ordinary suite runs each target a few hundred times; `BISCALE_FUZZ_SECONDS=300 cargo test --release --test fuzz --
//! --ignored --nocapture` goes on for five minutes a target (30 s without the variable) and prints executions.
//! docs/hard_cases.txt keeps what it last printed. What it found stands in `found.rs`, by name.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::disallowed_methods,
    reason = "a test may stop where it stands"
)]

mod found;
mod mutate;
mod seeds;
mod targets;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use targets::{TARGETS, Target};

/// No single input may take longer, in a debug build on a busy machine.
const LONGEST: Duration = Duration::from_secs(20);
/// Bytes that the whole process may hold at most (all targets run in it side by side).
const MAX_MEMORY: u64 = 6 << 30;

/// Runs mutated inputs until `done(executions)`; how many, and how many of them were accepted.
fn fuzz(target: &Target, seed: u64, done: impl Fn(usize) -> bool) -> (usize, usize) {
    let folder = tempfile::tempdir().unwrap();
    let seeds = (target.seeds)();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut executions, mut accepted) = (0, 0);
    while !done(executions) {
        let base = &seeds[random.random_range(0..seeds.len())];
        let other = &seeds[random.random_range(0..seeds.len())];
        let input = mutate::mutated(base, other, target.is_text, &mut random);
        let start = Instant::now();
        let result = catch_unwind(AssertUnwindSafe(|| (target.run)(folder.path(), &input)));
        let (took, keep) = (start.elapsed(), || {
            let path = std::env::temp_dir().join(format!("biscale-fuzz-{}-{seed}-{executions}", target.name));
            std::fs::write(&path, &input).unwrap();
            path.display().to_string()
        });
        match result {
            Err(_) => panic!("{}: a panic; the input is kept as {}", target.name, keep()),
            Ok(Err(fault)) => panic!("{}: {fault}; the input is kept as {}", target.name, keep()),
            Ok(Ok(sound)) => accepted += usize::from(sound),
        }
        assert!(took < LONGEST, "{}: {took:?}; the input is kept as {}", target.name, keep());
        executions += 1;
    }
    (executions, accepted)
}

/// The largest resident size of this process so far, where the system says so.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}

fn briefly(name: &str) {
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let (executions, accepted) = fuzz(target, 1, |executions| executions >= target.brief);
    assert!(accepted > 0, "{name}: none of {executions} inputs was accepted: the seeds are wrong");
    assert!(peak_memory().is_none_or(|bytes| bytes < MAX_MEMORY));
}

fn at_length(name: &str) {
    let seconds = std::env::var("BISCALE_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(30.0);
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let start = Instant::now();
    // Another seed every time: what is found is kept and printed.
    let seed = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(1, |now| now.as_secs());
    let (executions, accepted) = fuzz(target, seed, |_| start.elapsed().as_secs_f64() >= seconds);
    let peak = peak_memory().map_or(0, |bytes| bytes >> 20);
    println!(
        "{name:<14} {executions:>9} executions in {:>4.0} s, {accepted:>8} accepted, no crash (seed {seed}; the process held {peak} \
         MB at most)",
        start.elapsed().as_secs_f64()
    );
    assert!(peak_memory().is_none_or(|bytes| bytes < MAX_MEMORY));
}

macro_rules! targets {
    ($($name:ident)*) => { $(
        mod $name {
            #[test]
            fn mutated_files_are_read_or_refused_never_a_panic() {
                crate::briefly(stringify!($name));
            }

            #[test]
            #[ignore = "half a minute; BISCALE_FUZZ_SECONDS=300 for five"]
            fn mutated_files_for_as_long_as_asked() {
                crate::at_length(stringify!($name));
            }
        }
    )* };
}

targets! { scene merl rgl utia npz obj_tile obj_object heights environment pipeline }
