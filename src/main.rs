//! The `biscale` program: subcommands of the library, and the editor.
#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic if a stream is closed")]

use std::process::ExitCode;

use biscale::cli;

fn main() -> ExitCode {
    #[cfg(feature = "editor")]
    return cli::main_of_process(|scene, since| biscale::app::run(scene, biscale::app::StartTimes { since }));
    #[cfg(not(feature = "editor"))]
    cli::main_of_process(|scene, _| cli::no_editor(scene))
}
