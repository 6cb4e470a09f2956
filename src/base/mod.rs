//! Errors, cancellation, progress, lines on standard error, text, files, `.npz` archives and OBJ files: the lowest layer, which all
//! other modules may import.

pub mod atomic_file;
mod cancel;
mod console;
pub mod csv;
mod error;
pub mod finite;
mod gpu_error;
pub mod npz;
pub mod obj;
mod output_place;
pub mod progress;
pub mod regular_file;
mod text;
pub mod threads;
pub mod zip;

pub use atomic_file::replace_file;
pub use cancel::{Cancel, Running};
pub use console::print_on_stderr;
#[cfg(feature = "cli")]
pub(crate) use error::without_middle;
pub use error::{Error, InputError, Result};
pub use finite::require_finite;
pub use gpu_error::GpuError;
pub use output_place::check_output;
pub use progress::Progress;
pub use text::capitalized;
