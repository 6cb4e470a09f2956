//! Dense linear algebra.

pub(crate) mod gemm;
