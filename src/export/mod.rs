//! Tables that other programs read.

pub use crate::large_scale::picture::replace_file;
