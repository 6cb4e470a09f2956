//! The program as a whole: its commands, faults around it, mutated input of its file readers, and its shaders.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::disallowed_methods, reason = "a failing test may panic")]

#[cfg(feature = "cli")]
mod command_line;
#[cfg(feature = "cli")]
mod faults;
mod fuzz;
#[cfg(feature = "gpu")]
mod lost_gpu;
#[cfg(all(feature = "editor", target_os = "linux", debug_assertions))]
mod lost_window;
#[cfg(feature = "gpu")]
mod shaders;
