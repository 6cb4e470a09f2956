//! Statistics of drivers: noise, and moments and ranks of values over footprints.

mod grid;
mod histogram;
mod levels;
mod mips;
mod noise;
pub mod place;

pub use grid::DriverGrid;
pub use histogram::{HistogramMips, MIN_DEVIATION};
pub use levels::{LOW_PASS, LevelAt, Levels};
pub use mips::{MomentMips, principal};
pub use noise::residual_variance;
pub use place::{Footprint, PlaceDriver, PlaceMap};
