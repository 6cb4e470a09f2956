//! Helpers that unit tests of several modules share.

pub mod chi_square;
pub mod gaussian_tile;
pub mod measured_data;
