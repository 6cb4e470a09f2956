//! Error measures, and the direction pairs over which they are taken.

mod errors;
mod pairs;

pub use errors::{Errors, compare, upper_errors};
pub use pairs::{Pair, mirror_biased_pairs, picture_pairs};
