//! Environments and the directional lights that stand for them.

pub mod environment;
pub mod light_choice;
pub mod lights;
