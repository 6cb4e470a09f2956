//! Hard cases: angles, geometries, BRDFs, light and objects at the ends of what is legal, each with every evaluator, held to
//! what must be true of any effective BRDF.
//!
//! `cargo test --release --test hard_cases -- --ignored --nocapture the_table` prints the worst deviation and its bound for
//! every case and evaluator; docs/hard_cases.txt is what it last printed.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::disallowed_methods,
    reason = "a test may stop where it stands"
)]

mod cases;
mod continuity;
mod evaluators;
mod files;
mod finer;
mod health;
mod invariants;
mod lab;
mod large_mesh;
mod large_scale;
mod on_gpu;
mod refinement;
mod statistics;
mod sums;
mod symmetry;
