//! biscale: what does a surface with tiny structures look like from far away?
//!
//! ```text
//! Scene (TOML) ─▶ EffectPlan ─▶ TileMesh ─▶ Facets ─▶ Visibility ─▶ Bvndf ─┐
//!                     │                                                     ├▶ EffectiveBrdf ─▶ picture | table | plots
//!                     └────────────▶ small-scale Brdf ─▶ RotatedBasis ─────┘
//! ```
#![allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::private_intra_doc_links,
    reason = "units stand in brackets: [sr], [rad]"
)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "directions in tests are known not to be zero"))]

pub mod app;
pub mod base;
pub mod brdf;
pub mod cache;
pub mod cli;
pub mod diagnostics;
pub mod effective;
pub mod export;
pub mod fit;
pub mod geometry;
pub mod gpu;
pub mod interreflection;
pub mod math;
pub mod metrics;
pub mod pipeline;
pub mod plan;
pub mod reference;
pub mod render;
pub mod report;
pub mod scene;
#[cfg(test)]
mod testing;
pub mod tuning;
pub mod visibility;

pub use base::{Cancel, Error, InputError, Progress, Result};
