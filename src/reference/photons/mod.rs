//! Truth of slabs by photons through two faces: through random facets of their distributions of normals, or through the
//! explicit tiles.

pub mod lobe;
mod pair;
#[cfg(test)]
mod tests;
mod tiles;

pub use lobe::{Bins, Estimated, LobeSettings, PhotonSource, Totals, TrueLobe};
pub use pair::{PairSettings, PairTruth};
pub use tiles::{Positions, TileSlab, TracedTile};
