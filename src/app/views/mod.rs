//! The views of both scales, and the widgets that belong to them.

pub mod brushes;
pub mod gallery;
pub mod lobe;
pub mod methods;
pub mod object;
pub mod pointer;
pub mod slab_lobe;
pub mod spinner;
pub mod tile;
pub mod wipe;
pub mod zoom;
