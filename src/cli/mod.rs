//! Subcommands of the program, one file per subcommand, and the functions that they share.

mod args;
pub mod basis;
pub mod cache;
pub mod capture;
pub mod eval;
pub mod export;
pub mod filter;
mod filter_image;
mod filter_queries;
pub mod fit;
pub mod materials;
pub mod plan;
pub mod profile;
mod profile_slab;
mod program;
pub mod render;
mod render_path;
mod render_zoom;
pub mod report;
pub mod rig;
pub mod tile;
mod to_image;
pub mod transmit;
pub mod watch;

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::base::{Cancel, Error, InputError, check_output, print_on_stderr, without_middle};
use crate::diagnostics::Health;
use crate::pipeline::Outcome;
use crate::scene;
use crate::scene::{Effects, LoadedScene, Switch};
use crate::tuning::choose::{Target, choose};
use anyhow::Result;
use indicatif::{ProgressBar, ProgressStyle};

pub use self::args::*;
pub use self::program::{main, main_of_process, no_editor};

/// Runs a subcommand other than `edit`, which the layer above runs.
///
/// # Errors
/// The scene or another input cannot be used, or an output cannot be written.
pub fn run(command: Command) -> Result<()> {
    #[cfg(target_os = "linux")]
    set_runtime_folder();
    let scene = command.scene().map(|args| (args.scene.clone(), args.set.clone()));
    run_command(command).map_err(|error| match scene {
        Some((scene, set)) => with_scene(error, &scene, &set),
        None => error,
    })
}

/// Adds the scene's name to an error about one of its keys, and name and key to one about a missing file of the scene.
fn with_scene(error: anyhow::Error, scene: &str, set: &[String]) -> anyhow::Error {
    let mut error = match error.downcast::<Error>() {
        Ok(Error::Input(error)) => error,
        Ok(error) => return error.into(),
        Err(error) => return error,
    };
    let first = error.place.split('.').next().unwrap_or_default();
    if error.file.is_none() && scene::Scene::fields().iter().any(|field| field.key == first) {
        error.file = Some(scene::shown_name(scene));
    }
    let is_missing = |file: &PathBuf| error.place.is_empty() && matches!(file.try_exists(), Ok(false));
    if let Some(file) = error.file.clone().filter(is_missing)
        && !scene::is_standard_input(scene)
        && let Ok(loaded) = scene::open_argument(scene, set)
        && let Some(key) = loaded.key_of_file(&file)
    {
        let found = format!("`{}`, which does not exist", without_middle(&file.to_string_lossy()));
        *error = InputError::new(key, found, "a file that can be read").in_file(scene::shown_name(scene));
    }
    Error::Input(error).into()
}

fn run_command(command: Command) -> Result<()> {
    match command {
        Command::Edit { scene, .. } => no_editor(scene.as_deref()),
        Command::Render(args) => render::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Filter(args) => filter::run(&args),
        Command::Fit(args) => fit::run(&args),
        Command::Tile(args) => tile::run(&args),
        Command::Transmit(args) => transmit::run(&args),
        Command::Rig(args) => rig::run(&args),
        Command::Capture(args) => capture::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Basis(args) => basis::run(&args),
        Command::Profile(args) => profile::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Cache(args) => cache::run(&args),
        Command::Materials(args) => materials::run(&args),
    }
}

/// Sets `XDG_RUNTIME_DIR` to a folder without a display if it is unset or relative. Mesa's Vulkan layer searches it for
/// a Wayland display even if no window is opened, and libwayland prints an error if the variable is invalid.
#[cfg(target_os = "linux")]
fn set_runtime_folder() {
    let name = "XDG_RUNTIME_DIR";
    if !std::env::var_os(name).is_some_and(|folder| Path::new(&folder).is_absolute()) {
        // SAFETY: the program calls this function before it starts a thread.
        unsafe { std::env::set_var(name, "/") };
    }
}

impl SceneArgs {
    /// The scene with all overrides of the command line, and the result of `prepare`, which reads the other inputs of
    /// the command and checks its outputs. `prepare` runs before settings are chosen for a target, which takes seconds
    /// to minutes.
    ///
    /// # Errors
    /// The scene cannot be used, no settings can be chosen, or the error of `prepare`.
    pub fn open<T>(&self, prepare: impl FnOnce(&LoadedScene) -> Result<T>) -> Result<(LoadedScene, T)> {
        let mut set = self.set.clone();
        if let Some(quality) = self.quality {
            let name = match quality {
                QualityArg::Draft => "draft",
                QualityArg::Standard => "standard",
                QualityArg::Fine => "fine",
                QualityArg::Reference => "reference",
                QualityArg::Wu2011 => "wu2011",
            };
            set.push(format!("quality.preset=\"{name}\""));
        }
        if let Some(backend) = self.backend {
            let name = match backend {
                BackendArg::Auto => "auto",
                BackendArg::Gpu => "gpu",
                BackendArg::Cpu => "cpu",
            };
            set.push(format!("quality.backend=\"{name}\""));
        }
        if let Some(seed) = self.seed {
            set.push(format!("quality.seed={seed}"));
        }
        set.extend(self.effects.iter().cloned());
        let loaded = scene::open_argument(&self.scene, &set)?;
        let prepared = prepare(&loaded)?;
        let loaded = match self.target() {
            Some(target) => self.check_target(&loaded).and_then(|()| self.choose(&loaded, target))?,
            None => loaded,
        };
        Ok((loaded, prepared))
    }

    /// Checks that a table on standard output and the report of `--json` do not share it.
    ///
    /// # Errors
    /// Both are asked for.
    pub fn check_json(&self, output: &Path) -> Result<()> {
        if self.json && output == Path::new("-") {
            let expected = "a file for the table, because the report is on standard output";
            return Err(Error::from(InputError::new("--json", "the output `-`", expected)).into());
        }
        Ok(())
    }

    /// Checks that a file of the command and the scene are not both on standard input.
    ///
    /// # Errors
    /// Both are.
    pub fn check_input(&self, option: &str, path: &Path) -> Result<()> {
        if path == Path::new("-") && scene::is_standard_input(&self.scene) {
            let expected = "a file, because the scene is on standard input";
            return Err(Error::from(InputError::new(option, "`-`", expected)).into());
        }
        Ok(())
    }

    /// The target of the accuracy or the time, if there is one.
    pub fn target(&self) -> Option<Target> {
        self.target_db.map(Target::Psnr).or(self.budget_ms.map(Target::Milliseconds))
    }

    /// Checks that settings can be chosen for a target: not for a slab, nor in place of a preset that was asked for.
    fn check_target(&self, loaded: &LoadedScene) -> Result<()> {
        let option = if self.target_db.is_some() { "--target-db" } else { "--budget-ms" };
        let presets = "`draft`, `standard` or `fine`: the others have no settings to choose";
        let (found, expected) = match &*loaded.scene.quality.preset {
            "reference" => ("the preset `reference`", presets),
            "wu2011" => ("the preset `wu2011`", presets),
            _ if loaded.scene.slab.is_some() => ("a scene with a slab", "a scene without one"),
            _ => return Ok(()),
        };
        Err(Error::from(InputError::new(option, found, expected)).into())
    }

    /// The scene with settings that reach a target. The summary is printed even with `--quiet`, because it holds the
    /// options that repeat the choice. If no settings reach the target, the error names the closest.
    fn choose(&self, loaded: &LoadedScene, target: Target) -> Result<LoadedScene> {
        let bar = if self.quiet { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        let chosen = choose(loaded, target, &Cancel::default(), |step| {
            bar.set_message(step.to_owned());
            bar.tick();
        })?;
        bar.finish_and_clear();
        if !chosen.reaches_target {
            return Err(Error::Failed(chosen.summary()).into());
        }
        print_on_stderr(chosen.summary());
        Ok(chosen.scene)
    }

    /// Prints the notes and warnings of a result on standard error.
    pub fn notes(&self, outcome: &Outcome) {
        // The health takes some hundredths of a second to measure, so it is measured only if it is printed.
        if self.quiet {
            return;
        }
        for note in &outcome.notes {
            print_on_stderr(format_args!("note: {note}"));
        }
        self.warn(outcome.health());
    }

    /// Prints the warnings of a health on standard error.
    pub fn warn(&self, health: &Health) {
        if !self.quiet {
            for warning in &health.warnings {
                print_on_stderr(format_args!("warning: {warning}"));
            }
        }
    }
}

/// Checks that outputs can be written and that they replace no input: no scene file, no file that the scene names, and
/// none of `more_inputs`. The name `-` stands for standard input or output.
///
/// # Errors
/// As [`check_output`].
pub fn check_outputs(
    scene: &str,
    loaded: &LoadedScene,
    more_inputs: &[&Path],
    outputs: impl IntoIterator<Item = impl AsRef<Path>>,
) -> Result<()> {
    let mut inputs = loaded.files();
    inputs.extend([Path::new(scene)].iter().chain(more_inputs).map(PathBuf::from));
    outputs.into_iter().try_for_each(|output| Ok(check_output(output.as_ref(), &inputs)?))
}

/// Parses `WIDTHxHEIGHT`.
pub fn parse_size(text: &str) -> std::result::Result<[usize; 2], String> {
    let invalid = || format!("found `{text}`, expected two whole numbers from 1 to 65536, like 384x192");
    let (a, b) = text.split_once(['x', 'X', '×']).ok_or_else(invalid)?;
    let number =
        |text: &str| text.trim().parse::<usize>().ok().filter(|n| (1..=65_536).contains(n)).ok_or_else(invalid);
    Ok([number(a)?, number(b)?])
}

/// Parses a number of direction pairs.
pub fn parse_count(text: &str) -> std::result::Result<usize, String> {
    let count = text.parse::<usize>().ok().filter(|count| (16..=100_000).contains(count));
    count.ok_or_else(|| format!("found `{text}`, expected a number from 16 to 100000"))
}

/// Parses a seed.
pub fn parse_seed(text: &str) -> std::result::Result<u64, String> {
    let seed = text.parse::<u64>().ok().filter(|seed| i64::try_from(*seed).is_ok());
    seed.ok_or_else(|| format!("found `{text}`, expected a whole number from 0 to {}", i64::MAX))
}

/// Parses a part from 0 to 1.
pub fn parse_part(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| (0.0..=1.0).contains(number));
    number.ok_or_else(|| format!("found `{text}`, expected a number from 0 to 1"))
}

/// Parses minutes, which may be a fraction.
pub fn parse_minutes(text: &str) -> std::result::Result<f64, String> {
    let minutes = text.parse::<f64>().ok().filter(|minutes| (0.0..=1e4).contains(minutes));
    minutes.ok_or_else(|| format!("found `{text}`, expected minutes from 0 to 10000"))
}

/// Parses `NAME=on|off|auto` and returns it as an override.
pub fn parse_effect(text: &str) -> std::result::Result<String, String> {
    let (name, value) = text.split_once('=').unwrap_or((text, ""));
    effect_override(name.trim(), value.trim()).map_err(|error| {
        if value.is_empty() {
            return format!("found `{text}`, expected NAME=on, NAME=off or NAME=auto");
        }
        format!("found {}, expected {}", error.found, error.expected)
    })
}

/// The override that switches an effect `on`, `off` or to `auto`. The effect `low_rank` becomes the setting `quality.method`.
///
/// # Errors
/// An unknown effect or value.
pub fn effect_override(name: &str, value: &str) -> std::result::Result<String, InputError> {
    if !Switch::NAMES.contains(&value) {
        let found = format!("`{value}` for `{name}`");
        return Err(InputError::new("effects", found, format!("one of {}", Switch::NAMES.join(", "))));
    }
    let known: Vec<&str> = Effects::fields().iter().map(|field| field.key).filter(|key| *key != "bounces").collect();
    match name {
        "low_rank" => {
            let method = match value {
                "on" => "low_rank",
                "off" => "direct",
                _ => "auto",
            };
            Ok(format!("quality.method={method}"))
        }
        name if known.contains(&name) => Ok(format!("effects.{name}={value}")),
        name => {
            let expected = format!("one of low_rank, {}", known.join(", "));
            Err(InputError::new("effects", format!("the effect `{name}`"), expected))
        }
    }
}

/// Parses a number above zero.
pub fn parse_positive(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| format!("found `{text}`, expected a number above 0"))
}

/// A progress bar with a label. It is drawn on terminals only.
pub fn progress_bar(label: &str, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(1000);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent} %, {eta} left") {
        bar.set_style(style);
    }
    bar.set_message(label.to_owned());
    bar
}

/// A progress callback that moves a bar.
pub fn progress_on(bar: &ProgressBar) -> impl Fn(f32) -> bool {
    |part: f32| {
        bar.set_position((part * 1000.0) as u64);
        true
    }
}

/// Prints JSON on standard output.
pub fn print_json(value: &impl serde::Serialize) -> Result<()> {
    let mut out = std::io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, value)?;
    writeln!(out)?;
    Ok(())
}

/// Returns true if an error says that the reader of the output closed the pipe.
pub fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.downcast_ref::<std::io::Error>().is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
            || cause
                .downcast_ref::<serde_json::Error>()
                .is_some_and(|error| error.io_error_kind() == Some(std::io::ErrorKind::BrokenPipe))
    })
}
