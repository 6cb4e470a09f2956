//! Health of a result: figures that show where the result is weak, and warnings with remedies.
//!
//! Every [`crate::pipeline::Outcome`] holds its [`HealthInputs`]. The [`Health`] is measured from them on first use, so
//! that drafts of the editor do not wait for it.

mod capture;
pub mod color_map;
mod measure;
mod slab;
mod warnings;

pub use slab::SlabHealthInputs;

use std::sync::Arc;

use glam::Vec2;
use serde::Serialize;

use crate::brdf::{Material, MaterialAssignment};
use crate::effective::{EffectiveBrdf, ErrorBound, ErrorEstimate};
use crate::geometry::{ColorField, Facets, TileMesh};
use crate::metrics::Errors;
use crate::visibility::{PackedVisibility, Visibility};

/// Results of the stages from which a health is measured.
#[derive(Debug, Clone)]
pub struct HealthInputs {
    pub facets: Arc<Facets>,
    pub visibility: VisibilityInput,
    pub materials: Arc<MaterialAssignment>,
    /// Names of the materials, in their order.
    pub names: Vec<String>,
    pub closes_plane: bool,
    /// Size of the tile [tile units].
    pub size: Vec2,
    /// Colours of the tile below those of its materials.
    pub color: ColorField,
}

/// Visibility that a health is measured from.
#[derive(Debug, Clone)]
pub enum VisibilityInput {
    Soft(Arc<Visibility>),
    /// One bit per facet at fixed directions.
    Packed(Arc<PackedVisibility>),
}

/// Measured figures and warnings of one result. Fractions are from 0 to 1. A figure is `None` if it does not apply or
/// was not measured.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Health {
    /// Weaknesses of the result, each with a remedy. It is empty for a sound result.
    pub warnings: Vec<String>,
    /// Measured BRDFs, with their invalid samples and their asymmetry.
    pub measured: Vec<MeasuredHealth>,
    pub materials: Vec<MaterialHealth>,
    pub surface: SurfaceHealth,
    pub result: ResultHealth,
    pub factorization: Option<FactorHealth>,
}

/// Health of one measured BRDF.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct MeasuredHealth {
    pub name: String,
    pub samples: usize,
    /// Number of samples that are negative, NaN, infinite or marked as missing.
    pub rejected: usize,
    /// Relative L2 of `f(i,o) - f(o,i)` in the file. The average of both is used.
    pub reciprocity_residual: f32,
    /// Relative L2 of the table against the file.
    pub resampling_error: f32,
}

/// Health of one material of the tile.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct MaterialHealth {
    pub name: String,
    /// Largest directional albedo of any channel up to 80°, under the brightest texel of the colour image. The material
    /// creates energy if it exceeds 1.
    pub largest_albedo: f32,
    /// Half width of the narrowest lobe [degrees]; `None` for a diffuse material.
    pub narrowest_lobe_deg: Option<f32>,
}

/// Health of the surface and of its facets.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SurfaceHealth {
    pub facets: usize,
    /// True if the facets represent the surface exactly, so that few of them suffice.
    #[serde(rename = "exact")]
    pub is_exact: bool,
    /// Number of triangles without area or with corners that are not finite.
    pub triangles_left_out: usize,
    /// Largest weight of the colour image over all channels; 1 without an image.
    pub largest_color_weight: f32,
    /// True if light can pass between triangles or around them.
    pub has_holes: bool,
    /// Part of the area that is visible from none of the examined directions.
    #[serde(rename = "area_never_seen")]
    pub area_never_visible: f64,
    /// Smallest number of facets that are visible from a direction up to 80°.
    #[serde(rename = "fewest_facets_seen")]
    pub fewest_visible_facets: usize,
    /// Direction with the fewest visible facets (theta, phi) [degrees].
    #[serde(rename = "fewest_seen_from_deg")]
    pub fewest_visible_at_deg: [f32; 2],
    /// Number of facets within the narrowest lobe about a normal. A tenth of the normals have fewer.
    pub facets_in_a_lobe: Option<usize>,
    /// Part of the searches for horizons that end at their step limit.
    #[serde(rename = "walks_cut_short")]
    pub truncated_searches: f64,
}

/// Health of the effective BRDF.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ResultHealth {
    /// Largest directional albedo of any channel. By reciprocity it is measured as the part of uniform light that a
    /// viewer receives.
    pub largest_albedo: Option<f32>,
    /// Direction of that viewer (theta, phi) [degrees].
    pub largest_albedo_at_deg: [f32; 2],
    /// Mean over the channels of the part of uniform light that is reflected.
    pub mean_albedo: Option<f32>,
    /// Largest `|a_v / (A cos θ) - 1|` up to 80°, which shows the error of the sampling.
    pub projected_area_error: Option<f64>,
    /// Direction of that error (theta, phi) [degrees].
    pub worst_angle_deg: [f32; 2],
    /// Relative L2 of `G(i,o) - G(o,i)`.
    pub reciprocity_residual: f64,
    /// Number of examined values that are negative or not finite. It is 0 unless the program has a fault.
    pub unsound_values: usize,
}

/// Health of a factorization that was computed.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FactorHealth {
    /// True if the result is evaluated from the factors.
    pub used: bool,
    /// Upper estimate of the relative L2 against the direct sum; `None` if there is no direct sum to compare with.
    pub relative_error: Option<f64>,
    /// Number of correct decimal digits: `-log10` of the relative error.
    pub effective_digits: Option<f64>,
    /// Number of factors per channel.
    pub ranks: Vec<usize>,
    /// True if a rank is at its limit, so that the limit ended the factorization instead of the energy.
    pub at_rank_limit: bool,
    /// Step of the grid of lobes [degrees].
    pub lobe_grid_step_deg: f32,
}

/// Settings that warnings depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest rank of a factorization.
    pub max_rank: usize,
    /// Largest relative L2 between factors and the direct sum.
    pub tolerance: f64,
    /// Name of the preset.
    pub preset: &'static str,
    /// The error that the preset allows.
    pub error: Option<ErrorBound>,
}

impl Health {
    /// Measures the health of a result.
    ///
    /// `estimate` is the estimated error of the result, if it is close to what the preset allows.
    pub fn of(
        brdf: &EffectiveBrdf,
        inputs: &HealthInputs,
        factored: Option<Errors>,
        estimate: Option<ErrorEstimate>,
        limits: Limits,
    ) -> Self {
        let (measured, materials) = measure::materials(&inputs.materials.materials, &inputs.names, inputs.color.max());
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
        if let ColorField::Mapped { map, .. } = &inputs.color {
            health.warnings.extend(color_map::warnings(map));
            health.warnings.extend(color_map::finer_than_facets(&inputs.facets, inputs.size));
        }
        health.warnings.extend(estimate.and_then(|estimate| warnings::of_error(&estimate, limits)));
        health
    }

    /// Measures the health of materials and mesh alone, because the reference has no effective BRDF to examine.
    pub fn of_input(mesh: &TileMesh, materials: &[Material], names: &[String], limits: Limits) -> Self {
        let (measured, materials) = measure::materials(materials, names, mesh.color.max());
        let left_out = (0..mesh.triangles.len()).filter(|&triangle| mesh.triangle_area(triangle) <= 0.0).count();
        let surface = SurfaceHealth {
            triangles_left_out: left_out,
            largest_color_weight: mesh.color.max().max_element(),
            has_holes: !mesh.closes_plane,
            fewest_visible_facets: usize::MAX,
            ..SurfaceHealth::default()
        };
        let mut health = Self { measured, materials, surface, ..Self::default() };
        health.warnings = warnings::of(&health, limits, false);
        health.surface.fewest_visible_facets = 0;
        health
    }
}
