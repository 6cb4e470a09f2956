//! Work behind the interface: one thread for the object's picture, one for the tile and its plots, one for thumbnails.

mod accuracy;
mod device;
mod export;
mod image_worker;
mod lobe;
mod made;
mod on_device;
mod runner;
mod screen;
mod shared;
mod studio;
mod thumbnail;
mod tile;
mod tone;

use std::sync::Arc;
use std::time::Duration;

use crate::cache::Cache;

use super::document::Snapshot;

pub use accuracy::{AccuracyAnswer, AccuracyJob, Point};
#[cfg(test)]
pub use device::LOSE_DEVICE;
pub use export::{ExportAnswer, ExportJob, TableChoice, What};
pub use lobe::{LobeJob, LobeMade, logarithmic};
pub use made::{DisplayImage, Grade, ImageAnswer, ImageJob, Made};
pub use runner::Worker;
pub use screen::{DeviceImage, Screen};
pub use shared::Devices;
pub use thumbnail::{Thumbnail, ThumbnailJob};
pub use tile::{Show, TileAnswer, TileJob, TileMade};

/// The thread that draws the tile.
pub fn spawn_tile(answer: impl Fn(TileAnswer) + Clone + Send + Sync + 'static) -> Option<Worker<TileJob>> {
    let told = answer.clone();
    let work = move |kept: &mut tile::Macro, job, desk: &runner::Desk<TileJob>| kept.work(job, desk, &answer);
    let panicked = move |text: String| told(TileAnswer::Failed(format!("a fault in the program ({text})")));
    Worker::spawn("tile", 0, tile::Macro::default, work, panicked).ok()
}

/// The thread that plots lobes. Its faults show as a plot that does not follow; the picture's worker reports the cause.
pub fn spawn_lobe(answer: impl Fn(LobeMade) + Clone + Send + Sync + 'static) -> Option<Worker<LobeJob>> {
    let work = move |_: &mut (), job: LobeJob, desk: &runner::Desk<LobeJob>| lobe::work(&job, desk, &answer);
    Worker::spawn("lobe", 0, || (), work, |_| {}).ok()
}

/// The threads that make pictures: one drafts, one refines. Each gets every job.
pub struct Images {
    draft: Worker<ImageJob>,
    refine: Worker<ImageJob>,
    shared: Arc<shared::Shared>,
}

impl Images {
    /// `None` where the system gives no threads.
    pub fn spawn(cache: &Cache, answer: impl Fn(ImageAnswer) + Clone + Send + Sync + 'static) -> Option<Self> {
        let shared = Arc::new(shared::Shared::default());
        let told_devices = shared.clone();
        let cache = cache.clone();
        let start = move || image_worker::Photographer::new(shared.clone(), &cache);
        let (draft, refine, told, told_too) = (answer.clone(), answer.clone(), answer.clone(), answer);
        let draft_work = move |kept: &mut image_worker::Photographer, job: ImageJob, desk: &runner::Desk<ImageJob>| {
            kept.draft(&job, desk, &draft);
        };
        let refine_work = move |kept: &mut image_worker::Photographer, job: ImageJob, desk: &runner::Desk<ImageJob>| {
            kept.refine(&job, desk, &refine);
        };
        let draft =
            Worker::spawn("draft", 0, start.clone(), draft_work, move |text| told(ImageAnswer::Fault(text))).ok()?;
        let refine =
            Worker::spawn("refine", 0, start, refine_work, move |text| told_too(ImageAnswer::Fault(text))).ok()?;
        Some(Self { draft, refine, shared: told_devices })
    }

    pub fn ask(&self, job: ImageJob) {
        self.refine(job.clone());
        self.draft(job);
    }

    /// A draft only.
    pub fn draft(&self, job: ImageJob) {
        self.draft.ask(job);
    }

    /// What a draft was asked of before.
    pub fn refine(&self, job: ImageJob) {
        self.refine.ask(job);
    }

    /// Tells what devices there are; only the first word counts.
    pub fn tell_devices(&self, devices: Devices) {
        let _ = self.shared.devices.set(devices);
    }

    pub fn finish(self, longest: Duration) {
        self.draft.finish(longest);
        self.refine.finish(longest);
    }

    /// What is shown is good enough: no refinement.
    pub fn stop(&self) {
        self.refine.cancel();
    }
}

/// The thread that makes thumbnails. One that fails stays a grey square.
pub fn spawn_thumbnail(answer: impl Fn(Thumbnail) + Clone + Send + Sync + 'static) -> Option<Worker<ThumbnailJob>> {
    let work = move |kept: &mut studio::ImageStudio, job: ThumbnailJob, desk: &runner::Desk<ThumbnailJob>| {
        thumbnail::work(kept, &job, desk, &answer);
    };
    Worker::spawn("thumbnails", 1, studio::ImageStudio::default, work, |_| {}).ok()
}

/// The thread that measures accuracy against time.
pub fn spawn_accuracy(answer: impl Fn(AccuracyAnswer) + Clone + Send + Sync + 'static) -> Option<Worker<AccuracyJob>> {
    let told = answer.clone();
    let work = move |kept: &mut accuracy::Accuracy, job: AccuracyJob, desk: &runner::Desk<AccuracyJob>| {
        kept.work(&job, desk, &answer);
    };
    let panicked = move |text: String| told(AccuracyAnswer::Failed(format!("a fault in the program ({text})")));
    Worker::spawn("accuracy", 0, accuracy::Accuracy::default, work, panicked).ok()
}

/// The thread that exports.
pub fn spawn_export(
    cache: &Cache,
    answer: impl Fn(ExportAnswer) + Clone + Send + Sync + 'static,
) -> Option<Worker<ExportJob>> {
    let told = answer.clone();
    let cache = cache.clone();
    let work =
        move |_: &mut (), job: ExportJob, desk: &runner::Desk<ExportJob>| export::work(&job, &cache, desk, &answer);
    let panicked = move |text: String| told(ExportAnswer::Failed(format!("a fault in the program ({text})")));
    Worker::spawn("export", 0, || (), work, panicked).ok()
}

/// The thread that writes recovery files.
pub fn spawn_autosave(done: impl Fn(Result<(), String>) + Clone + Send + Sync + 'static) -> Option<Worker<Snapshot>> {
    let told = done.clone();
    let work = move |_: &mut (), snapshot: Snapshot, _: &runner::Desk<Snapshot>| {
        done(snapshot.write().map_err(|error| error.to_string()));
    };
    Worker::spawn("autosave", 1, || (), work, move |text| told(Err(text))).ok()
}
