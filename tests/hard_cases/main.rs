//! Hard cases: directions, geometries, BRDFs, lights and objects at the limits of what a scene allows. Every evaluator
//! must keep the invariants of an effective BRDF on each.
//!
//! `cargo bench --bench measure -- hard-cases` prints the worst deviation and its bound for every case and evaluator;
//! `docs/measurements/hard_cases.md` holds the table.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::disallowed_methods, reason = "a failing test may panic")]

mod cases;
mod continuity;
mod evaluators;
mod examination;
mod finer_presets;
#[path = "../hard_tiles/mod.rs"]
mod hard_tiles;
mod health;
mod invariants;
mod large_mesh;
mod light_and_objects;
mod measured_files;
#[cfg(feature = "gpu")]
mod on_gpu;
mod hard_tile_rows;
#[path = "../numerics/reference.rs"]
mod reference;
mod refinement;
mod statistics;
mod sums;
mod symmetry;
