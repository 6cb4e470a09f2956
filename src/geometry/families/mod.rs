//! Families of tile geometry, each from its parameters to a mesh.

mod builder;
pub(crate) mod flat;
pub mod grooves;
pub mod heightfield;
pub(crate) mod insides;
pub(crate) mod mesh_file;
pub(crate) mod part;
pub mod pyramids;
pub(crate) mod rods;
pub(crate) mod rounded;
pub(crate) mod weave;
