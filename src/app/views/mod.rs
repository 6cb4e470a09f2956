//! The views on both scales.

pub mod object;
