//! Thumbnails of shipped scenes and of variants of the open scene, one per job.

use std::sync::Arc;

use crate::base::Result;
use crate::pipeline::Pipeline;
use crate::render::RenderScene;
use crate::render::image::tone_map::ToneMap;
use crate::render::seen_through::SlabScene;
use crate::scene::{self, LoadedScene, Quality};
use eframe::egui::ColorImage;

use super::preview_renderer::{PreviewRenderer, RenderRequest, ShadedMaterial};
use super::runner::JobContext;
use super::tone::color_image;

/// Side of a thumbnail in pixels.
pub const SIDE: usize = 112;
/// Maximum number of directional lights that replace an environment.
const LIGHTS: usize = 12;

/// A scene to render.
#[derive(Debug, Clone)]
pub enum ThumbnailJob {
    Shipped(&'static str),
    /// Variant `at` of those that were drawn with `seed`.
    Variant {
        seed: u64,
        at: usize,
        loaded: Box<LoadedScene>,
    },
}

/// Thumbnail of a job; `image` is absent if the scene cannot be rendered.
pub struct SceneThumbnail {
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
    report: &dyn Fn(SceneThumbnail),
) {
    let image = render(worker, &job, context);
    // The gallery submits a cancelled thumbnail again.
    if !context.cancel.is_set() {
        report(SceneThumbnail { job, image: image.ok().map(Arc::new) });
    }
}

fn render(worker: &mut ThumbnailWorker, job: &ThumbnailJob, context: &JobContext<ThumbnailJob>) -> Result<ColorImage> {
    let mut loaded = match job {
        ThumbnailJob::Shipped(name) => scene::open(name, &[])?,
        ThumbnailJob::Variant { loaded, .. } => (**loaded).clone(),
    };
    loaded.scene.quality =
        Quality { preset: "draft".to_owned(), backend: "cpu".to_owned(), facets: Some(1024), ..Quality::default() };
    loaded.scene.light.count = loaded.scene.light.count.min(LIGHTS);
    let ThumbnailWorker { pipeline, renderer } = worker;
    pipeline.set_cancel(context.cancel.clone());
    if loaded.scene.slab.is_some() {
        let outcome = pipeline.slab(&loaded)?;
        let render_scene = RenderScene::with(pipeline, &loaded)?;
        let scene = SlabScene::with(pipeline, &loaded, &outcome, &render_scene)?;
        let rendered = scene.render(&render_scene, [SIDE, SIDE], 2, context.cancel)?;
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
    let (rendered, _) = renderer.render(pipeline, &request, None, context.cancel)?;
    Ok(color_image(&rendered.image, &ToneMap::new(&camera)?))
}
