//! Numerical building blocks: directions and their grids, SIMD inner loops, linear algebra.

pub mod directions;
pub mod fft;
pub mod linalg;
pub mod simd;
