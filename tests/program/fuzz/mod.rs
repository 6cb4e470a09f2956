//! Mutational fuzzing of every file reader. A seeded generator mutates valid files, byte by byte and field by field.
//! For any input, a reader returns a valid result or an error with exit code 2, in bounded time and memory. It does not
//! panic.
//!
//! The ordinary tests run each target a few hundred times. `BISCALE_FUZZ_SECONDS=300 cargo test --release --test
//! program fuzz -- --ignored --nocapture` runs each target for five minutes (30 s without the variable) and prints the
//! executions, which `docs/measurements/hard_cases.md` quotes. Inputs that once failed are tests in `found.rs`.

mod found;
mod mutate;
mod seeds;
mod targets;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use targets::{TARGETS, Target};

/// Longest time of one input, in a debug build on a busy machine.
const MAX_DURATION: Duration = Duration::from_secs(20);
/// Most memory of the process, in bytes. All targets run in it at the same time.
const MAX_MEMORY: u64 = 6 << 30;

/// Runs mutated inputs until `done(executions)`. Returns the number of executions and the number of accepted inputs.
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
        let (duration, save) = (start.elapsed(), || {
            let path = std::env::temp_dir().join(format!("biscale-fuzz-{}-{seed}-{executions}", target.name));
            std::fs::write(&path, &input).unwrap();
            let text = if target.is_text { String::from_utf8_lossy(&input) } else { "".into() };
            format!("{}\n{text}", path.display())
        });
        match result {
            Err(_) => panic!("{}: a panic; the input is stored as {}", target.name, save()),
            Ok(Err(fault)) => panic!("{}: {fault}; the input is stored as {}", target.name, save()),
            Ok(Ok(sound)) => accepted += usize::from(sound),
        }
        assert!(duration < MAX_DURATION, "{}: {duration:?}; the input is stored as {}", target.name, save());
        executions += 1;
    }
    (executions, accepted)
}

/// Returns the peak resident size of this process, if the system reports it.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}

fn run_briefly(name: &str) {
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let (executions, accepted) = fuzz(target, 1, |executions| executions >= target.brief);
    assert!(accepted > 0, "{name}: none of {executions} inputs is accepted, so the seeds are invalid");
    assert!(peak_memory().is_none_or(|bytes| bytes < MAX_MEMORY));
}

fn run_for_seconds(name: &str) {
    let seconds = std::env::var("BISCALE_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(30.0);
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let start = Instant::now();
    // Every run has another seed. A failing input is stored.
    let seed = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(1, |now| now.as_secs());
    let (executions, accepted) = fuzz(target, seed, |_| start.elapsed().as_secs_f64() >= seconds);
    let peak = peak_memory().map_or(0, |bytes| bytes >> 20);
    println!(
        "{name:<14} {executions:>9} executions in {:>4.0} s, {accepted:>8} accepted, no crash (seed {seed}; peak \
         memory {peak} MB)",
        start.elapsed().as_secs_f64()
    );
    assert!(peak_memory().is_none_or(|bytes| bytes < MAX_MEMORY));
}

macro_rules! targets {
    ($($name:ident)*) => { $(
        mod $name {
            #[test]
            fn mutated_files_are_read_or_refused_without_a_panic() {
                super::run_briefly(stringify!($name));
            }

            #[test]
            #[ignore = "half a minute, or BISCALE_FUZZ_SECONDS"]
            fn mutated_files_are_read_or_refused_for_the_given_time() {
                super::run_for_seconds(stringify!($name));
            }
        }
    )* };
}

targets! { scene merl rgl utia npz obj_tile obj_object heights environment rig photographs svbtdf pipeline }
