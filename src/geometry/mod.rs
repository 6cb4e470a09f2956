//! From a geometry description to a periodic triangle mesh, and from the mesh to facets.

mod facet_order;
mod facets;
mod tile_mesh;

pub use facets::Facets;
pub use tile_mesh::{ColorField, HeightGrid, TileMesh};
