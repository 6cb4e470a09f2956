//! The built program from outside: its output, the files that it writes, and its errors for bad input.

mod accuracy;
mod cache;
mod capture;
mod commands;
mod eval;
mod filter;
mod folder;
mod inputs;
#[cfg(unix)]
mod long_runs;
mod refusals;
mod slabs;
#[cfg(unix)]
mod special_files;
mod standard_error;
mod zoom;
