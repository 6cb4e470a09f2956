//! One file a subcommand; what they share stands here.

pub mod basis;
pub mod eval;
pub mod export;
pub mod fit;
pub mod materials;
pub mod plan;
pub mod profile;
pub mod render;
pub mod report;
pub mod tile;

use std::io::Write;

use anyhow::Result;
use biscale::accuracy::Health;
use biscale::pipeline::Outcome;
use biscale::scene::{self, LoadedScene};

use crate::{Backend, Quality, SceneArgs};

impl SceneArgs {
    /// The scene with all overrides of the command line.
    pub fn open(&self) -> Result<LoadedScene> {
        let mut set = self.set.clone();
        if let Some(quality) = self.quality {
            let name = match quality {
                Quality::Draft => "draft",
                Quality::Standard => "standard",
                Quality::Fine => "fine",
                Quality::Reference => "reference",
                Quality::Wu2011 => "wu2011",
            };
            set.push(format!("quality.preset=\"{name}\""));
        }
        if let Some(backend) = self.backend {
            let name = match backend {
                Backend::Auto => "auto",
                Backend::Gpu => "gpu",
                Backend::Cpu => "cpu",
            };
            set.push(format!("quality.backend=\"{name}\""));
        }
        if let Some(seed) = self.seed {
            set.push(format!("quality.seed={seed}"));
        }
        Ok(scene::open(&self.scene, &set)?)
    }

    /// Says what a person should know about how the result was made.
    pub fn notes(&self, outcome: &Outcome) {
        if !self.quiet {
            for note in &outcome.notes {
                eprintln!("note: {note}");
            }
        }
        self.warn(outcome.health());
    }

    /// Says what is weak about a result, and what would mend it.
    pub fn warn(&self, health: &Health) {
        if !self.quiet {
            for warning in &health.warnings {
                eprintln!("warning: {warning}");
            }
        }
    }
}

/// `WIDTHxHEIGHT`.
pub fn parse_size(text: &str) -> std::result::Result<[usize; 2], String> {
    let complain = || format!("found `{text}`, expected two numbers like 384x384");
    let (a, b) = text.split_once(['x', 'X', '×']).ok_or_else(complain)?;
    let number =
        |text: &str| text.trim().parse::<usize>().ok().filter(|n| (1..=65_536).contains(n)).ok_or_else(complain);
    Ok([number(a)?, number(b)?])
}

/// How many direction pairs.
pub fn parse_count(text: &str) -> std::result::Result<usize, String> {
    let count = text.parse::<usize>().ok().filter(|count| (16..=100_000).contains(count));
    count.ok_or_else(|| format!("found `{text}`, expected a number from 16 to 100000"))
}

/// Minutes, a fraction too.
pub fn parse_minutes(text: &str) -> std::result::Result<f64, String> {
    let minutes = text.parse::<f64>().ok().filter(|minutes| (0.0..=1e4).contains(minutes));
    minutes.ok_or_else(|| format!("found `{text}`, expected minutes from 0 to 10000"))
}

/// Prints JSON on standard output.
pub fn print_json(value: &impl serde::Serialize) -> Result<()> {
    let mut out = std::io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, value)?;
    writeln!(out)?;
    Ok(())
}

/// Did the reader of our output go away?
pub fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.downcast_ref::<std::io::Error>().is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
            || cause
                .downcast_ref::<serde_json::Error>()
                .is_some_and(|error| error.io_error_kind() == Some(std::io::ErrorKind::BrokenPipe))
    })
}
