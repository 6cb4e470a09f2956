//! Which effects a scene calls for, why, and at what predicted cost.

mod decisions;
mod effects;
mod settings;
#[cfg(test)]
mod tests;

pub use effects::{Costs, Effect, Findings, PICTURE_CHECK_PAIRS, Plan, Route, decide};
pub use settings::{Backend, Method, Preset, Settings, Sighting};
