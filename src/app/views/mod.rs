//! The views on both scales.

pub mod brushes;
pub mod gallery;
pub mod hand;
pub mod lobe;
pub mod object;
pub mod tile;
pub mod wheel;
pub mod wipe;
