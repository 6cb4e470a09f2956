//! The `biscale` program: subcommands of the library, and the editor.
#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic if a stream is closed")]

use std::process::ExitCode;
use std::time::Instant;

#[cfg(feature = "editor")]
use biscale::app;
use biscale::base::{print_on_stderr, threads};
use biscale::cli::{self, Cli, Command};
use clap::Parser;

fn main() -> ExitCode {
    let started = Instant::now();
    let arguments = Cli::parse();
    threads::limit();
    let result = match arguments.command {
        None => edit(arguments.scene.as_deref(), None).map_err(|error| match error.downcast_ref::<biscale::Error>() {
            Some(_) => error.context("no command was given, so the argument is opened as a scene (see --help)"),
            None => error,
        }),
        Some(Command::Edit { scene, start_times }) => edit(scene.as_deref(), start_times.then_some(started)),
        Some(command) => cli::run(command),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // A closed pipe is no failure, because its reader needs no further output.
            if cli::is_broken_pipe(&error) {
                return ExitCode::SUCCESS;
            }
            print_on_stderr(format_args!("biscale: {error:#}"));
            ExitCode::from(error.downcast_ref::<biscale::Error>().map_or(1, biscale::Error::exit_code))
        }
    }
}

/// Opens the editor on a scene. With `since`, prints the milliseconds from that time to the first image, and quits.
#[cfg(feature = "editor")]
fn edit(scene: Option<&str>, since: Option<Instant>) -> anyhow::Result<()> {
    app::run(scene, app::StartTimes { since })
}

/// Reports that the program was built without the editor. A scene that cannot be opened is reported first, as by the editor.
#[cfg(not(feature = "editor"))]
fn edit(scene: Option<&str>, _: Option<Instant>) -> anyhow::Result<()> {
    if let Some(scene) = scene {
        biscale::scene::open(scene, &[])?;
    }
    anyhow::bail!("this program was built without the editor (feature `editor`); see `biscale --help` for its commands")
}
