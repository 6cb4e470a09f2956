//! What a table says about itself: conventions in plain words, where it comes from, how good it is.

use serde::Serialize;

use super::{Job, Reflectances};
use crate::metrics::Errors;
use crate::pipeline::Outcome;
use crate::scene::LoadedScene;

/// Who writes the tables.
pub const PROGRAM: &str = concat!("biscale ", env!("CARGO_PKG_VERSION"));
/// The frame of all directions.
pub const FRAME: &str = "z up (the large-scale normal), x and y along the tile; theta from +z, phi from +x towards +y, in \
                         radians; i points to the light, o to the viewer";

/// Where an exported table comes from.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ExportMeta {
    /// Name of the scene: a file's stem, or a shipped material.
    pub scene: String,
    /// Quality preset, with the knobs that were turned by hand.
    pub quality: String,
    pub seed: u64,
    /// Extent of the tile in x and y, in `tile_unit`.
    pub tile_size: [f32; 2],
    pub tile_unit: String,
    /// Whether the tile closes the plane; where it does not, `a_v` is measured ([`crate::geometry::TileMesh::closes_plane`]).
    pub closes_plane: bool,
    /// Whether turning the tile changes nothing, so that three angles tell all.
    pub isotropic: bool,
    /// Notes on the way from scene to table (snapped parameters, health).
    pub notes: Vec<String>,
}

impl ExportMeta {
    /// Of a scene that was just computed. `closes_plane`: whether its tile does.
    pub fn of(loaded: &LoadedScene, outcome: &Outcome, closes_plane: bool) -> Self {
        let tile = &loaded.scene.tile;
        Self {
            scene: loaded.name.clone(),
            quality: format!("{}; {}", outcome.settings.preset.name(), outcome.brdf.form.describe()),
            seed: outcome.settings.seed,
            tile_size: tile.size.to_array(),
            tile_unit: tile.unit.clone(),
            closes_plane,
            isotropic: !outcome.plan.is_on("anisotropy"),
            notes: outcome.notes.clone(),
        }
    }

    /// Whether the tile closes the plane, in words.
    pub(super) fn plane(&self) -> &'static str {
        if self.closes_plane {
            "the tile closes the plane: a_v(o) / A is cos(theta_o) but for sampling"
        } else {
            "the tile leaves holes: a_v(o) / A is measured and may be less than cos(theta_o)"
        }
    }
}

/// Everything that is written beside the numbers. Nothing in it changes from run to run.
#[derive(Debug, Clone, Serialize)]
pub struct Description<'a> {
    pub program: &'static str,
    pub frame: &'static str,
    pub brdf: &'static str,
    pub g: &'static str,
    pub projected_area: &'static str,
    pub nodes: &'static str,
    pub plane: &'static str,
    #[serde(flatten)]
    pub meta: &'a ExportMeta,
    /// Base area `A` of the tile, in squared `tile_unit`.
    pub base_area: f64,
    /// `‖read - eval‖ / ‖eval‖` of the bilinear reading, on `f̄`.
    pub resampling_rel_l2: f64,
    /// Peak signal to noise of the same [dB]; null where there is no difference.
    pub resampling_psnr_db: f64,
    /// Directional-hemispherical reflectances: `theta_i`, `phi_i` in degrees, R, G, B.
    pub reflectance: Vec<[f32; 5]>,
}

impl<'a> Description<'a> {
    pub fn new(job: &Job<'a>, resampling: Errors) -> Self {
        let meta = job.meta;
        Self {
            program: PROGRAM,
            frame: FRAME,
            brdf: "effective BRDF f_bar(i,o) / cos(theta_i) in 1/sr, linear RGB with Rec. 709 primaries; f_bar includes the \
                   light's cosine (Wu et al. 2011, Eq. 7), this table does not",
            g: "G(i,o) = a_v(o) f_bar(i,o) / A in 1/sr, equal to G(o,i) up to the error of the method",
            projected_area: "a_v(o) / A, the visible projected area along o over the tile's base area",
            nodes: "theta_a = (a+1/2) (pi/2) / N_theta, phi_b = 2 pi b / N_phi; read bilinearly, wrapped in phi, across the \
                    pole to phi + pi, constant beyond the last theta",
            plane: meta.plane(),
            meta,
            base_area: job.brdf.base_area,
            resampling_rel_l2: resampling.rel_l2,
            resampling_psnr_db: resampling.psnr_db,
            reflectance: Reflectances::of(job.brdf).rows(),
        }
    }

    /// One JSON object; keys in the order above.
    pub fn json(&self) -> std::io::Result<String> {
        Ok(serde_json::to_string(self)?)
    }

    /// `key: value` of every field, a line each.
    pub fn lines(&self) -> std::io::Result<Vec<String>> {
        let value = serde_json::to_value(self)?;
        let fields = value.as_object().into_iter().flatten();
        Ok(fields
            .map(|(key, value)| match value {
                // A line break would end the comment it stands in.
                serde_json::Value::String(text) => {
                    format!("{key}: {}", text.replace(['\n', '\r'], " "))
                }
                other => format!("{key}: {other}"),
            })
            .collect())
    }
}
