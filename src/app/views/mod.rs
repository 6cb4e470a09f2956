//! The views of both scales, and the widgets that belong to them.

pub mod brushes;
pub mod capture;
pub mod difference;
pub mod gallery;
pub mod lobe;
pub mod methods;
pub mod object;
mod object_toolbar;
pub mod pointer;
pub mod section;
pub mod slab_lobe;
pub mod spinner;
pub mod thumbnails;
pub mod tile;
pub mod wipe;
pub mod zoom;
