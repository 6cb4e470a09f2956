//! The object's image: a draft at once, then the scene's own quality once the user pauses.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::base::{Cancel, Error, Result};
use crate::cache::Cache;
use crate::pipeline::{Outcome, Pipeline};
use crate::plan::Preset;
use crate::render::image::tone_map::ToneMap;
use crate::render::tile_view::TileScene;
use crate::scene::{Camera, LoadedScene};

use super::draft_detail::{DRAFT_MS, DraftDetail, KEPT_SURFACE_MS};
use super::finished_image::{finished, state_error};
use super::gpu_drafts::{GpuDrafts, as_preset};
use super::pixel_costs::{PixelCosts, Shading, fitting};
use super::preview_renderer::{CloseUpTile, KnownPoints, PreviewRenderer, RenderRequest, ShadedMaterial};
use super::rendered_preview::{DisplayImage, Grade, ImageJob, ImageResult, RenderedPreview};
use super::runner::JobContext;
use super::shared::{SharedState, SmallScale, lock, small_scale};
use super::tone::color_image;

/// Time of the final image [ms] below which no intermediate image delays it.
const QUICK_FINAL_MS: f64 = 700.0;
/// Time limit for shading the final image [ms]. An exported image has no limit.
const FINAL_MS: f64 = 8000.0;
/// Maximum number of pixels of an image on the CPU and on the GPU. A larger view shows the image enlarged.
const MAX_PIXELS: [f64; 2] = [768.0 * 768.0, 3840.0 * 2160.0];
/// Time after which a newer edit cancels a draft. Quicker drafts are all shown, so that the image follows the edits.
const DRAFT_CANCEL_DELAY: Duration = Duration::from_millis(700);
/// Interval at which refinement checks whether the draft has ended.
const POLL: Duration = Duration::from_millis(5);
/// Time without a new edit after which refinement begins.
pub(super) const PAUSE: Duration = Duration::from_millis(60);
/// Time of a stage [ms] below which it is not stated.
const MIN_STAGE_MS: f64 = 0.005;
/// Stage that computes visibility and facet sum on the GPU.
const SUM_STAGE: &str = "visibility and product";

/// The state of a worker that renders the object. One worker drafts, another one refines.
pub struct ImageWorker {
    pub(super) shared: Arc<SharedState>,
    pub(super) pipeline: Pipeline,
    pub(super) renderer: PreviewRenderer,
    /// The tile, while the camera is so close that the tile itself is visible.
    close: Option<(SmallScale, CloseUpTile)>,
    costs: PixelCosts,
    gpu_drafts: GpuDrafts,
    detail: DraftDetail,
    /// Backend of the next image: the scene's setting, or `cpu` until the window reports the GPUs.
    backend: String,
}

impl ImageWorker {
    pub fn new(shared: Arc<SharedState>, cache: &Cache) -> Self {
        let (mut pipeline, renderer) = (crate::gpu::pipeline(), PreviewRenderer::default());
        pipeline.set_cache(cache.clone());
        Self {
            shared,
            pipeline,
            renderer,
            close: None,
            costs: PixelCosts::default(),
            gpu_drafts: GpuDrafts::default(),
            detail: DraftDetail::default(),
            backend: String::new(),
        }
    }

    /// Renders a draft: with the refined BRDF if it is cached, else with a draft of the BRDF.
    pub fn draft(&mut self, job: &ImageJob, context: &JobContext<ImageJob>, report: &dyn Fn(ImageResult)) {
        let shared = self.shared.clone();
        let _guard = shared.draft_guard(job.version);
        let done = self.retone(job).and_then(|preview| match preview {
            Some(preview) => Ok(preview),
            None => self.render_draft(job, &context.cancel.after(DRAFT_CANCEL_DELAY)),
        });
        report_error(job, done.map(|preview| report(ImageResult::Rendered(Box::new(preview)))), report);
    }

    fn render_draft(&mut self, job: &ImageJob, cancel: &Cancel) -> Result<RenderedPreview> {
        let start = Instant::now();
        self.pipeline.set_cancel(cancel.clone());
        self.choose_backend(job, false);
        self.renderer.prepare(&self.pipeline, &job.loaded)?;
        if job.loaded.scene.slab.is_some() {
            return Ok(self.render_slab(job, Grade::Draft, fitting(job.size, MAX_PIXELS[0]), cancel)?.0);
        }
        if let Some(outcome) = self.shared.known(&job.loaded) {
            let outcome = outcome.without_times();
            if !self.is_on_gpu() {
                outcome.shading_brdf(cancel)?;
            }
            let shading = self.refined_shading(&outcome);
            let size = self.affordable(job, shading, DraftDetail::shading_ms(DRAFT_MS, start));
            return self.render(job, ShadedMaterial::Outcome(&outcome), shading, size, 1, cancel);
        }
        if let Some(preview) = self.render_gpu_draft(job, cancel)? {
            return Ok(preview);
        }
        let mut draft = as_preset(&job.loaded, Preset::Draft);
        draft.scene.quality.facets = self.detail.facets();
        let material_start = Instant::now();
        let outcome = self.pipeline.effective(&draft).and_then(|outcome| {
            if !self.is_on_gpu() {
                outcome.shading_brdf(cancel)?;
            }
            Ok(outcome)
        });
        let has_new_surface = |outcome: &Outcome| outcome.times.iter().any(|(name, _)| *name == "visibility");
        let mut limit = KEPT_SURFACE_MS;
        if outcome.as_ref().map_or(true, has_new_surface) {
            self.detail.record(ms(material_start));
            limit = DRAFT_MS;
        }
        let outcome = outcome?;
        let size = self.affordable(job, Shading::Draft, DraftDetail::shading_ms(limit, start));
        self.render(job, ShadedMaterial::Outcome(&outcome), Shading::Draft, size, 1, cancel)
    }

    /// Renders a draft whose visibility and facet sum the GPU computes, at the finest level that meets the time limit.
    fn render_gpu_draft(&mut self, job: &ImageJob, cancel: &Cancel) -> Result<Option<RenderedPreview>> {
        let shows_tile =
            has_analytic_surface(&job.loaded) || self.renderer.is_close(&camera(&job.loaded), job.size, false);
        if !self.is_on_gpu() || shows_tile {
            return Ok(None);
        }
        let Some(tile) = self.gpu_drafts.tile(&job.loaded, &mut self.pipeline)? else { return Ok(None) };
        let size = self.affordable(job, Shading::Draft, DRAFT_MS);
        let preview = match self.render(job, ShadedMaterial::GpuTile(&tile), Shading::Draft, size, 1, cancel) {
            Ok(preview) => preview,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            // The GPU does not support this tile, or failed.
            Err(_) => return Ok(None),
        };
        // Without a table, the shading time grows with the sum.
        let counted: &[&str] = if tile.input.nodes.is_some() { &[SUM_STAGE] } else { &[SUM_STAGE, "shading"] };
        let counted: Vec<f64> =
            preview.stages.iter().filter(|(name, _)| counted.contains(name)).map(|(_, ms)| *ms).collect();
        if preview.stages.iter().any(|(name, _)| *name == SUM_STAGE) {
            self.gpu_drafts.record(counted.iter().sum());
        }
        Ok(Some(preview))
    }

    /// Returns true if a hardware GPU renders the images.
    fn is_on_gpu(&self) -> bool {
        self.backend != "cpu" && self.renderer.is_hardware()
    }

    /// Chooses the backend. Only a worker that `can_wait` opens a GPU before the window reports the GPUs.
    fn choose_backend(&mut self, job: &ImageJob, can_wait: bool) {
        let gpu_share = self.shared.gpu_share.get();
        if let Some(gpu_share) = gpu_share {
            if let Some(name) = &gpu_share.only_software {
                self.renderer.exclude_software(name);
            }
            self.renderer.set_screen(gpu_share.screen.as_ref());
            if let Some(screen) = gpu_share.screen.as_ref().filter(|screen| screen.is_hardware) {
                self.pipeline.set_gpu(screen.gpu.clone());
            }
        }
        let requested = &*job.loaded.scene.quality.backend;
        let known = gpu_share.is_some() || can_wait;
        self.backend = if !known && requested == "auto" { "cpu" } else { requested }.to_owned();
        let may_have_gpu = gpu_share.map_or(can_wait, |gpu_share| gpu_share.only_software.is_none());
        self.pipeline.allow_gpu(requested == "gpu" || may_have_gpu);
    }

    /// Renders at the scene's own quality once the user pauses. A newer job cancels it.
    pub fn refine(&mut self, job: &ImageJob, context: &JobContext<ImageJob>, report: &dyn Fn(ImageResult)) {
        let mut is_newest = context.is_newest_after(PAUSE);
        // Both workers use all cores, and the user waits for the draft.
        while is_newest && !self.shared.is_drafted(job.version) {
            is_newest = context.is_newest_after(POLL);
        }
        if is_newest {
            report_error(job, self.render_refined(job, context, report), report);
        }
    }

    fn render_refined(
        &mut self,
        job: &ImageJob,
        context: &JobContext<ImageJob>,
        report: &dyn Fn(ImageResult),
    ) -> Result<()> {
        if self.differs_only_in_tone(job) {
            // The draft showed the last final image, unless that image was finished after the draft.
            let is_shown = lock(&self.shared.last).as_ref().is_none_or(|last| last.preview.version == job.version);
            if !is_shown && let Some(preview) = self.retone(job)? {
                report(ImageResult::Rendered(Box::new(preview)));
            }
            let warnings = lock(&self.shared.last).as_ref().and_then(|last| last.warnings.clone());
            let known = if job.loaded.scene.slab.is_none() { self.shared.known(&job.loaded) } else { None };
            match (warnings, known) {
                (Some(warnings), known) => {
                    report(ImageResult::Warnings(job.version, warnings));
                    return known.map_or(Ok(()), |outcome| state_error(&outcome, context, report));
                }
                (None, Some(outcome)) => return self.examine(job, &outcome, context, report),
                // The warnings were not computed before another material was.
                (None, None) => {}
            }
        }
        self.pipeline.set_cancel(context.cancel.clone());
        self.choose_backend(job, true);
        if job.loaded.scene.slab.is_some() {
            report(ImageResult::Doing(job.version, "Refining the image"));
            let (preview, warnings) =
                self.render_slab(job, Grade::Final, fitting(job.size, MAX_PIXELS[0]), context.cancel)?;
            *lock(&self.shared.last) = Some(finished(job, &preview, Some(warnings.clone())));
            report(ImageResult::Rendered(Box::new(preview)));
            report(ImageResult::Warnings(job.version, warnings));
            return Ok(());
        }
        let mut outcome = match self.shared.known(&job.loaded) {
            Some(outcome) => outcome.without_times(),
            None => {
                report(ImageResult::Doing(job.version, "Refining the material"));
                self.pipeline.effective(&job.loaded)?
            }
        };
        *lock(&self.shared.best) = Some((small_scale(&job.loaded), outcome.clone()));
        report(ImageResult::Doing(job.version, "Refining the image"));
        self.renderer.prepare(&self.pipeline, &job.loaded)?;
        if self.backend == "cpu" || self.renderer.has_no_hardware() {
            let table_ms = outcome.shading_brdf(context.cancel)?.ms;
            outcome.times.extend((table_ms > MIN_STAGE_MS).then_some(("picture table", table_ms)));
        }
        let refined = self.refined_shading(&outcome);
        // Images before the final one: shading, time limit [ms], samples per side of a pixel. Under a colour map, the first is
        // without its filter.
        let (of_final, steps) = if job.loaded.scene.color_map.is_some() {
            (Shading::Filtered, [(refined, 300.0, 1), (Shading::Filtered, 1200.0, 2)])
        } else {
            (refined, [(refined, 300.0, 1), (refined, 2000.0, 1)])
        };
        let mut rendered = (0, refined);
        for (shading, budget, samples) in steps {
            let step = self.affordable(job, shading, budget);
            let pixels = step[0] * step[1];
            let full = self.affordable(job, of_final, FINAL_MS);
            // Steps that add few pixels are skipped, and those before a quick final image.
            let adds = shading != rendered.1 || pixels >= 2 * rendered.0;
            if adds
                && !self.is_quick(job, of_final, full)
                && (shading != of_final || pixels * 3 < full[0] * full[1] * 2)
            {
                let material = ShadedMaterial::Outcome(&outcome);
                let mut preview = self.render(job, material, shading, step, samples, context.cancel)?;
                preview.grade = Grade::Refining;
                outcome.times = Vec::new();
                rendered = (pixels, shading);
                report(ImageResult::Rendered(Box::new(preview)));
            }
        }
        let full = self.affordable(job, of_final, FINAL_MS);
        let mut preview = self.render(job, ShadedMaterial::Outcome(&outcome), of_final, full, 2, context.cancel)?;
        preview.grade = Grade::Final;
        let all = fitting(job.size, MAX_PIXELS[usize::from(self.is_on_gpu())]);
        if full[0] < all[0] {
            let ([width, height], [x, y]) = (full, all);
            preview.notes.push(format!(
                "The image has {width} x {height} pixels in place of {x} x {y}, which would take longer than {:.0} s. An exported \
                 image is not reduced.",
                FINAL_MS / 1000.0
            ));
        }
        // An image that is only on the GPU is rendered again if its tone map changes.
        *lock(&self.shared.last) = preview.radiance.is_some().then(|| finished(job, &preview, None));
        report(ImageResult::Rendered(Box::new(preview)));
        self.examine(job, &outcome, context, report)
    }

    fn render(
        &mut self,
        job: &ImageJob,
        material: ShadedMaterial,
        shading: Shading,
        size: [usize; 2],
        samples_per_side: usize,
        cancel: &Cancel,
    ) -> Result<RenderedPreview> {
        let camera = camera(&job.loaded);
        let tone_map = ToneMap::new(&camera)?;
        let build_caches = samples_per_side > 1;
        // Drafts of distant colour maps have `f̄`, because the statistics of a tile take longer than a draft may.
        let has_color_map = build_caches && job.loaded.scene.color_map.is_some();
        if has_analytic_surface(&job.loaded) || self.renderer.is_close(&camera, size, has_color_map) {
            self.prepare_close_up(&job.loaded)?;
        } else {
            self.close = None;
        }
        let has_bounced = matches!(material, ShadedMaterial::Outcome(of) if of.plan.interreflection.is_some());
        let bounced = if has_bounced { None } else { self.shared.bounced_light_like(&job.loaded) };
        let request = RenderRequest {
            camera: &camera,
            material,
            bounced: bounced.as_ref(),
            size,
            samples_per_side,
            build_caches,
            backend: &self.backend,
        };
        let close = self.close.as_ref().map(|(_, close)| close);
        let shown = if close.is_none() { self.renderer.render_to_screen(&request, &tone_map, cancel)? } else { None };
        let (radiance, image, times, table_ms, tone) = match shown {
            Some(shown) => (None, DisplayImage::OnGpu(shown.image), shown.times, shown.table_ms, None),
            None => {
                let (rendered, table_ms) = self.renderer.render(&self.pipeline, &request, close, cancel)?;
                let start = Instant::now();
                let image = DisplayImage::Pixels(Arc::new(color_image(&rendered.image, &tone_map)));
                (Some(Arc::new(rendered.image)), image, rendered.times, table_ms, Some(ms(start)))
            }
        };
        self.costs.record(shading, samples_per_side, size, &times);
        let large = [
            (SUM_STAGE, times.product_ms),
            ("picture table", table_ms),
            ("g-buffer", times.gbuffer_ms),
            ("shadows", times.shadows_ms),
            ("shading", times.shading_ms),
        ];
        let (plan, preset, times, notes, brdf) = match material {
            ShadedMaterial::Outcome(of) => (&of.plan, of.settings.preset, &of.times, &of.notes, Some(of.brdf.clone())),
            ShadedMaterial::GpuTile(of) => (&of.plan, of.settings.preset, &of.times, &of.notes, None),
        };
        let mut stages = times.clone();
        stages.extend(large.into_iter().filter(|(_, ms)| *ms > MIN_STAGE_MS));
        stages.extend(tone.map(|ms| ("tone", ms)));
        let mut notes = notes.clone();
        notes.extend(self.renderer.warnings());
        // The plan of a tile outlives edits of the object and the lights.
        let mut plan = plan.clone();
        plan.decide_large_scale(&job.loaded.scene);
        Ok(RenderedPreview {
            version: job.version,
            grade: Grade::Draft,
            radiance,
            image,
            brdf,
            stages,
            latency_ms: ms(job.submitted),
            rendered_on: self.renderer.rendered_on(),
            gpu_error: self.renderer.gpu_error(),
            lit_object: self.renderer.scene().cloned(),
            camera: camera.clone(),
            distance: self.renderer.distance(&camera, size),
            notes,
            effects: plan.effects,
            preset: preset.name(),
        })
    }

    /// Prepares the tile for images in which the tile itself is visible.
    fn prepare_close_up(&mut self, loaded: &LoadedScene) -> Result<()> {
        let key = small_scale(loaded);
        if self.close.as_ref().is_none_or(|(last, _)| *last != key) {
            let tile = TileScene::new(Arc::new(self.pipeline.mesh(loaded)?));
            self.close = Some((key, (tile, self.pipeline.materials(loaded)?)));
        }
        Ok(())
    }

    /// How an image of a refined material is shaded.
    fn refined_shading(&self, outcome: &Outcome) -> Shading {
        let reads_exact = || outcome.known_shading_brdf().is_some_and(|read| Arc::ptr_eq(&read, &outcome.brdf));
        if !self.is_on_gpu() && reads_exact() { Shading::Exact } else { Shading::Refined }
    }

    /// Returns true if a final image is estimated to take at most [`QUICK_FINAL_MS`].
    fn is_quick(&self, job: &ImageJob, shading: Shading, size: [usize; 2]) -> bool {
        let [shading, points] = self.costs.of_image(size, shading, 2);
        let is_known = self.renderer.known_points(&camera(&job.loaded), size, 2) == KnownPoints::All;
        shading + if is_known { 0.0 } else { points } <= QUICK_FINAL_MS
    }

    /// The largest size with the view's aspect ratio that is estimated to take at most `budget_ms`.
    fn affordable(&self, job: &ImageJob, shading: Shading, budget_ms: f64) -> [usize; 2] {
        let full = fitting(job.size, MAX_PIXELS[usize::from(self.is_on_gpu())]);
        let camera = camera(&job.loaded);
        let known = |size, samples_per_side| self.renderer.known_points(&camera, size, samples_per_side);
        self.costs.affordable(full, shading, budget_ms, known)
    }
}

/// Returns true if images show an analytic surface at every distance, and `f̄` at none.
fn has_analytic_surface(loaded: &LoadedScene) -> bool {
    loaded.scene.color_map.as_ref().is_some_and(|map| map.surface.is_some())
}

/// Reports an error; a cancelled job reports nothing.
fn report_error(job: &ImageJob, done: Result<()>, report: &dyn Fn(ImageResult)) {
    match done {
        Ok(()) | Err(Error::Cancelled) => {}
        Err(error) => report(ImageResult::Failed(job.version, error.to_string())),
    }
}

pub(super) fn camera(loaded: &LoadedScene) -> Camera {
    loaded.scene.camera.clone().unwrap_or_default()
}

pub(super) fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
