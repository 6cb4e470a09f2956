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

pub mod accuracy;
pub mod brdf;
pub mod cache;
pub mod cancel;
#[cfg(test)]
mod chi_square;
pub mod close_up;
pub mod directions;
pub mod error;
pub mod export;
pub mod filtering;
pub mod fit;
pub mod geometry;
pub mod gpu;
pub mod interreflection;
pub mod large_scale;
pub mod pipeline;
pub mod plan;
pub mod progress;
pub mod report;
pub mod scene;
pub mod simd;
pub mod visibility;

pub use cancel::Cancel;
pub use error::{Error, InputError, Result};
pub use progress::Progress;
