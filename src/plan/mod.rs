//! Which effects a scene calls for, why, and at what predicted cost.

mod effects;
mod settings;

pub use effects::{Costs, Effect, Findings, Plan, Route, decide};
pub use settings::{Backend, Method, Preset, Settings};
