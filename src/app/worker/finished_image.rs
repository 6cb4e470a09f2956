//! Work after a final image: its warnings, the error of its BRDF, and the same image after an edit of exposure or tone map.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::base::Result;
use crate::pipeline::Outcome;
use crate::render::image::tone_map::ToneMap;
use crate::scene::Camera;

use super::dark;
use super::image_worker::{ImageWorker, PAUSE, camera, ms};
use super::rendered_preview::{DisplayImage, ImageJob, ImageResult, RenderedPreview};
use super::runner::JobContext;
use super::shared::{FinishedPreview, lock};
use super::tone::color_image;

/// Time without a new edit after the final image, after which its error is estimated.
const STATED_PAUSE: Duration = Duration::from_millis(400);

impl ImageWorker {
    /// Reports the warnings of a final image and the error of its BRDF, unless the user edits within a pause. The image does not
    /// wait for them, because they take up to some tenths of a second on all cores.
    pub(super) fn examine(
        &self,
        job: &ImageJob,
        outcome: &Outcome,
        context: &JobContext<ImageJob>,
        report: &dyn Fn(ImageResult),
    ) -> Result<()> {
        if !context.is_newest_after(PAUSE) {
            return Ok(());
        }
        let health = outcome.health_unless(context.cancel)?;
        let hint = dark::hint(health, &outcome.plan.effects);
        let warnings: Vec<String> = health.warnings.iter().cloned().chain(hint).collect();
        if let Some(last) = lock(&self.shared.last).as_mut().filter(|last| last.preview.version == job.version) {
            last.warnings = Some(warnings.clone());
        }
        report(ImageResult::Warnings(job.version, warnings));
        state_error(outcome, context, report)
    }

    /// Returns true if the job differs from the last final image only in exposure or tone map.
    pub(super) fn differs_only_in_tone(&self, job: &ImageJob) -> bool {
        lock(&self.shared.last).as_ref().is_some_and(|FinishedPreview { loaded: last, size, .. }| {
            let (mut like_last, before) = ((*job.loaded).clone(), camera(last));
            let now = camera(&job.loaded);
            like_last.scene.camera.clone_from(&last.scene.camera);
            like_last.name.clone_from(&last.name);
            let tones = Camera { exposure_ev: before.exposure_ev, tone_map: before.tone_map.clone(), ..now };
            tones == before && like_last == **last && *size == job.size
        })
    }

    /// The last final image with a new tone map, if nothing else changed.
    pub(super) fn retone(&mut self, job: &ImageJob) -> Result<Option<RenderedPreview>> {
        if !self.differs_only_in_tone(job) {
            return Ok(None);
        }
        let start = Instant::now();
        let Some(FinishedPreview { loaded: last, preview, .. }) = &mut *lock(&self.shared.last) else {
            return Ok(None);
        };
        let Some(radiance) = &preview.radiance else { return Ok(None) };
        preview.image = DisplayImage::Pixels(Arc::new(color_image(radiance, &ToneMap::new(&camera(&job.loaded))?)));
        preview.version = job.version;
        preview.stages = vec![("tone", ms(start))];
        preview.latency_ms = ms(job.submitted);
        last.scene.camera.clone_from(&job.loaded.scene.camera);
        Ok(Some(preview.clone()))
    }
}

/// A final image as the next edits of exposure and tone map find it.
pub(super) fn finished(job: &ImageJob, preview: &RenderedPreview, warnings: Option<Vec<String>>) -> FinishedPreview {
    FinishedPreview { loaded: Box::new((*job.loaded).clone()), size: job.size, preview: preview.clone(), warnings }
}

/// Estimates the error of a BRDF and reports it, unless the user edits within a pause: the estimate takes some tenths of a
/// second on all cores.
pub(super) fn state_error(
    outcome: &Outcome,
    context: &JobContext<ImageJob>,
    report: &dyn Fn(ImageResult),
) -> Result<()> {
    if context.is_newest_after(STATED_PAUSE)
        && let Some(errors) = outcome.errors_unless(context.cancel)?
    {
        report(ImageResult::Stated(outcome.brdf.clone(), errors.estimate()));
    }
    Ok(())
}
