//! The built program from outside: its output, the files that it writes, and its errors for bad input.

mod accuracy;
mod cache;
mod commands;
mod eval;
mod folder;
mod inputs;
mod refusals;
