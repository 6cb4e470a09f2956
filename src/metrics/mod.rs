//! Error measures, and the direction pairs over which they are computed.

mod errors;
mod pairs;

pub use errors::{Errors, compare, upper_errors};
pub use pairs::{Pair, image_pairs, mirror_biased_pairs};
