//! What is asked of the workers and what comes back.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use crate::cache::Cache;
use crate::scene::LoadedScene;
use eframe::egui::Context;

use super::document::Snapshot;
use super::editor::Editor;
use super::messages::Level;
use super::worker::{
    AccuracyAnswer, AccuracyJob, Devices, ExportAnswer, ExportJob, Grade, ImageAnswer, ImageJob, Images, LobeJob,
    LobeMade, Made, Thumbnail, ThumbnailJob, TileAnswer, TileJob, Worker, spawn_accuracy, spawn_autosave, spawn_export,
    spawn_lobe, spawn_thumbnail, spawn_tile,
};

/// What menu, toolbar and status line take of the window's height, points.
const BARS: f32 = 79.0;
/// Least time between recovery files.
const AUTOSAVE_SECS: f64 = 5.0;

/// What workers send.
enum Answer {
    Image(ImageAnswer),
    Tile(TileAnswer),
    Lobe(Box<LobeMade>),
    Thumbnail(Thumbnail),
    Export(ExportAnswer),
    Accuracy(AccuracyAnswer),
    Autosaved(Result<(), String>),
}

/// The workers, each absent where the system gave no thread, and what was asked of them last.
pub struct Background {
    pub images: Option<Images>,
    tiles: Option<Worker<TileJob>>,
    lobes: Option<Worker<LobeJob>>,
    thumbnails: Option<Worker<ThumbnailJob>>,
    pub exports: Option<Worker<ExportJob>>,
    accuracy: Option<Worker<AccuracyJob>>,
    autosaver: Option<Worker<Snapshot>>,
    /// The version that was kept last, and when the next may be.
    autosaved: (u64, f64),
    answers: Receiver<Answer>,
    /// What workers are given, for a version of the document.
    loaded: Option<(u64, Arc<LoadedScene>)>,
    /// The first picture was shown, or there is none to wait for: what it does not need may be computed.
    opened: bool,
    /// Drafted, not asked to be refined yet.
    unrefined: Option<ImageJob>,
}

impl Background {
    pub fn new(ctx: &Context, cache: &Cache) -> Self {
        let (to_us, answers) = channel();
        let wake = ctx.clone();
        let send = move |answer| {
            // Nobody listens any more only when the editor is gone.
            let _ = to_us.send(answer);
            wake.request_repaint();
        };
        let (to_tile, to_lobe, to_gallery, to_export, to_save, to_chart) =
            (send.clone(), send.clone(), send.clone(), send.clone(), send.clone(), send.clone());
        let accuracy = spawn_accuracy(move |answer| to_chart(Answer::Accuracy(answer)));
        let images = Images::spawn(cache, move |answer| send(Answer::Image(answer)));
        let tiles = spawn_tile(move |answer| to_tile(Answer::Tile(answer)));
        let thumbnails = spawn_thumbnail(move |made| to_gallery(Answer::Thumbnail(made)));
        let exports = spawn_export(cache, move |answer| to_export(Answer::Export(answer)));
        let autosaver = spawn_autosave(move |done| to_save(Answer::Autosaved(done)));
        let lobes = spawn_lobe(move |made| to_lobe(Answer::Lobe(Box::new(made))));
        Self {
            images,
            tiles,
            lobes,
            thumbnails,
            exports,
            accuracy,
            autosaver,
            autosaved: (1, 0.0),
            answers,
            loaded: None,
            opened: false,
            unrefined: None,
        }
    }

    /// Ends all threads: none may still use a graphics driver while the process takes it down.
    pub fn finish(self) {
        let longest = Duration::from_secs(4);
        self.images.into_iter().for_each(|workers| workers.finish(longest));
        self.tiles.into_iter().for_each(|worker| worker.finish(longest));
        self.lobes.into_iter().for_each(|worker| worker.finish(longest));
        self.thumbnails.into_iter().for_each(|worker| worker.finish(longest));
        self.exports.into_iter().for_each(|worker| worker.finish(longest));
        self.accuracy.into_iter().for_each(|worker| worker.finish(longest));
    }
}

impl Editor {
    /// Thumbnails are made while nothing else is to be done.
    pub(super) fn fill_gallery(&mut self) {
        let rests = |made: &Made| made.grade >= Grade::Refining && made.version == self.document.version();
        let idle = self.object.made.as_deref().is_some_and(rests) && self.exporting.is_none();
        let Some(worker) = &self.background.thumbnails else { return };
        if idle && self.settings.gallery {
            if let Some(job) = self.gallery.job() {
                worker.ask(job);
            }
        } else if self.gallery.is_waiting() {
            worker.cancel();
            self.gallery.interrupted();
        }
    }

    /// Accuracy is measured once the picture is finished, while its panel is open.
    pub(super) fn measure_accuracy(&mut self) {
        let version = self.document.version();
        let Some(worker) = &self.background.accuracy else { return };
        if self.accuracy.is_late(version) {
            worker.cancel();
        }
        let finished = |made: &Made| made.grade == Grade::Final && made.version == version;
        let idle = self.object.made.as_deref().is_some_and(finished) && self.exporting.is_none();
        if let (true, Some((_, loaded))) = (idle, &self.background.loaded)
            && let Some(job) = self.accuracy.job(version, loaded)
        {
            worker.ask(job);
        }
    }

    /// Unsaved work goes to the recovery file some seconds after it was done.
    pub(super) fn keep_recovery(&mut self, ctx: &Context) {
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
            worker.ask(snapshot);
        }
        self.background.autosaved = (version, now + AUTOSAVE_SECS);
    }

    /// Writes the recovery file at once.
    ///
    /// # Errors
    /// A place that cannot be written.
    pub fn keep_now(&self) -> crate::base::Result<()> {
        match &self.recovery {
            Some(recovery) if self.document.has_work() => recovery.prepare(&self.document)?.write(),
            _ => Ok(()),
        }
    }

    /// Before the window goes: nothing is left to recover.
    pub fn close(&mut self) {
        if let Some(worker) = self.background.autosaver.take() {
            worker.finish(Duration::from_secs(4));
        }
        if let Some(recovery) = self.recovery.take() {
            recovery.clear();
        }
        self.settings.save(self.folder.as_deref());
    }

    /// What was found of graphics devices.
    pub fn tell_devices(&self, devices: Devices) {
        if let Some(images) = &self.background.images {
            images.tell_devices(devices);
        }
    }

    /// Asks for the first picture while there is no window yet, in the size that the object's view is going to have.
    pub fn ask_early(&mut self) {
        let settings = &self.settings;
        let gallery = if settings.gallery { settings.gallery_width } else { 0.0 };
        let panels = [gallery + settings.parameters_width + settings.side_width, BARS];
        self.size =
            [0, 1].map(|axis| ((settings.window[axis] - panels[axis]) * settings.zoom).round().max(64.0) as usize);
        self.request_image();
    }

    /// Asks the workers for what is shown, once for every state and size.
    pub(super) fn request(&mut self, ctx: &Context) {
        let Some(loaded) = self.request_image() else { return };
        if !self.background.opened {
            let answered = self.object.made.is_some() || self.object.failed.is_some();
            self.background.opened = answered || self.background.images.is_none();
            if self.background.opened {
                ctx.request_repaint();
            }
            return;
        }
        if let (Some(worker), Some(job)) = (&self.background.tiles, self.tile.job(&loaded, self.lobe.light)) {
            worker.ask(job);
        }
        if !self.tile.painting
            && let (Some(worker), Some(made)) = (&self.background.lobes, &self.object.made)
            && let Some(job) = made.brdf.as_ref().and_then(|brdf| self.lobe.job(brdf))
        {
            worker.ask(job);
        }
    }

    /// Asks for the object's picture where it is not what was asked for last; gives the scene as workers have it.
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
        if self.object.asked != Some(wanted) {
            self.object.asked = Some(wanted);
            self.object.since.get_or_insert_with(Instant::now);
            if let Some(worker) = &self.background.images {
                let job = ImageJob { version, loaded: loaded.clone(), size: self.size, asked: Instant::now() };
                if opened {
                    worker.ask(job);
                } else {
                    worker.draft(job.clone());
                    self.background.unrefined = Some(job);
                }
            }
        }
        Some(loaded)
    }

    pub(super) fn take_answers(&mut self, ctx: &Context) {
        while let Ok(answer) = self.background.answers.try_recv() {
            match answer {
                Answer::Tile(TileAnswer::Made(made)) => {
                    self.messages.clear("tile");
                    self.slots.clone_from(&made.tile.mesh.slots);
                    self.tile.take(ctx, made);
                }
                Answer::Tile(TileAnswer::Failed(text)) => self.messages.put(Level::Trouble, "tile", text),
                Answer::Lobe(made) => self.lobe.take(ctx, made),
                Answer::Thumbnail(made) => self.gallery.take(ctx, made),
                Answer::Accuracy(answer) => self.accuracy.take(ctx, answer),
                Answer::Export(answer) => self.take_export(answer),
                Answer::Autosaved(Ok(())) => self.messages.clear("autosave"),
                Answer::Autosaved(Err(text)) => {
                    let text = format!("No recovery file could be written ({text}). Save your work yourself.");
                    self.messages.put(Level::Trouble, "autosave", text);
                }
                Answer::Image(answer) => self.take_image(ctx, answer),
            }
        }
    }

    pub(super) fn take_image(&mut self, ctx: &Context, answer: ImageAnswer) {
        match answer {
            ImageAnswer::Made(made) => {
                self.messages.clear("picture");
                match &made.trouble {
                    Some(why) => self.device_failed(why),
                    None => self.device_trouble = None,
                }
                self.object.take(ctx, made);
            }
            ImageAnswer::Doing(version, what) if version == self.document.version() => {
                self.object.doing = Some(what);
            }
            ImageAnswer::Doing(..) => {}
            ImageAnswer::Failed(version, _) if version < self.document.version() => {}
            ImageAnswer::Failed(version, text) => {
                self.object.fail(version);
                self.messages.put(Level::Trouble, "picture", text);
            }
            ImageAnswer::Fault(text) => {
                self.object.fail(self.document.version());
                let text = format!("A fault in the program while computing ({text}). Your document is kept; edit on.");
                self.messages.put(Level::Trouble, "picture", text);
            }
        }
    }

    /// Says once that pictures come from the processor now.
    fn device_failed(&mut self, why: &str) {
        if self.device_trouble.as_deref() != Some(why) {
            self.device_trouble = Some(why.to_owned());
            let text = format!(
                "The graphics device failed ({why}). Your document is kept; pictures are made on the processor. To try the \
                 device again set Quality, Backend to Cpu and back to Auto."
            );
            self.messages.put(Level::Trouble, "device", text);
        }
    }

    /// Whether anything is being computed.
    #[cfg(test)]
    pub fn is_busy(&self) -> bool {
        self.object.made.as_ref().is_none_or(|made| {
            made.grade != Grade::Final || Some(made.version) != self.object.asked.map(|(version, _)| version)
        })
    }
}
