//! Errors, cancellation, progress, files and OBJ files: the lowest layer, which all other modules may import.

pub mod atomic_file;
mod cancel;
mod error;
pub mod finite;
mod gpu_error;
pub mod obj;
mod output_place;
pub mod progress;

pub use atomic_file::replace_file;
pub use cancel::Cancel;
pub use error::{Error, InputError, Result};
pub use finite::require_finite;
pub use gpu_error::GpuError;
pub use output_place::check_output;
pub use progress::Progress;
