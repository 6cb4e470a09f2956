//! How sound a result is: what was left out, where it is weakest, and what a person can do about it.
//!
//! Every [`crate::pipeline::Outcome`] carries the [`HealthInputs`]; the [`Health`] is measured from it when first asked for, so
//! that an editor's drafts do not wait for it.

mod measure;
mod warnings;

use std::sync::Arc;

use serde::Serialize;

use crate::brdf::{Material, MaterialAssignment};
use crate::effective::EffectiveBrdf;
use crate::geometry::{Facets, TileMesh};
use crate::metrics::Errors;
use crate::visibility::{PackedVisibility, Visibility};

/// What the stages leave for the examination.
#[derive(Debug, Clone)]
pub struct HealthInputs {
    pub facets: Arc<Facets>,
    pub visibility: VisibilityInput,
    pub materials: Arc<MaterialAssignment>,
    /// Names of the materials.
    pub names: Vec<String>,
    pub closes_plane: bool,
}

/// What facets see.
#[derive(Debug, Clone)]
pub enum VisibilityInput {
    Soft(Arc<Visibility>),
    /// Yes or no at fixed directions.
    Packed(Arc<PackedVisibility>),
}

/// What is known of one result. Part numbers are from 0 to 1; `None` where a number makes no sense or was not measured.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Health {
    /// In words: what is weak and what would mend it. Empty where all is well.
    pub warnings: Vec<String>,
    /// Measured BRDFs: samples left out and what was evened out.
    pub measured: Vec<MeasuredHealth>,
    pub materials: Vec<MaterialHealth>,
    pub surface: SurfaceHealth,
    pub result: ResultHealth,
    pub factorization: Option<FactorHealth>,
}

/// One measured BRDF.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct MeasuredHealth {
    pub name: String,
    pub samples: usize,
    /// Negative, NaN, infinite or marked as missing.
    pub rejected: usize,
    /// Relative L2 of `f(i,o) - f(o,i)` before it was averaged away.
    pub reciprocity_residual: f32,
    /// Relative L2 of the table against the file.
    pub resampling_error: f32,
}

/// One material of the tile.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct MaterialHealth {
    pub name: String,
    /// The largest directional albedo of any channel up to 80°: above 1 the material gains energy.
    pub largest_albedo: f32,
    /// Half width of its narrowest lobe [degrees]; `None` for a matte one.
    pub narrowest_lobe_deg: Option<f32>,
}

/// The surface and how it was sampled.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SurfaceHealth {
    pub facets: usize,
    /// Triangles without area or with corners that are not finite.
    pub triangles_left_out: usize,
    /// Whether light can pass between triangles or around them.
    pub has_holes: bool,
    /// Part of the area that none of the directions examined sees.
    pub area_never_seen: f64,
    /// Fewest facets that a direction up to 80° sees, and that direction (theta, phi in degrees).
    pub fewest_facets_seen: usize,
    pub fewest_seen_from_deg: [f32; 2],
    /// Facets within the narrowest lobe about a typical normal (the tenth part of all have fewer).
    pub facets_in_a_lobe: Option<usize>,
    /// Part of the walks for horizons that were cut short.
    pub walks_cut_short: f64,
}

/// The effective BRDF itself.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ResultHealth {
    /// The largest part of even light from everywhere that any examined viewer receives, any channel, and that viewer
    /// (theta, phi in degrees); by reciprocity the directional albedo.
    pub largest_albedo: Option<f32>,
    pub largest_albedo_at_deg: [f32; 2],
    /// The largest `|a_v / (A cos θ) - 1|` up to 80°, and where (degrees): where the sampling is weakest.
    pub projected_area_error: Option<f64>,
    pub worst_angle_deg: [f32; 2],
    /// Relative L2 of `G(i,o) - G(o,i)`.
    pub reciprocity_residual: f64,
    /// Values that were not finite, or negative, among those examined. Never anything but 0, or there is a fault.
    pub unsound_values: usize,
}

/// Where factors hold the result, or were tried.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FactorHealth {
    /// Whether the result is read from factors.
    pub used: bool,
    /// Relative L2 against the direct sum, an upper estimate; `None` where there is no direct sum to compare with.
    pub relative_error: Option<f64>,
    /// `-log10` of it: decimal digits that are right.
    pub effective_digits: Option<f64>,
    /// Ranks kept, a channel.
    pub ranks: Vec<usize>,
    /// Whether a rank stands at its limit: then truncation, not the wanted energy, ended it.
    pub at_rank_limit: bool,
    /// Step of the grid that lobes are read from [degrees].
    pub lobe_grid_step_deg: f32,
}

/// What the examination needs to know of the settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest rank of a factorization.
    pub max_rank: usize,
    /// Relative L2 that factors may differ from the direct sum by.
    pub tolerance: f64,
}

impl Health {
    /// Examines a result.
    pub fn of(brdf: &EffectiveBrdf, inputs: &HealthInputs, factored: Option<Errors>, limits: Limits) -> Self {
        let (measured, materials) = measure::materials(&inputs.materials.materials, &inputs.names);
        let lobe = materials.iter().filter_map(|material| material.narrowest_lobe_deg).reduce(f32::min);
        let conserving = materials.iter().all(|material| material.largest_albedo <= 1.0);
        let mut health = Self {
            warnings: Vec::new(),
            surface: measure::surface(inputs, lobe),
            result: measure::result(brdf, inputs, lobe),
            factorization: measure::factorization(brdf, factored, limits.max_rank),
            measured,
            materials,
        };
        health.warnings = warnings::of(&health, limits, conserving);
        health
    }

    /// Of what has no effective BRDF to examine, as the reference sum: materials and mesh alone.
    pub fn of_input(mesh: &TileMesh, materials: &[Material], names: &[String], limits: Limits) -> Self {
        let (measured, materials) = measure::materials(materials, names);
        let left_out = (0..mesh.triangles.len()).filter(|&triangle| mesh.triangle_area(triangle) <= 0.0).count();
        let surface = SurfaceHealth {
            triangles_left_out: left_out,
            has_holes: !mesh.closes_plane,
            fewest_facets_seen: usize::MAX,
            ..SurfaceHealth::default()
        };
        let mut health = Self { measured, materials, surface, ..Self::default() };
        health.warnings = warnings::of(&health, limits, false);
        health.surface.fewest_facets_seen = 0;
        health
    }
}
