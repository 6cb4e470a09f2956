//! The description inside a table: conventions, origin and error.

use serde::Serialize;

use super::{ExportTask, Reflectances};
use crate::metrics::Errors;
use crate::pipeline::Outcome;
use crate::plan::Plan;
use crate::scene::LoadedScene;

/// Name and version of this program.
pub const PROGRAM: &str = concat!("biscale ", env!("CARGO_PKG_VERSION"));
/// Definition of the frame of all directions.
pub const FRAME: &str = "z up (the large-scale normal), x and y along the tile; theta from +z, phi from +x towards +y, in \
                         radians; i points to the light, o to the viewer";

/// Origin of an exported table.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ExportMeta {
    /// Name of the scene: the stem of a file, or a shipped scene.
    pub scene: String,
    /// Quality preset and representation.
    pub quality: String,
    pub seed: u64,
    /// Extent of the tile in x and y, in `tile_unit`.
    pub tile_size: [f32; 2],
    pub tile_unit: String,
    /// True if the tile has no holes ([`crate::geometry::TileMesh::closes_plane`]). Otherwise `a_v` is measured.
    pub closes_plane: bool,
    /// True if rotating the tile about its normal changes nothing, so that three angles suffice.
    pub isotropic: bool,
    /// Notes on the computation, such as snapped parameters and the health.
    pub notes: Vec<String>,
}

impl ExportMeta {
    /// Describes the outcome of a scene. `closes_plane` is true if its tile has no holes.
    pub fn of(loaded: &LoadedScene, outcome: &Outcome, closes_plane: bool) -> Self {
        let tile = &loaded.scene.tile;
        let stated = outcome.errors().map(|errors| {
            format!(
                "stated error of f (relative L2, PSNR), without that of the table: {}",
                errors.estimate().describe()
            )
        });
        Self {
            scene: loaded.name.clone(),
            quality: format!("{}; {}", outcome.settings.preset.name(), outcome.brdf.representation.describe()),
            seed: outcome.settings.seed,
            tile_size: tile.size.to_array(),
            tile_unit: tile.unit.clone(),
            closes_plane,
            isotropic: !outcome.plan.is_on("anisotropy"),
            notes: outcome.notes.iter().cloned().chain(stated).chain(bounced_light(&outcome.plan)).collect(),
        }
    }

    /// Returns `closes_plane` as text.
    pub(super) fn plane(&self) -> &'static str {
        if self.closes_plane {
            "the tile closes the plane: a_v(o) / A is cos(theta_o) but for sampling"
        } else {
            "the tile leaves holes: a_v(o) / A is measured and may be less than cos(theta_o)"
        }
    }
}

/// Which light the table holds: what the plan decided about interreflection.
fn bounced_light(plan: &Plan) -> Option<String> {
    let effect = plan.effects.iter().find(|effect| effect.name == "interreflection")?;
    let state = if effect.on { "included" } else { "not included" };
    Some(format!("light that parts of the tile reflect onto each other is {state}: {}", effect.reason))
}

/// Everything that is written beside the numbers. It is the same in every run.
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
    /// `‖read - eval‖ / ‖eval‖` of `f̄` under bilinear interpolation.
    pub resampling_rel_l2: f64,
    /// PSNR of the interpolation [dB]; null if there is no difference.
    pub resampling_psnr_db: f64,
    /// Directional-hemispherical reflectances: `theta_i`, `phi_i` in degrees, then R, G, B.
    pub reflectance: Vec<[f32; 5]>,
}

impl<'a> Description<'a> {
    pub fn new(task: &ExportTask<'a>, resampling: Errors) -> Self {
        let meta = task.meta;
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
            base_area: task.brdf.base_area,
            resampling_rel_l2: resampling.rel_l2,
            resampling_psnr_db: resampling.psnr_db,
            reflectance: Reflectances::of(task.brdf).rows(),
        }
    }

    /// Returns one JSON object with the keys in the order of the fields.
    pub fn json(&self) -> std::io::Result<String> {
        Ok(serde_json::to_string(self)?)
    }

    /// Returns one line `key: value` per field.
    pub fn lines(&self) -> std::io::Result<Vec<String>> {
        let value = serde_json::to_value(self)?;
        let fields = value.as_object().into_iter().flatten();
        Ok(fields
            .map(|(key, value)| match value {
                // A line break would end a comment.
                serde_json::Value::String(text) => {
                    format!("{key}: {}", text.replace(['\n', '\r'], " "))
                }
                other => format!("{key}: {other}"),
            })
            .collect())
    }
}
