//! Environments and the directional lights that represent them.

pub mod environment;
pub mod light_selection;
pub mod lights;
