//! Families of tile geometry. Each builds a mesh from its parameters.

mod builder;
pub(crate) mod flat;
pub mod grooves;
pub(crate) mod height_field_part;
pub mod heightfield;
pub(crate) mod mesh_file;
pub mod pyramids;
pub(crate) mod rods;
pub(crate) mod rounded;
pub(crate) mod triangle_points;
mod triangulate;
pub(crate) mod weave;
