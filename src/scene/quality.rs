//! The `[quality]` table: a preset, and settings that replace the preset's values.

use super::FieldShape;
use super::schema::{number, scene_table};

/// Values of `quality.preset`.
pub const PRESETS: &[&str] = &["draft", "standard", "fine", "reference", "wu2011"];
/// Values of `quality.backend`.
pub const BACKENDS: &[&str] = &["auto", "gpu", "cpu"];
/// Values of `quality.method`.
pub const METHODS: &[&str] = &["auto", "direct", "low_rank"];
/// Values of `quality.visibility`.
pub const VISIBILITIES: &[&str] = &["auto", "slices", "maps"];
/// Values of `quality.interpolation`.
pub const INTERPOLATIONS: &[&str] = &["cubic", "linear"];

const GRID_SIDE: FieldShape = FieldShape::Integer { min: 2, max: 512 };

scene_table! {
    /// Accuracy and backend. A setting that the scene omits has the preset's value.
    Quality {
        /// Preset of all settings: draft, standard, fine, reference or wu2011.
        preset: String = "standard".to_owned(), FieldShape::Choice(PRESETS), "";
        /// Seed of all random samples.
        seed: u64 = 1, FieldShape::Integer { min: 0, max: i64::MAX }, "";
        /// Backend: auto, gpu or cpu.
        backend: String = "auto".to_owned(), FieldShape::Choice(BACKENDS), "";
        /// Number of facets that sample the surface.
        #[serde(skip_serializing_if = "Option::is_none")]
        facets: Option<usize> = None, FieldShape::Integer { min: 16, max: 4_000_000 }, "";
        /// Refine until the estimated error is within the preset's bound, unless facets, azimuths or penumbra_deg are set.
        adaptive: bool = true, FieldShape::Bool, "";
        /// Largest number of facets to which a result is refined.
        max_facets: usize = 131_072, FieldShape::Integer { min: 16, max: 4_000_000 }, "";
        /// Number of azimuths at which visibility is computed.
        #[serde(skip_serializing_if = "Option::is_none")]
        azimuths: Option<usize> = None, FieldShape::Integer { min: 4, max: 1024 }, "";
        /// Number of elevation rings at which visibility is computed.
        #[serde(skip_serializing_if = "Option::is_none")]
        rings: Option<usize> = None, FieldShape::Integer { min: 2, max: 512 }, "";
        /// Visibility method: auto (a horizon map if nothing overhangs, else slices), slices or maps.
        #[serde(skip_serializing_if = "Option::is_none")]
        visibility: Option<String> = None, FieldShape::Choice(VISIBILITIES), "";
        /// Number of bins over the sphere of normals; facets of one bin share one lobe. Empty: no bins.
        #[serde(skip_serializing_if = "Option::is_none")]
        normal_bins: Option<usize> = None, FieldShape::Integer { min: 16, max: 1_000_000 }, "";
        /// Representation of the effective BRDF: auto, direct (a sum over facets) or low_rank (low-rank factors).
        #[serde(skip_serializing_if = "Option::is_none")]
        method: Option<String> = None, FieldShape::Choice(METHODS), "";
        /// Fraction of the BRDF matrix's energy that its low-rank factors retain.
        #[serde(skip_serializing_if = "Option::is_none")]
        keep_m: Option<f32> = None, number(0.5, 1.0), "";
        /// Fraction of the visible normal distribution's energy that its low-rank factors retain.
        #[serde(skip_serializing_if = "Option::is_none")]
        keep_n: Option<f32> = None, number(0.5, 1.0), "";
        /// Number of colour directions that represent a measured BRDF.
        #[serde(skip_serializing_if = "Option::is_none")]
        colors: Option<usize> = None, FieldShape::Integer { min: 1, max: 3 }, "";
        /// Rings and azimuths of the direction grid of the low-rank factors.
        #[serde(skip_serializing_if = "Option::is_none")]
        grid: Option<[usize; 2]> = None, FieldShape::List { of: &GRID_SIDE, min: 2, max: 2 }, "";
        /// Interpolation between the nodes of low-rank factors and shading tables: cubic or linear.
        #[serde(skip_serializing_if = "Option::is_none")]
        interpolation: Option<String> = None, FieldShape::Choice(INTERPOLATIONS), "";
        /// Largest number of rays or samples per direction pair of the reference.
        #[serde(skip_serializing_if = "Option::is_none")]
        reference_samples: Option<usize> = None, FieldShape::Integer { min: 16, max: 1_000_000_000 }, "";
        /// Relative L2 of the standard errors at which the reference ends.
        reference_target: f32 = 0.002, number(1e-5, 1.0), "";
        /// Number of facets that the method `faces` of a slab sums; 0: the method `auto` never sums.
        #[serde(skip_serializing_if = "Option::is_none")]
        slab_facets: Option<usize> = None, FieldShape::Integer { min: 0, max: 65_536 }, "";
        /// Number of paths per shading point for what is seen through a slab; 0: filtered lookups per point.
        #[serde(skip_serializing_if = "Option::is_none")]
        paths: Option<usize> = None, FieldShape::Integer { min: 0, max: 1_000_000 }, "";
        /// Transition width of visibility at a horizon.
        #[serde(skip_serializing_if = "Option::is_none")]
        penumbra_deg: Option<f32> = None, number(0.0, 45.0), "degrees";
    }
}
