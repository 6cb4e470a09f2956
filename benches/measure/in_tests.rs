//! Measurements of private items, which are ignored tests: each runs as a process of its own, and its lines are read.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::table::Table;

/// A measurement that is an ignored test.
pub struct InTests {
    /// Arguments of `cargo test` that name the binary.
    pub binary: &'static [&'static str],
    /// A part of the test's name that no other test has.
    pub test: &'static str,
}

impl InTests {
    /// Runs the test with all its rows and keeps the lines that it prints.
    ///
    /// # Errors
    /// An error is returned if the process does not start, fails, or runs no test.
    pub fn run(&self, table: &mut Table) -> Result<(), String> {
        let mut child = Command::new(env!("CARGO"))
            .args(["test", "--release"])
            .args(self.binary)
            .args([self.test, "--", "--ignored", "--nocapture"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .env("BISCALE_TABLE", "1")
            // With one thread, the first line of a test would stand behind its name.
            .env("RUST_TEST_THREADS", "2")
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cargo: {error}"))?;
        let mut passed = false;
        if let Some(stdout) = child.stdout.take() {
            for line in BufReader::new(stdout).lines() {
                let line = line.map_err(|error| format!("cargo: {error}"))?;
                if is_of_the_harness(&line) {
                    passed |= line.starts_with("test result: ok. 1 passed");
                } else {
                    table.line(line);
                }
            }
        }
        let status = child.wait().map_err(|error| format!("cargo: {error}"))?;
        if !status.success() {
            return Err(format!("the test `{}` failed", self.test));
        }
        if !passed {
            return Err(format!("found no ignored test `{}`, expected one", self.test));
        }
        Ok(())
    }
}

/// Returns true for the lines that the test harness prints around those of a test.
fn is_of_the_harness(line: &str) -> bool {
    let is_count = line.starts_with("running ") && line.contains(" test");
    let is_slow = line.contains(" has been running for over ");
    let is_result = line.starts_with("test ") && (line.ends_with("... ok") || line.ends_with("... FAILED") || is_slow);
    line.is_empty() || is_count || is_result || line.starts_with("test result: ")
}
