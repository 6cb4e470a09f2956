//! One shape of error for everything a person hands in: where it is, what was found, what was expected.

use std::fmt;
use std::path::{Path, PathBuf};

/// What can go wrong in the library. `Input` is the caller's to mend (exit code 2), `Failed` is ours (exit code 1).
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("{0}")]
    Input(Box<InputError>),
    #[error("{0}")]
    Failed(String),
    /// A graphics device failed at something that the CPU can do.
    #[error("{0}")]
    Device(crate::gpu::GpuError),
    /// The caller asked for it ([`super::Cancel`]).
    #[error("cancelled")]
    Cancelled,
}

pub type Result<T> = std::result::Result<T, Error>;

/// A complaint about something handed in.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct InputError {
    pub file: Option<PathBuf>,
    /// The field (`tile.geometry.depth`) or the place in the file (`line 12`, `byte 36`).
    pub place: String,
    pub found: String,
    pub expected: String,
    /// A suggestion that would mend it.
    pub hint: Option<String>,
}

impl InputError {
    pub fn new(place: impl Into<String>, found: impl fmt::Display, expected: impl fmt::Display) -> Self {
        Self { place: place.into(), found: brief(found.to_string()), expected: expected.to_string(), ..Self::default() }
    }

    pub fn in_file(mut self, file: impl AsRef<Path>) -> Self {
        self.file = Some(file.as_ref().to_owned());
        self
    }

    pub fn with_hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

/// Characters of what was found that are said: decoders may list all they met.
const MAX_SAID: usize = 400;

fn brief(mut text: String) -> String {
    if let Some((end, _)) = text.char_indices().nth(MAX_SAID) {
        text.truncate(end);
        text.push('…');
    }
    text
}

impl fmt::Display for InputError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(out, "{}: ", file.display())?;
        }
        if !self.place.is_empty() {
            write!(out, "{}: ", self.place)?;
        }
        write!(out, "found {}, expected {}", self.found, self.expected)?;
        match &self.hint {
            Some(hint) => write!(out, " ({hint})"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for InputError {}

impl From<InputError> for Error {
    fn from(error: InputError) -> Self {
        Self::Input(Box::new(error))
    }
}

impl Error {
    /// A failure that is not the caller's doing.
    pub fn failed(what: impl fmt::Display) -> Self {
        Self::Failed(what.to_string())
    }

    /// Names the file in a complaint that does not name one yet.
    pub fn in_file(self, file: impl AsRef<Path>) -> Self {
        match self {
            Self::Input(mut error) if error.file.is_none() => {
                error.file = Some(file.as_ref().to_owned());
                Self::Input(error)
            }
            other => other,
        }
    }

    /// The process exit code of the command line's contract.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Failed(_) | Self::Device(_) | Self::Cancelled => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_found_is_said_briefly() {
        let error = InputError::new("file.tif", "1, ".repeat(100_000), "an image");
        assert!(error.to_string().chars().count() < 600);
        assert!(InputError::new("a", "short", "b").to_string().contains("short"));
    }
}
