//! What is right: the reference sum with its own error, metrics, and the direction pairs they are taken over.

pub mod candidates;
pub mod choose;
mod glimpse;
pub mod health;
pub mod ladder;
mod metrics;
mod pairs;
mod paths;
pub mod progressive;
mod reference;
mod small_reference;
pub mod sweep;

pub use glimpse::Glimpse;
pub use health::Health;
pub use metrics::{Errors, compare, upper_errors};
pub use pairs::{Pair, mirror_biased_pairs, picture_pairs};
pub use reference::{Estimate, Reference, ReferenceSettings};
