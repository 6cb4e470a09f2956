//! Exports in the background, at the scene's own quality, with progress and cancellation.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::base::{Cancel, Error, Progress, Result, check_output};
use crate::cache::Cache;
use crate::export::slab::SlabFormat;
use crate::export::tile::TileOptions;
use crate::export::{ExportMeta, ExportOptions, ExportResolution, RadianceBasis};
use crate::fit::Model;
use crate::geometry::TileMesh;
use crate::pipeline::{Outcome, Pipeline};
use crate::render::RenderScene;
use crate::render::image::tone_map::ToneMap;
use crate::render::seen_through::SlabScene;
use crate::render::tile_view::TileScene;
use crate::scene::LoadedScene;
use crate::{export, fit};

use super::preview_renderer::{CloseUpTile, PreviewRenderer, RenderRequest, ShadedMaterial};
use super::runner::JobContext;

/// Samples along each side of a pixel of an exported image.
const SAMPLES_PER_SIDE: usize = 3;

/// A file to export.
#[derive(Debug, Clone)]
pub struct ExportJob {
    pub loaded: Arc<LoadedScene>,
    /// The file of the scene, if it has one.
    pub scene_file: Option<PathBuf>,
    pub path: PathBuf,
    pub kind: ExportKind,
}

/// Settings of a table that the dialog offers.
#[derive(Debug, Clone, Copy)]
pub struct TableChoice {
    /// Steps from the normal to the horizon, for files with a free grid.
    pub theta: usize,
    /// Steps around the normal, for files with a free grid.
    pub phi: usize,
    /// Elevations and azimuths of the slices of an RGL file, and samples along both sides of a slice; optional.
    pub rgl: Option<[usize; 4]>,
    /// Basis of a Radiance file.
    pub radiance: RadianceBasis,
    /// Cells along each side of a tensor tree.
    pub tree: usize,
}

impl TableChoice {
    /// The grid of a file with this name; absent if the format has a fixed grid.
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

/// Content of an exported file.
#[derive(Debug, Clone)]
pub enum ExportKind {
    Table(TableChoice),
    /// Parameters of an analytic model, as glTF or MaterialX depending on the file's extension.
    Fit,
    Tile(TileOptions),
    Image {
        size: [usize; 2],
    },
}

/// A report of the worker that exports.
pub enum ExportResult {
    /// The finished fraction, 0 to 1, and the current work.
    Progress(f32, &'static str),
    Done(String),
    Failed(String),
    Cancelled,
}

pub fn work(job: &ExportJob, cache: &Cache, context: &JobContext<ExportJob>, report: &(dyn Fn(ExportResult) + Sync)) {
    report(match export(job, cache, context.cancel, report) {
        Ok(text) => ExportResult::Done(text),
        Err(Error::Cancelled) => ExportResult::Cancelled,
        Err(error) => ExportResult::Failed(error.to_string()),
    });
}

fn export(job: &ExportJob, cache: &Cache, cancel: &Cancel, report: &(dyn Fn(ExportResult) + Sync)) -> Result<String> {
    check_places(job)?;
    report(ExportResult::Progress(0.0, "Computing the material"));
    let mut pipeline = crate::gpu::pipeline();
    pipeline.set_cancel(cancel.clone());
    pipeline.set_cache(cache.clone());
    let progress = |task| progress(task, cancel, report);
    if let ExportKind::Tile(options) = &job.kind {
        return tile(job, &pipeline.mesh(&job.loaded)?, options, &progress("Writing the tile"));
    }
    if job.loaded.scene.slab.is_some() {
        return of_slab(job, &pipeline, cancel, report);
    }
    let outcome = pipeline.effective(&job.loaded)?;
    match job.kind {
        ExportKind::Tile(_) | ExportKind::Fit => fitted(job, &outcome, &progress("Fitting")),
        ExportKind::Table(choice) => {
            let meta = ExportMeta::of(&job.loaded, &outcome, pipeline.mesh(&job.loaded)?.closes_plane);
            let options = ExportOptions { resolution: choice.resolution(&job.path), radiance: choice.radiance };
            let written = export::write(&outcome.brdf, &meta, &options, &job.path, &progress("Tabulating"))?;
            Ok(format!(
                "Wrote {}: {} pairs. Read back, the table differs from the material by {:.1} %.",
                job.path.display(),
                written.pairs,
                100.0 * written.reading.errors.rel_l2
            ))
        }
        ExportKind::Image { size } => {
            report(ExportResult::Progress(0.3, "Rendering"));
            let tile = TileScene::new(Arc::new(pipeline.mesh(&job.loaded)?));
            let close = (tile, pipeline.materials(&job.loaded)?);
            image(&pipeline, &job.loaded, &outcome, size, &job.path, &close, cancel)?;
            Ok(format!("Wrote {}.", job.path.display()))
        }
    }
}

/// A progress function that names the current work.
fn progress<'a>(
    task: &'static str,
    cancel: &'a Cancel,
    report: &'a (dyn Fn(ExportResult) + Sync),
) -> impl Fn(f32) -> bool + Sync + 'a {
    move |fraction| {
        report(ExportResult::Progress(fraction, task));
        !cancel.is_set()
    }
}

/// Exports the material or the image of a scene with a slab.
fn of_slab(
    job: &ExportJob,
    pipeline: &Pipeline,
    cancel: &Cancel,
    report: &(dyn Fn(ExportResult) + Sync),
) -> Result<String> {
    let (loaded, path) = (&*job.loaded, &job.path);
    let format = if matches!(job.kind, ExportKind::Table(_)) { Some(SlabFormat::of(path)?) } else { None };
    if format == Some(SlabFormat::Mitsuba) {
        export::mitsuba::check(loaded)?;
    }
    let outcome = pipeline.slab(loaded)?;
    let wrote = format!("Wrote {}", path.display());
    Ok(match (&job.kind, format) {
        (ExportKind::Table(choice), Some(format)) => {
            let options = ExportOptions { resolution: choice.resolution(path), radiance: choice.radiance };
            let written =
                format.write(&outcome.slab, loaded, &options, path, &progress("Tabulating", cancel, report))?;
            if written.pairs > 0 { format!("{wrote}: {} pairs.", written.pairs) } else { format!("{wrote}.") }
        }
        (ExportKind::Image { size }, _) => {
            report(ExportResult::Progress(0.3, "Rendering"));
            let render_scene = RenderScene::with(pipeline, loaded)?;
            let scene = SlabScene::with(pipeline, loaded, &outcome, &render_scene)?;
            let rendered = scene.render(&render_scene, *size, SAMPLES_PER_SIDE, cancel)?;
            rendered.image.write(path, &ToneMap::new(&render_scene.camera)?)?;
            format!("{wrote}.")
        }
        _ => {
            let fit = fit::fit_slab(&outcome.slab, &progress("Fitting", cancel, report))?;
            let (write, name) = (if is_gltf(path) { fit::thin_gltf } else { fit::thin_materialx }, &loaded.name);
            crate::base::replace_file(path, write(&fit, name).as_bytes())?;
            let (percent, db) = (100.0 * fit.errors.rel_l2, fit.errors.psnr_db);
            format!("{wrote}: a thin rough surface. The fit differs from the slab by {percent:.1} % (PSNR {db:.1} dB).")
        }
    })
}

/// Checks that the files of an export can be written and that they replace neither the scene nor a file that it names.
fn check_places(job: &ExportJob) -> Result<()> {
    let outputs = match job.kind {
        ExportKind::Table(_) => export::outputs(&job.path)?,
        _ => vec![job.path.clone()],
    };
    let inputs: Vec<PathBuf> = job.loaded.files().into_iter().chain(job.scene_file.clone()).collect();
    outputs.iter().try_for_each(|output| check_output(output, &inputs))
}

/// Fits the GGX base with a diffuse part, which both formats support.
fn fitted(job: &ExportJob, outcome: &Outcome, progress: &Progress<'_>) -> Result<String> {
    let model = *Model::ALL.last().ok_or_else(|| Error::failed("no model to fit"))?;
    let fit = fit::fit(&outcome.brdf, model, progress)?;
    let text =
        if is_gltf(&job.path) { fit::gltf(&fit, &job.loaded.name) } else { fit::materialx(&fit, &job.loaded.name) };
    crate::base::replace_file(&job.path, text.as_bytes())?;
    Ok(format!(
        "Wrote {}: {}. The fit differs from the material by {:.1} % (PSNR {:.1} dB); a table is more accurate.",
        job.path.display(),
        model.name(),
        100.0 * fit.errors.rel_l2,
        fit.errors.psnr_db
    ))
}

fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gltf"))
}

fn tile(job: &ExportJob, mesh: &TileMesh, options: &TileOptions, progress: &Progress<'_>) -> Result<String> {
    let notes = export::tile::write(&job.loaded.scene, mesh, options, &job.path, progress)?;
    Ok(format!("Wrote {}: {}.", job.path.display(), notes.join("; ")))
}

fn image(
    pipeline: &Pipeline,
    loaded: &LoadedScene,
    outcome: &Outcome,
    size: [usize; 2],
    path: &Path,
    close: &CloseUpTile,
    cancel: &Cancel,
) -> Result<()> {
    let camera = loaded.scene.camera.clone().unwrap_or_default();
    let mut renderer = PreviewRenderer::default();
    renderer.prepare(pipeline, loaded)?;
    let backend = loaded.scene.quality.backend.as_str();
    let request = RenderRequest {
        camera: &camera,
        material: ShadedMaterial::Outcome(outcome),
        bounced: None,
        size,
        samples_per_side: SAMPLES_PER_SIDE,
        build_caches: true,
        backend,
    };
    let (rendered, _) = renderer.render(pipeline, &request, Some(close), cancel)?;
    rendered.image.write(path, &ToneMap::new(&camera)?)
}
