//! The folders of measured files that some tests need. Unit tests and integration tests include this file.

use std::path::PathBuf;

/// Returns the folder that an environment variable names. Prints `SKIPPED` if the variable is unset.
pub fn folder(variable: &str) -> Option<PathBuf> {
    let folder = std::env::var_os(variable).map(PathBuf::from);
    if folder.is_none() {
        eprintln!("SKIPPED: {variable} names no folder of measured files");
    }
    folder
}
