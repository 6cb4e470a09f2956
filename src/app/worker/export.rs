//! Exports in the background: at the scene's own quality, with progress, and they can be given up.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::base::{Cancel, Error, Progress, Result};
use crate::cache::Cache;
use crate::export::tile::TileOptions;
use crate::export::{ExportMeta, ExportOptions, ExportResolution, RadianceBasis};
use crate::fit::Model;
use crate::geometry::TileMesh;
use crate::pipeline::{Outcome, Pipeline};
use crate::render::image::tone_map::ToneMap;
use crate::render::tile_view::CloseUp;
use crate::scene::LoadedScene;
use crate::{export, fit};

use super::runner::Desk;
use super::studio::{Close, ImageStudio, Shot, Worn};

#[derive(Debug, Clone)]
pub struct ExportJob {
    pub loaded: Arc<LoadedScene>,
    pub path: PathBuf,
    pub what: What,
}

/// What the dialog asks about a table.
#[derive(Debug, Clone, Copy)]
pub struct TableChoice {
    /// Steps from the normal to the horizon, and around, for files whose grid is free.
    pub theta: usize,
    pub phi: usize,
    /// Of an RGL file: elevations and azimuths of slices, samples along both sides of one; by itself where absent.
    pub rgl: Option<[usize; 4]>,
    /// What a Radiance file holds.
    pub radiance: RadianceBasis,
    /// Cells along a side of a tensor tree.
    pub tree: usize,
}

impl TableChoice {
    /// The grid that a file of this name gets; absent where the format has its own.
    pub fn resolution(&self, path: &Path) -> Option<ExportResolution> {
        let of = |[theta_i, phi_i, theta_o, phi_o]: [usize; 4]| ExportResolution { theta_i, phi_i, theta_o, phi_o };
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
        match ending.as_str() {
            _ if export::grid_is_free(path) => Some(of([self.theta, self.phi, self.theta, self.phi])),
            "bsdf" => self.rgl.map(of),
            "xml" if self.radiance == RadianceBasis::TensorTree => Some(of([self.tree; 4])),
            _ => None,
        }
    }
}

impl Default for TableChoice {
    fn default() -> Self {
        Self { theta: 16, phi: 64, rgl: None, radiance: RadianceBasis::Klems, tree: 32 }
    }
}

#[derive(Debug, Clone)]
pub enum What {
    Table(TableChoice),
    /// A few parameters, glTF or MaterialX by the ending.
    Fit,
    Tile(TileOptions),
    Image {
        size: [usize; 2],
    },
}

pub enum ExportAnswer {
    /// The part that is done, 0 to 1, and what is being done.
    Progress(f32, &'static str),
    Done(String),
    Failed(String),
    Cancelled,
}

pub fn work(job: &ExportJob, cache: &Cache, desk: &Desk<ExportJob>, answer: &(dyn Fn(ExportAnswer) + Sync)) {
    answer(match export(job, cache, desk.cancel, answer) {
        Ok(text) => ExportAnswer::Done(text),
        Err(Error::Cancelled) => ExportAnswer::Cancelled,
        Err(error) => ExportAnswer::Failed(error.to_string()),
    });
}

fn export(job: &ExportJob, cache: &Cache, cancel: &Cancel, answer: &(dyn Fn(ExportAnswer) + Sync)) -> Result<String> {
    answer(ExportAnswer::Progress(0.0, "Computing the material"));
    let mut pipeline = Pipeline::new();
    pipeline.cancel_with(cancel.clone());
    pipeline.set_cache(cache.clone());
    // Each is told as a part of what it is called.
    let telling = |what: &'static str| {
        move |part: f32| {
            answer(ExportAnswer::Progress(part, what));
            !cancel.is_set()
        }
    };
    if let What::Tile(options) = &job.what {
        return tile(job, &pipeline.mesh(&job.loaded)?, options, &telling("Writing the tile"));
    }
    let outcome = pipeline.effective(&job.loaded)?;
    match job.what {
        What::Tile(_) | What::Fit => fitted(job, &outcome, &telling("Fitting")),
        What::Table(choice) => {
            let meta = ExportMeta::of(&job.loaded, &outcome, pipeline.mesh(&job.loaded)?.closes_plane);
            let options = ExportOptions { resolution: choice.resolution(&job.path), radiance: choice.radiance };
            let report = export::write(&outcome.brdf, &meta, &options, &job.path, &telling("Tabulating"))?;
            Ok(format!(
                "Wrote {}: {} pairs; read back it is within {:.1} % of the material.",
                job.path.display(),
                report.pairs,
                100.0 * report.reading.errors.rel_l2
            ))
        }
        What::Image { size } => {
            answer(ExportAnswer::Progress(0.3, "Rendering"));
            let tile = CloseUp::new(Arc::new(pipeline.mesh(&job.loaded)?));
            let close = (tile, pipeline.sum_materials(&job.loaded)?);
            image(&job.loaded, &outcome, size, &job.path, &close, cancel)?;
            Ok(format!("Wrote {}.", job.path.display()))
        }
    }
}

/// The GGX base with a matte part, which both formats hold.
fn fitted(job: &ExportJob, outcome: &Outcome, progress: &Progress<'_>) -> Result<String> {
    let model = *Model::ALL.last().ok_or_else(|| Error::failed("no model to fit"))?;
    let fit = fit::fit(&outcome.brdf, model, progress)?;
    let is_gltf = job.path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gltf"));
    let text = if is_gltf { fit::gltf(&fit, &job.loaded.name) } else { fit::materialx(&fit, &job.loaded.name) };
    crate::base::replace_file(&job.path, text.as_bytes())?;
    Ok(format!(
        "Wrote {}: {}; the few parameters are {:.1} % from the material ({:.1} dB). A table keeps all of it.",
        job.path.display(),
        model.name(),
        100.0 * fit.errors.rel_l2,
        fit.errors.psnr_db
    ))
}

fn tile(job: &ExportJob, mesh: &TileMesh, options: &TileOptions, progress: &Progress<'_>) -> Result<String> {
    let notes = export::tile::write(&job.loaded.scene, mesh, options, &job.path, progress)?;
    Ok(format!("Wrote {}: {}.", job.path.display(), notes.join("; ")))
}

fn image(
    loaded: &LoadedScene,
    outcome: &Outcome,
    size: [usize; 2],
    path: &Path,
    close: &Close,
    cancel: &Cancel,
) -> Result<()> {
    let camera = loaded.scene.camera.clone().unwrap_or_default();
    let mut studio = ImageStudio::default();
    studio.prepare(loaded)?;
    let backend = loaded.scene.quality.backend.as_str();
    let shot =
        Shot { camera: &camera, material: Worn::Known(outcome), size, samples_per_side: 3, settle: true, backend };
    let (rendered, _) = studio.shoot(&shot, Some(close), cancel)?;
    rendered.image.write(path, &ToneMap::new(&camera)?)
}
