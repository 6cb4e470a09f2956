//! The program as a function of its arguments, for the executable and for the Python package.

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Result;
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};

use super::{Cli, Command, is_broken_pipe};
use crate::base::{Error, InputError, print_on_stderr, threads};
use crate::scene;

/// Runs a command line and returns the exit code of the process. `edit` opens the editor on a scene; it also gets the start of
/// the program if the command asks for times.
pub fn main(
    arguments: impl IntoIterator<Item = OsString>,
    edit: impl FnOnce(Option<&str>, Option<Instant>) -> Result<()>,
) -> u8 {
    let started = Instant::now();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let arguments = match Cli::try_parse_from(&arguments) {
        Ok(arguments) => arguments,
        Err(error)
            if matches!(error.kind(), ErrorKind::ArgumentConflict | ErrorKind::UnknownArgument)
                && is_unknown_command(&arguments) =>
        {
            print_on_stderr(format_args!("biscale: {}", unknown_command(&arguments[1].to_string_lossy())));
            return 2;
        }
        Err(error) => {
            // The text of `--help` goes to standard output.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    threads::limit();
    let result = match arguments.command {
        None => edit(arguments.scene.as_deref(), None).map_err(|error| match error.downcast_ref::<Error>() {
            Some(_) => error.context("no command was given, so the argument is opened as a scene (see --help)"),
            None => error,
        }),
        Some(Command::Edit { scene, start_times }) => edit(scene.as_deref(), start_times.then_some(started)),
        Some(command) => super::run(command),
    };
    match result {
        Ok(()) => 0,
        // A closed pipe is no failure, because its reader needs no further output.
        Err(error) if is_broken_pipe(&error) => 0,
        Err(error) => {
            print_on_stderr(format_args!("biscale: {error:#}"));
            let is_input = error.downcast_ref::<InputError>().is_some();
            error.downcast_ref::<Error>().map_or(if is_input { 2 } else { 1 }, Error::exit_code)
        }
    }
}

/// Returns true if the first argument stands where a command would, and names neither a command nor a scene.
fn is_unknown_command(arguments: &[OsString]) -> bool {
    let Some(first) = arguments.get(1).map(|first| first.to_string_lossy()) else { return false };
    !first.starts_with('-')
        && Cli::command().find_subcommand(&*first).is_none()
        && !Path::new(&*first).exists()
        && scene::shipped::source(&first).is_none()
}

fn unknown_command(found: &str) -> InputError {
    let names: Vec<String> = Cli::command().get_subcommands().map(|command| command.get_name().to_owned()).collect();
    let error = InputError::new("", format!("the command `{found}`"), format!("one of {}", names.join(", ")));
    match scene::nearest(found, names.iter().map(String::as_str)) {
        Some(name) => error.with_hint(format!("did you mean `{name}`?")),
        None => error,
    }
}

/// Runs the command line of this process.
pub fn main_of_process(edit: impl FnOnce(Option<&str>, Option<Instant>) -> Result<()>) -> ExitCode {
    ExitCode::from(main(std::env::args_os(), edit))
}

/// Reports that the program was built without the editor. A scene that cannot be opened is reported first, as by the editor.
///
/// # Errors
/// Always.
pub fn no_editor(scene: Option<&str>) -> Result<()> {
    if let Some(scene) = scene {
        crate::scene::open_argument(scene, &[])?;
    }
    anyhow::bail!("this program was built without the editor (feature `editor`); see `biscale --help` for its commands")
}
