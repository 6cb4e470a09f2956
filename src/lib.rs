//! biscale computes how a surface with tiny structures looks from a distance: the effective BRDF of a small tile that
//! is repeated without end.
//!
//! ```text
//! Scene (TOML) ─▶ TileMesh ─▶ Facets ─▶ Plan ─▶ Visibility ─┐
//!      │                        ▲                           ├▶ EffectiveBrdf ─▶ image | table | plots
//!      └─▶ small-scale BRDFs ───┴───────────────────────────┘
//! ```
//! - [`scene::open`] reads a scene, [`plan::Plan::new`] decides which effects it calls for,
//! - [`geometry::build`] builds the tile's mesh, [`geometry::FacetSampler`] samples its facets,
//! - [`visibility::HorizonMap`] and [`visibility::OcclusionIntervals`] compute what each facet sees,
//! - [`effective::Direct`], [`effective::LowRank`] and [`effective::Wu2011`] represent the effective BRDF,
//! - [`pipeline::Pipeline::effective`] runs all of these and recomputes only what an edit changed,
//! - [`pipeline::Pipeline::slab`] computes a thin transparent slab in place of a tile ([`slab`]),
//! - [`pipeline::Pipeline::color_filter`] filters the colour map of a tile ([`color_map`]),
//! - [`render::render`] renders an object, [`export`] writes tables, [`reference`] checks them by ray casting.
//!
//! ```
//! let mut loaded = biscale::scene::open("fig5c_uneven", &[])?;
//! loaded.scene.quality.preset = "draft".to_owned();
//! let outcome = biscale::pipeline::Pipeline::new().effective(&loaded)?;
//! let [light, viewer] = [0.3, 0.5].map(|theta| biscale::math::directions::from_angles(theta, 0.0));
//! // The effective BRDF [1/sr], with the light's cosine.
//! assert!(outcome.brdf.eval(light, viewer).x > 0.0);
//! # Ok::<(), biscale::Error>(())
//! ```
//! Without its default features the crate needs no window, GPU or command line.
//!
//! Modules are declared from the lowest layer to the highest; a module imports only from the layers above its line.
#![allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::private_intra_doc_links,
    reason = "units stand in brackets: [sr], [rad]"
)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "directions in tests are known not to be zero"))]
#![cfg_attr(not(test), warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic if a stream is closed"))]

pub mod base;
pub mod math;
pub mod metrics;
pub mod cache;

pub mod scene;
pub mod color_map;
pub mod brdf;
pub mod geometry;
pub mod visibility;
pub mod interreflection;
pub mod effective;
pub mod slab;

pub mod reference;
pub mod diagnostics;

pub mod plan;
pub mod pipeline;

pub mod render;
pub mod gpu;

pub mod export;
#[cfg(feature = "fit")]
pub mod fit;
pub mod tuning;
pub mod report;

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "editor")]
pub mod app;

#[cfg(test)]
mod testing;

pub use base::{Cancel, Error, InputError, Progress, Result};
