//! Errors of the library. Every error of the user's input states its place, what was found and what was expected.

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

/// An error of the library. The caller can correct `Input` (exit code 2); all others have exit code 1.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The input is wrong.
    #[error("{0}")]
    Input(Box<InputError>),
    /// An operation failed without a fault of the input.
    #[error("{0}")]
    Failed(String),
    /// The GPU failed at a computation that the CPU can do.
    #[error("{0}")]
    Gpu(super::GpuError),
    /// The caller cancelled the operation ([`super::Cancel`]).
    #[error("cancelled")]
    Cancelled,
}

pub type Result<T> = std::result::Result<T, Error>;

/// An error of the caller's input: file, place, what was found and what was expected.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct InputError {
    pub file: Option<PathBuf>,
    /// The field (`tile.geometry.depth`) or the place in the file (`line 12`, `byte 36`).
    pub place: String,
    pub found: String,
    pub expected: String,
    /// A suggestion that would correct the input.
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

/// Largest number of characters of the found text in a message; some decoders return very long texts.
const MAX_FOUND_CHARS: usize = 400;

/// Largest number of characters of a path or a place in a message.
const MAX_PATH_CHARS: usize = 200;

/// Leaves out the middle of a long path. Both ends stay, because the end holds the name of the file.
pub(crate) fn without_middle(text: &str) -> Cow<'_, str> {
    let count = text.chars().count();
    if count <= MAX_PATH_CHARS {
        return Cow::Borrowed(text);
    }
    let half = MAX_PATH_CHARS / 2;
    let chars = |from: usize, count: usize| text.chars().skip(from).take(count).collect::<String>();
    Cow::Owned(format!("{}…{}", chars(0, half), chars(count - half, half)))
}

fn brief(mut text: String) -> String {
    if let Some((end, _)) = text.char_indices().nth(MAX_FOUND_CHARS) {
        text.truncate(end);
        text.push('…');
    }
    text
}

impl fmt::Display for InputError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(out, "{}: ", without_middle(&file.to_string_lossy()))?;
        }
        if !self.place.is_empty() {
            write!(out, "{}: ", without_middle(&self.place))?;
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
    /// Creates an error that is not a fault of the input.
    pub fn failed(what: impl fmt::Display) -> Self {
        Self::Failed(what.to_string())
    }

    /// Adds the file to an input error that names no file.
    pub fn in_file(self, file: impl AsRef<Path>) -> Self {
        match self {
            Self::Input(mut error) if error.file.is_none() => {
                error.file = Some(file.as_ref().to_owned());
                Self::Input(error)
            }
            other => other,
        }
    }

    /// The exit code of the process.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Failed(_) | Self::Gpu(_) | Self::Cancelled => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_found_texts_are_truncated() {
        let error = InputError::new("file.tif", "1, ".repeat(100_000), "an image");
        assert!(error.to_string().chars().count() < 600);
        assert!(InputError::new("a", "short", "b").to_string().contains("short"));
    }

    #[test]
    fn a_long_path_loses_its_middle_and_keeps_its_name() {
        let path = format!("{}ü/name.png", "folder/".repeat(700));
        let error = InputError::new("--set ".to_owned() + &path, "nothing", "a file").in_file(&path).to_string();
        assert!(error.chars().count() < 500, "{error}");
        assert!(error.starts_with("folder/") && error.contains("ü/name.png: --set folder/"), "{error}");
    }
}
