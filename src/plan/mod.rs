//! Which effects a scene calls for, why, and at what predicted cost.

mod decisions;
mod effects;
mod findings;
mod settings;
#[cfg(test)]
mod tests;

pub use effects::{Effect, IMAGE_CHECK_PAIRS, Plan, decide};
pub use findings::{Costs, SceneFeatures, VisibilityAlgorithm};
pub use settings::{Backend, Method, Preset, Settings, VisibilityMethod};
