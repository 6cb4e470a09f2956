//! Which effects a scene calls for, why, and at what predicted cost.

mod decisions;
mod effects;
mod findings;
mod settings;
#[cfg(test)]
mod tests;

pub use effects::{Effect, PICTURE_CHECK_PAIRS, Plan, decide};
pub use findings::{Costs, Findings, Route};
pub use settings::{Backend, Method, Preset, Settings, Sighting};
