//! Submission of jobs to the workers and handling of their results.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use crate::cache::Cache;
use crate::scene::LoadedScene;
use eframe::egui::Context;

use super::dialogs::Dialog;
use super::document::Snapshot;
use super::editor::Editor;
use super::layout::{OBJECT_PART, is_narrow};
use super::messages::Level;
use super::worker::{
    AccuracyJob, AccuracyResult, CaptureJob, CaptureResult, ColorMapJob, ColorMapResult, ExportJob, ExportResult,
    GpuShare, ImageJob, ImageResult, LobeJob, LobePlot, MethodsJob, MethodsResult, PreviewWorkers, SlabLobeJob,
    SlabLobeResult, TargetJob, TargetResult, Thumbnail, ThumbnailJob, TileJob, TileResult, Worker, spawn_accuracy,
    spawn_autosave, spawn_capture, spawn_color_map, spawn_export, spawn_lobe, spawn_methods, spawn_slab_lobe,
    spawn_target, spawn_thumbnail, spawn_tile,
};

/// Height of menu, toolbar and status line [points].
const BARS: f32 = 79.0;
/// Time for which the other views wait for a draft of the object.
const LONGEST_HOLD: Duration = Duration::from_millis(150);
/// Minimum time between recovery files [s].
const AUTOSAVE_SECS: f64 = 5.0;

/// A result that a worker reports.
enum JobResult {
    Image(ImageResult),
    Tile(TileResult),
    Lobe(Box<LobePlot>),
    Thumbnail(Thumbnail),
    Export(ExportResult),
    Accuracy(AccuracyResult),
    Target(TargetResult),
    Capture(CaptureResult),
    ColorMap(ColorMapResult),
    SlabLobe(SlabLobeResult),
    Methods(MethodsResult),
    Autosaved(Result<(), String>),
}

/// The workers and the jobs that were submitted last. A worker is absent if the system provides no thread for it.
pub struct BackgroundJobs {
    pub images: Option<PreviewWorkers>,
    tiles: Option<Worker<TileJob>>,
    lobes: Option<Worker<LobeJob>>,
    pub(super) thumbnails: Option<Worker<ThumbnailJob>>,
    pub exports: Option<Worker<ExportJob>>,
    pub(super) accuracy: Option<Worker<AccuracyJob>>,
    pub(super) targets: Option<Worker<TargetJob>>,
    pub(super) captures: Option<Worker<CaptureJob>>,
    color_map: Option<Worker<ColorMapJob>>,
    slab_lobes: Option<Worker<SlabLobeJob>>,
    pub(super) methods: Option<Worker<MethodsJob>>,
    autosaver: Option<Worker<Snapshot>>,
    /// The last version in the recovery file, and the earliest time of the next one.
    autosaved: (u64, f64),
    results: Receiver<JobResult>,
    /// A version of the document in the form that workers read.
    pub(super) loaded: Option<(u64, Arc<LoadedScene>)>,
    /// The first image is shown, or cannot be computed; from then on, other jobs are submitted.
    opened: bool,
    /// The version of the last image that the other views followed.
    followed: Option<u64>,
    /// A job whose refinement is not submitted yet.
    unrefined: Option<ImageJob>,
}

impl BackgroundJobs {
    pub fn new(ctx: &Context, cache: &Cache) -> Self {
        let (sender, results) = channel();
        let wake = ctx.clone();
        let send = move |result| {
            // Sending fails only if the editor has ended.
            let _ = sender.send(result);
            wake.request_repaint();
        };
        let (to_tile, to_lobe, to_thumbnails, to_export, to_save) =
            (send.clone(), send.clone(), send.clone(), send.clone(), send.clone());
        let (to_chart, to_map, to_slab, to_methods) = (send.clone(), send.clone(), send.clone(), send.clone());
        let (to_target, to_capture) = (send.clone(), send.clone());
        let accuracy = spawn_accuracy(move |result| to_chart(JobResult::Accuracy(result)));
        let targets = spawn_target(move |result| to_target(JobResult::Target(result)));
        let captures = spawn_capture(move |result| to_capture(JobResult::Capture(result)));
        let color_map = spawn_color_map(move |result| to_map(JobResult::ColorMap(result)));
        let slab_lobes = spawn_slab_lobe(move |result| to_slab(JobResult::SlabLobe(result)));
        let methods = spawn_methods(move |result| to_methods(JobResult::Methods(result)));
        let images = PreviewWorkers::spawn(cache, move |result| send(JobResult::Image(result)));
        let tiles = spawn_tile(move |result| to_tile(JobResult::Tile(result)));
        let thumbnails = spawn_thumbnail(move |thumbnail| to_thumbnails(JobResult::Thumbnail(thumbnail)));
        let exports = spawn_export(cache, move |result| to_export(JobResult::Export(result)));
        let autosaver = spawn_autosave(move |done| to_save(JobResult::Autosaved(done)));
        let lobes = spawn_lobe(move |plot| to_lobe(JobResult::Lobe(Box::new(plot))));
        Self {
            images,
            tiles,
            lobes,
            thumbnails,
            exports,
            accuracy,
            targets,
            captures,
            color_map,
            slab_lobes,
            methods,
            autosaver,
            autosaved: (1, 0.0),
            results,
            loaded: None,
            opened: false,
            followed: None,
            unrefined: None,
        }
    }

    /// Ends all threads, because no thread may use a graphics driver while the process unloads it.
    pub fn finish(self) {
        let longest = Duration::from_secs(4);
        self.images.into_iter().for_each(|workers| workers.finish(longest));
        self.tiles.into_iter().for_each(|worker| worker.finish(longest));
        self.lobes.into_iter().for_each(|worker| worker.finish(longest));
        self.thumbnails.into_iter().for_each(|worker| worker.finish(longest));
        self.exports.into_iter().for_each(|worker| worker.finish(longest));
        self.accuracy.into_iter().for_each(|worker| worker.finish(longest));
        self.targets.into_iter().for_each(|worker| worker.finish(longest));
        self.captures.into_iter().for_each(|worker| worker.finish(longest));
        self.color_map.into_iter().for_each(|worker| worker.finish(longest));
        self.slab_lobes.into_iter().for_each(|worker| worker.finish(longest));
        self.methods.into_iter().for_each(|worker| worker.finish(longest));
    }
}

impl Editor {
    /// Submits unsaved work for the recovery file, some seconds after the edit.
    pub(super) fn update_recovery(&mut self, ctx: &Context) {
        let Some(recovery) = &self.recovery else { return };
        let (version, now) = (self.document.version(), ctx.time());
        if !self.document.has_work() || version == self.background.autosaved.0 {
            return;
        }
        if now < self.background.autosaved.1 {
            ctx.request_repaint_after_secs((self.background.autosaved.1 - now) as f32 + 0.05);
            return;
        }
        if ctx.input(|input| input.pointer.any_down()) {
            return;
        }
        if let (Some(worker), Ok(snapshot)) = (&self.background.autosaver, recovery.prepare(&self.document)) {
            worker.submit(snapshot);
        }
        self.background.autosaved = (version, now + AUTOSAVE_SECS);
    }

    /// Writes the recovery file at once.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write_recovery(&self) -> crate::base::Result<()> {
        match &self.recovery {
            Some(recovery) if self.document.has_work() => recovery.prepare(&self.document)?.write(),
            _ => Ok(()),
        }
    }

    /// Removes the recovery file and saves the settings before the window closes.
    pub fn close(&mut self) {
        if let Some(worker) = self.background.autosaver.take() {
            worker.finish(Duration::from_secs(4));
        }
        if let Some(recovery) = self.recovery.take() {
            recovery.clear();
        }
        self.settings.save(self.folder.as_deref());
    }

    /// Reports the available GPUs to the workers.
    pub fn share_gpu(&self, gpu_share: GpuShare) {
        if let Some(images) = &self.background.images {
            images.share_gpu(gpu_share);
        }
    }

    /// Submits the first image before the window opens, in the expected size of the object's view.
    pub fn request_first_image(&mut self) {
        let settings = &self.settings;
        let gallery = if settings.gallery { settings.gallery_width } else { 0.0 };
        let [width, height] = settings.window;
        let view = if is_narrow(width) {
            [width - settings.parameters_width, (height - BARS) * OBJECT_PART]
        } else {
            [width - gallery - settings.parameters_width - settings.side_width, height - BARS]
        };
        self.size = view.map(|side| (side * settings.zoom).round().max(64.0) as usize);
        self.request_image();
    }

    /// Submits the jobs of all visible views, once per state and size.
    pub(super) fn submit_jobs(&mut self, ctx: &Context) {
        let Some(loaded) = self.request_image() else { return };
        if !self.background.opened {
            let is_settled = self.object.preview.is_some() || self.object.failed.is_some();
            self.background.opened = is_settled || self.background.images.is_none();
            if self.background.opened {
                ctx.request_repaint();
            }
            return;
        }
        if !self.tile.painting && self.holds_back_other_views(ctx) {
            return;
        }
        if let (Some(worker), Some(job)) = (&self.background.tiles, self.tile.job(&loaded, self.lobe.light)) {
            worker.submit(job);
        }
        if let Some(worker) = &self.background.color_map {
            let picked = self.lobe.viewer.map(|viewer| (self.lobe.light, viewer));
            if let Some(job) = self.color_map.job(self.document.version(), &loaded, picked) {
                worker.submit(job);
            }
        }
        if !self.tile.painting
            && let Some(worker) = &self.background.slab_lobes
            && let Some(job) = self.slab_lobe.job(self.document.version(), &loaded, self.lobe.light, self.lobe.log)
        {
            worker.submit(job);
        }
        if !self.tile.painting
            && let (Some(worker), Some(preview)) = (&self.background.lobes, &self.object.preview)
            && let Some(job) = preview.brdf.as_ref().and_then(|brdf| self.lobe.job(brdf))
        {
            worker.submit(job);
        }
    }

    /// Returns true while the draft of the last edit is computed, on all cores, for a short time. The other views follow
    /// each image once.
    fn holds_back_other_views(&mut self, ctx: &Context) -> bool {
        let shown = self.object.preview.as_ref().map(|preview| preview.version);
        let is_shown = shown >= self.object.requested.map(|(version, _)| version) || self.object.failed.is_some();
        let waited = self.object.requested_at.map_or(LONGEST_HOLD, |since| since.elapsed());
        let is_held =
            !is_shown && shown == self.background.followed && waited < LONGEST_HOLD && self.background.images.is_some();
        if is_held {
            ctx.request_repaint_after(LONGEST_HOLD - waited);
        } else {
            self.background.followed = shown;
        }
        is_held
    }

    /// Submits the object's image if version or size changed; returns the scene in the form that workers read.
    fn request_image(&mut self) -> Option<Arc<LoadedScene>> {
        let version = self.document.version();
        if self.background.loaded.as_ref().is_none_or(|(last, _)| *last != version) {
            self.background.loaded = Some((version, Arc::new(self.document.loaded())));
        }
        let (_, loaded) = self.background.loaded.clone()?;
        let opened = self.background.opened;
        if let (true, Some(worker)) = (opened, &self.background.images)
            && let Some(job) = self.background.unrefined.take()
        {
            worker.refine(job);
        }
        let wanted = (version, self.size);
        if self.object.requested != Some(wanted) {
            self.object.requested = Some(wanted);
            // The plot would take the cores from the image. It is requested again after the draft.
            if let (Some(worker), true) = (&self.background.lobes, self.lobe.interrupt()) {
                worker.cancel();
            }
            self.object.requested_at.get_or_insert_with(Instant::now);
            if let Some(worker) = &self.background.images {
                let job = ImageJob { version, loaded: loaded.clone(), size: self.size, submitted: Instant::now() };
                if opened {
                    worker.submit(job);
                } else {
                    worker.draft(job.clone());
                    self.background.unrefined = Some(job);
                }
            }
        }
        Some(loaded)
    }

    pub(super) fn receive_results(&mut self, ctx: &Context) {
        while let Ok(result) = self.background.results.try_recv() {
            match result {
                JobResult::Tile(TileResult::Rendered(rendered)) => {
                    self.messages.clear("tile");
                    self.slots.clone_from(&rendered.tile.mesh.slots);
                    self.tile.receive(ctx, rendered);
                }
                JobResult::Tile(TileResult::Failed(text)) => self.messages.put(Level::Error, "tile", text),
                JobResult::Lobe(plot) => self.lobe.receive(ctx, plot),
                JobResult::Thumbnail(thumbnail) => self.receive_thumbnail(ctx, thumbnail),
                JobResult::Accuracy(result) => self.accuracy.receive(ctx, result),
                JobResult::Target(result) => self.targets.receive(result),
                JobResult::Capture(result) => self.capture.receive(ctx, result),
                JobResult::ColorMap(result) => self.color_map.receive(result),
                JobResult::SlabLobe(result) => self.slab_lobe.receive(ctx, result),
                JobResult::Methods(result) => self.methods.receive(ctx, result),
                JobResult::Export(result) => self.receive_export(result),
                JobResult::Autosaved(Ok(())) => self.messages.clear("autosave"),
                JobResult::Autosaved(Err(text)) => {
                    let text = format!("No recovery file could be written ({text}). Save your work yourself.");
                    self.messages.put(Level::Error, "autosave", text);
                }
                JobResult::Image(result) => self.receive_image(ctx, result),
            }
        }
    }

    fn receive_thumbnail(&mut self, ctx: &Context, Thumbnail { job, image }: Thumbnail) {
        match (job, &mut self.dialog) {
            (ThumbnailJob::Subject(subject), _) => self.thumbnails.receive(ctx, subject, image),
            (ThumbnailJob::Variant { seed, at, .. }, Some(Dialog::Vary(variants))) => {
                variants.receive(ctx, (seed, at), image);
            }
            // The dialog is closed.
            (ThumbnailJob::Variant { .. }, _) => {}
        }
    }

    pub(super) fn receive_image(&mut self, ctx: &Context, result: ImageResult) {
        match result {
            ImageResult::Rendered(preview) => {
                self.messages.clear("image");
                match &preview.gpu_error {
                    Some(why) => self.report_gpu_failure(why),
                    None => self.gpu_error = None,
                }
                self.object.receive(ctx, preview);
            }
            ImageResult::Doing(version, what) if version == self.document.version() => {
                self.object.activity = Some(what);
            }
            ImageResult::Doing(..) => {}
            ImageResult::Warnings(version, texts) if version > self.object.warnings_of => {
                (self.object.warnings, self.object.warnings_of) = (texts, version);
            }
            ImageResult::Warnings(..) => {}
            ImageResult::Stated(brdf, error) => self.object.stated = Some((brdf, error)),
            ImageResult::Failed(version, _) if version < self.document.version() => {}
            ImageResult::Failed(version, text) => {
                self.object.fail(version);
                // The image of the document before would pass for that of this one.
                if self.object.preview.as_ref().is_some_and(|preview| preview.version < self.opened) {
                    self.object.preview = None;
                    self.tile.forget();
                }
                self.messages.put(Level::Error, "image", text);
            }
            ImageResult::Fault(text) => {
                self.object.fail(self.document.version());
                let text = format!(
                    "A fault in the program while computing ({text}). Your document is kept; you can continue to edit."
                );
                self.messages.put(Level::Error, "image", text);
            }
        }
    }

    /// Reports a GPU failure once.
    fn report_gpu_failure(&mut self, why: &str) {
        if self.gpu_error.as_deref() != Some(why) {
            self.gpu_error = Some(why.to_owned());
            let text = format!(
                "The GPU failed ({why}). Your document is kept, and the CPU renders the images. To try the GPU again, \
                 set Quality, Backend to CPU and back to Auto."
            );
            self.messages.put(Level::Error, "gpu", text);
        }
    }

    /// Returns true until the final image of the last request is shown, with its warnings.
    #[cfg(test)]
    pub fn is_busy(&self) -> bool {
        self.object.preview.as_ref().is_none_or(|preview| {
            preview.grade != super::worker::Grade::Final
                || self.object.warnings_of != preview.version
                || Some(preview.version) != self.object.requested.map(|(version, _)| version)
        })
    }
}
