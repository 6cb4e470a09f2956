//! The `[quality]` table: a preset, and any of its knobs turned by hand.

use super::FieldShape;
use super::schema::{number, scene_table};

pub const PRESETS: &[&str] = &["draft", "standard", "fine", "reference", "wu2011"];
pub const BACKENDS: &[&str] = &["auto", "gpu", "cpu"];
pub const METHODS: &[&str] = &["auto", "direct", "low_rank"];
pub const VISIBILITIES: &[&str] = &["auto", "slices", "maps"];
pub const INTERPOLATIONS: &[&str] = &["cubic", "linear"];

const GRID_SIDE: FieldShape = FieldShape::Integer { min: 2, max: 512 };

scene_table! {
    /// How accurately, and on what. A knob that is not given is the preset's.
    Quality {
        /// Preset: draft, standard, fine, reference or wu2011.
        preset: String = "standard".to_owned(), FieldShape::Choice(PRESETS), "";
        /// Seed of every sampling.
        seed: u64 = 1, FieldShape::Integer { min: 0, max: i64::MAX }, "";
        /// Where to compute: auto, gpu or cpu.
        backend: String = "auto".to_owned(), FieldShape::Choice(BACKENDS), "";
        /// Facets that stand for the surface.
        #[serde(skip_serializing_if = "Option::is_none")]
        facets: Option<usize> = None, FieldShape::Integer { min: 16, max: 4_000_000 }, "";
        /// Azimuths at which visibility is computed.
        #[serde(skip_serializing_if = "Option::is_none")]
        azimuths: Option<usize> = None, FieldShape::Integer { min: 4, max: 1024 }, "";
        /// Elevation rings at which visibility is computed.
        #[serde(skip_serializing_if = "Option::is_none")]
        rings: Option<usize> = None, FieldShape::Integer { min: 2, max: 512 }, "";
        /// How visibility is computed: auto (what is cheapest), slices or maps.
        #[serde(skip_serializing_if = "Option::is_none")]
        visibility: Option<String> = None, FieldShape::Choice(VISIBILITIES), "";
        /// Bins over the sphere of normals; facets of a bin share one lobe. None: normals as they are.
        #[serde(skip_serializing_if = "Option::is_none")]
        normal_bins: Option<usize> = None, FieldShape::Integer { min: 16, max: 1_000_000 }, "";
        /// How the product is computed: auto, direct or low_rank.
        #[serde(skip_serializing_if = "Option::is_none")]
        method: Option<String> = None, FieldShape::Choice(METHODS), "";
        /// Part of the BRDF matrix' power that is kept.
        #[serde(skip_serializing_if = "Option::is_none")]
        keep_m: Option<f32> = None, number(0.5, 1.0), "";
        /// Part of the visible normal distribution's power that is kept.
        #[serde(skip_serializing_if = "Option::is_none")]
        keep_n: Option<f32> = None, number(0.5, 1.0), "";
        /// Colour directions kept of a measured BRDF.
        #[serde(skip_serializing_if = "Option::is_none")]
        colors: Option<usize> = None, FieldShape::Integer { min: 1, max: 3 }, "";
        /// Rings and azimuths of the direction grid of the factored form.
        #[serde(skip_serializing_if = "Option::is_none")]
        grid: Option<[usize; 2]> = None, FieldShape::List { of: &GRID_SIDE, min: 2, max: 2 }, "";
        /// Between the nodes of factors and of tables for pictures: cubic or linear.
        #[serde(skip_serializing_if = "Option::is_none")]
        interpolation: Option<String> = None, FieldShape::Choice(INTERPOLATIONS), "";
        /// Rays or samples of the reference for each pair of directions.
        #[serde(skip_serializing_if = "Option::is_none")]
        reference_samples: Option<usize> = None, FieldShape::Integer { min: 16, max: 1_000_000_000 }, "";
        /// Angle over which visibility fades at a horizon.
        #[serde(skip_serializing_if = "Option::is_none")]
        penumbra_deg: Option<f32> = None, number(0.0, 45.0), "degrees";
    }
}
