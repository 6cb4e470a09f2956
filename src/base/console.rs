//! Lines on standard error.

use std::fmt::Display;
use std::io::Write;

/// Prints a line on standard error. A standard error that is closed or full changes neither files nor exit codes, so
/// errors are ignored. `eprintln!` would panic.
pub fn print_on_stderr(line: impl Display) {
    // One write per line, so that lines of several threads do not mix.
    let _ = std::io::stderr().lock().write_all(format!("{line}\n").as_bytes());
}
