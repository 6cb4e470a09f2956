//! Thumbnails of shipped scenes, of choices and of variants of the open scene, one per job.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use crate::base::{Cancel, Result};
use crate::brdf::MaterialAssignment;
use crate::pipeline::Pipeline;
use crate::render::RenderScene;
use crate::render::image::tone_map::{ToneCurve, ToneMap};
use crate::render::seen_through::SlabScene;
use crate::render::tile_view::{ShadedMaterials, TileScene, TileShading, TileView};
use crate::scene::{self, LoadedScene, Painted, Quality};
use eframe::egui::ColorImage;
use glam::Vec3;

use super::preview_renderer::{PreviewRenderer, RenderRequest, ShadedMaterial};
use super::runner::JobContext;
use super::tile_image_worker::{TILE_AZIMUTH_DEG, TILE_ELEVATION_DEG};
use super::tone::color_image;

/// Side of a thumbnail in pixels.
pub const SIDE: usize = 112;
/// Maximum number of directional lights that replace an environment.
const LIGHTS: usize = 12;

/// Subject of a thumbnail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Subject {
    /// A shipped scene.
    Scene(&'static str),
    /// A tile of this kind with the initial parameters.
    Surface(&'static str),
    /// A sphere of this BRDF model with the initial parameters.
    Brdf(&'static str),
    /// A sphere of rough metal in this environment.
    Environment(&'static str),
    /// This object in matte grey.
    Object(&'static str),
}

/// A thumbnail to render.
#[derive(Debug, Clone)]
pub enum ThumbnailJob {
    Subject(Subject),
    /// Variant `at` of those that were drawn with `seed`.
    Variant {
        seed: u64,
        at: usize,
        loaded: Box<LoadedScene>,
    },
}

/// Thumbnail of a job; `image` is absent if the scene cannot be rendered, for instance because a choice needs a file.
pub struct Thumbnail {
    pub job: ThumbnailJob,
    pub image: Option<Arc<ColorImage>>,
}

/// The pipeline and the renderer of the thumbnails, which share one environment.
pub struct ThumbnailWorker {
    pipeline: Pipeline,
    renderer: PreviewRenderer,
}

impl Default for ThumbnailWorker {
    fn default() -> Self {
        Self { pipeline: crate::gpu::pipeline(), renderer: PreviewRenderer::default() }
    }
}

pub fn work(
    worker: &mut ThumbnailWorker,
    job: ThumbnailJob,
    context: &JobContext<ThumbnailJob>,
    report: &dyn Fn(Thumbnail),
) {
    // A fault must not keep other thumbnails waiting.
    let image = catch_unwind(AssertUnwindSafe(|| render(worker, &job, context.cancel)));
    if image.is_err() {
        *worker = ThumbnailWorker::default();
    }
    // A cancelled thumbnail is submitted again.
    if !context.cancel.is_set() {
        report(Thumbnail { job, image: image.ok().and_then(Result::ok).map(Arc::new) });
    }
}

fn render(worker: &mut ThumbnailWorker, job: &ThumbnailJob, cancel: &Cancel) -> Result<ColorImage> {
    let mut loaded = match job {
        ThumbnailJob::Subject(Subject::Scene(name)) => scene::open(name, &[])?,
        ThumbnailJob::Subject(Subject::Surface(kind)) => return surface(&mut worker.pipeline, kind, cancel),
        ThumbnailJob::Subject(subject) => choice(*subject)?,
        ThumbnailJob::Variant { loaded, .. } => (**loaded).clone(),
    };
    loaded.scene.quality =
        Quality { preset: "draft".to_owned(), backend: "cpu".to_owned(), facets: Some(1024), ..Quality::default() };
    loaded.scene.light.count = loaded.scene.light.count.min(LIGHTS);
    let ThumbnailWorker { pipeline, renderer } = worker;
    pipeline.set_cancel(cancel.clone());
    if loaded.scene.slab.is_some() {
        let outcome = pipeline.slab(&loaded)?;
        let render_scene = RenderScene::with(pipeline, &loaded)?;
        let scene = SlabScene::with(pipeline, &loaded, &outcome, &render_scene)?;
        let rendered = scene.render(&render_scene, [SIDE, SIDE], 2, cancel)?;
        return Ok(color_image(&rendered.image, &ToneMap::new(&render_scene.camera)?));
    }
    let outcome = pipeline.effective(&loaded)?;
    renderer.prepare(pipeline, &loaded)?;
    let camera = loaded.scene.camera.clone().unwrap_or_default();
    let request = RenderRequest {
        camera: &camera,
        material: ShadedMaterial::Outcome(&outcome),
        bounced: None,
        size: [SIDE, SIDE],
        samples_per_side: 2,
        build_caches: false,
        backend: "cpu",
    };
    let (rendered, _) = renderer.render(pipeline, &request, None, cancel)?;
    Ok(color_image(&rendered.image, &ToneMap::new(&camera)?))
}

/// Returns the scene that shows a choice of a BRDF, an environment or an object.
fn choice(subject: Subject) -> Result<LoadedScene> {
    let (mut brdf, mut environment, mut object) = ("kind = \"lambertian\"".to_owned(), "studio", "sphere");
    match subject {
        Subject::Brdf(kind) => brdf = format!("kind = \"{kind}\""),
        Subject::Environment(name) => {
            brdf = "kind = \"ggx\", roughness = 0.3, f0 = 0.9".to_owned();
            environment = name;
        }
        Subject::Object(kind) => object = kind,
        Subject::Scene(_) | Subject::Surface(_) => {}
    }
    loaded(&format!(
        "[tile]\ngeometry = {{ kind = \"flat\" }}\n[[material]]\nname = \"default\"\nbrdf = {{ {brdf} }}\n\
         [object]\nkind = \"{object}\"\n[light]\nenvironment = \"{environment}\"\n"
    ))
}

fn loaded(text: &str) -> Result<LoadedScene> {
    Ok(LoadedScene {
        scene: scene::parse(text)?,
        base_dir: "".into(),
        name: "choice".into(),
        painted: Painted::default(),
    })
}

/// Renders a tile of a kind with its initial parameters.
fn surface(pipeline: &mut Pipeline, kind: &str, cancel: &Cancel) -> Result<ColorImage> {
    let more = if kind == "heightfield" { ", path = \"asset:leather.png\", height_scale = 0.1" } else { "" };
    let loaded = loaded(&format!("[tile]\ngeometry = {{ kind = \"{kind}\"{more} }}\n"))?;
    pipeline.set_cancel(cancel.clone());
    let tile = TileScene::new(Arc::new(pipeline.mesh(&loaded)?));
    let MaterialAssignment { material_of_slot, materials } = pipeline.materials(&loaded)?;
    let materials = ShadedMaterials { material_of_slot: &material_of_slot, materials: &materials };
    let view = TileView {
        azimuth: TILE_AZIMUTH_DEG.to_radians(),
        elevation: TILE_ELEVATION_DEG.to_radians(),
        center: 0.5 * loaded.scene.tile.size,
        span: 1.2,
        // Twice as many pixels as are shown, because a tile image has one sample per pixel.
        size: [2 * SIDE; 2],
    };
    let image = tile.image(&view, &TileShading::Clay, materials, Vec3::splat(0.02), cancel)?;
    Ok(color_image(&image, &ToneMap { curve: ToneCurve::Plain, gain: 1.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, OBJECT_KINDS, TermSpec};

    #[test]
    fn every_choice_that_needs_no_file_has_an_image() {
        let mut worker = ThumbnailWorker::default();
        let surfaces = Geometry::kinds().iter().map(|kind| Subject::Surface(kind.kind)).collect::<Vec<_>>();
        let brdfs = TermSpec::kinds().iter().map(|kind| Subject::Brdf(kind.kind)).collect::<Vec<_>>();
        let objects = OBJECT_KINDS.iter().copied().map(Subject::Object);
        let skies = ["studio", "clear_sky", "overcast_sky", "sun", "none"].map(Subject::Environment);
        let mut without = Vec::new();
        for subject in surfaces.into_iter().chain(brdfs).chain(objects).chain(skies) {
            match render(&mut worker, &ThumbnailJob::Subject(subject), &Cancel::default()) {
                Ok(image) => {
                    let [first, ..] = image.pixels[..] else { panic!("an empty image") };
                    let is_uniform = image.pixels.iter().all(|pixel| *pixel == first);
                    // A level tile fills its image evenly.
                    assert_eq!(is_uniform, subject == Subject::Surface("flat"), "{subject:?}");
                }
                Err(_) => without.push(subject),
            }
        }
        let files = ["merl", "rgl", "utia", "npz"].map(Subject::Brdf);
        let expected = [Subject::Surface("mesh")].into_iter().chain(files).chain([Subject::Object("mesh")]);
        assert_eq!(without, expected.collect::<Vec<_>>());
    }
}
