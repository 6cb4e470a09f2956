//! Accuracy of the effective BRDF, of its representations and of its visibility, and the stages that an edit runs.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing test may panic")]

mod accuracy;
mod choosing;
mod images;
mod low_rank;
mod reference;
mod settings;
mod stages;
mod tiles;
mod visibility;
