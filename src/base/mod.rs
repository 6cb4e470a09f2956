//! Errors, cancellation, progress and files: the layer that everything else imports.

pub mod atomic_file;
mod cancel;
mod error;
pub mod progress;

pub use atomic_file::replace_file;
pub use cancel::Cancel;
pub use error::{Error, InputError, Result};
pub use progress::Progress;
