//! Images of scenes with a slab, which the CPU renders.

use std::sync::Arc;
use std::time::Instant;

use crate::base::{Cancel, Result};
use crate::plan::{Preset, Settings};
use crate::render::image::tone_map::ToneMap;
use crate::render::seen_through::SlabScene;
use crate::render::{RenderScene, Rendered};

use super::gpu_drafts::as_preset;
use super::image_worker::{ImageWorker, camera, ms};
use super::rendered_preview::{DisplayImage, Grade, ImageJob, RenderedPreview};
use super::tone::color_image;

impl ImageWorker {
    /// Renders the slab of a job: a draft, or the image of the scene's own quality. Returns the warnings of the slab as well.
    pub(super) fn render_slab(
        &mut self,
        job: &ImageJob,
        grade: Grade,
        size: [usize; 2],
        cancel: &Cancel,
    ) -> Result<(RenderedPreview, Vec<String>)> {
        let is_draft = grade == Grade::Draft;
        let loaded = if is_draft { as_preset(&job.loaded, Preset::Draft) } else { (*job.loaded).clone() };
        let outcome = self.pipeline.slab(&loaded)?;
        let render_scene = RenderScene::with(&self.pipeline, &loaded)?;
        let scene = SlabScene::with(&self.pipeline, &loaded, &outcome, &render_scene)?;
        let samples = if is_draft { 1 } else { 2 };
        let Rendered { image, times, .. } = scene.render(&render_scene, size, samples, cancel)?;
        let camera = camera(&loaded);
        let start = Instant::now();
        let shown = DisplayImage::Pixels(Arc::new(color_image(&image, &ToneMap::new(&camera)?)));
        let mut stages = outcome.times.clone();
        stages.extend([("g-buffer", times.gbuffer_ms), ("shading", times.shading_ms), ("tone", ms(start))]);
        let preview = RenderedPreview {
            version: job.version,
            grade,
            radiance: Some(Arc::new(image)),
            image: shown,
            brdf: None,
            stages,
            latency_ms: ms(job.submitted),
            rendered_on: "CPU".to_owned(),
            gpu_error: None,
            distance: self.renderer.distance(&camera, size),
            notes: [self.renderer.warnings(), scene.warnings(&render_scene)?].concat(),
            lit_object: Some(render_scene),
            camera,
            effects: outcome.effects.clone(),
            preset: Settings::of(&loaded.scene).preset.name(),
        };
        Ok((preview, outcome.health.warnings.clone()))
    }
}
