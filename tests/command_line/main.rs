//! The built program from outside: what it prints, what it writes, and what it says about bad input.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may stop where it stands")]

mod accuracy;
mod cache;
mod commands;
mod desk;
mod eval;
mod refusals;
