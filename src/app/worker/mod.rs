//! Background work of the editor, with one thread per task: draft, refined image, tile, lobe plot, thumbnails,
//! accuracy, settings for targets, captured photographs, values of colour maps, lobe of a slab, methods beside each other, export, recovery file.

mod accuracy;
mod capture;
mod color_map;
mod dark;
mod draft_detail;
mod export;
mod finished_image;
mod gpu_drafts;
mod gpu_state;
mod image_worker;
mod lobe;
mod methods;
mod pixel_costs;
mod preview_renderer;
mod rendered_preview;
mod runner;
mod screen;
mod section;
mod shared;
mod slab_image;
mod slab_lobe;
mod slab_truth;
mod target;
mod thumbnail;
mod tile_image_worker;
mod tone;

use std::sync::Arc;
use std::time::Duration;

use crate::base::Running;
use crate::cache::Cache;
use crate::pipeline::Pipeline;

use super::document::Snapshot;
use runner::Threads;

pub use accuracy::{AccuracyChart, AccuracyJob, AccuracyPoint, AccuracyResult, FINER_DB, without_settings};
pub use capture::{CaptureJob, CaptureResult, ShownCapture};
pub use color_map::{ColorMapJob, ColorMapResult, DriverValues, REACH as HISTOGRAM_REACH};
pub use export::{ExportJob, ExportKind, ExportResult, TableChoice};
pub use lobe::{LobeJob, LobePlot, logarithmic};
pub use methods::{MethodImage, MethodsJob, MethodsResult};
pub use rendered_preview::{DisplayImage, Grade, ImageJob, ImageResult, RenderedPreview};
pub use runner::Worker;
pub use screen::{GpuImage, Screen};
pub use section::Section;
pub use shared::GpuShare;
pub use slab_lobe::{LobeCurve, SlabLobe, SlabLobeJob, SlabLobeResult};
pub use target::{FoundSettings, TargetJob, TargetNews, TargetResult};
pub use thumbnail::{Subject, Thumbnail, ThumbnailJob};
pub use tile_image_worker::{RenderedTile, TILE_AZIMUTH_DEG, TILE_ELEVATION_DEG, TileDisplay, TileJob, TileResult};

/// Starts the thread that renders the tile.
pub fn spawn_tile(report: impl Fn(TileResult) + Clone + Send + Sync + 'static) -> Option<Worker<TileJob>> {
    let report_fault = report.clone();
    let work = move |state: &mut tile_image_worker::TileImageWorker, job, context: &runner::JobContext<TileJob>| {
        state.work(job, context, &report)
    };
    let panicked = move |text: String| report_fault(TileResult::Failed(format!("a fault in the program ({text})")));
    Worker::spawn("tile", Threads::All, tile_image_worker::TileImageWorker::default, work, panicked).ok()
}

/// Starts the thread that plots lobes. After a panic, the plot is not updated; the image worker reports the cause.
pub fn spawn_lobe(report: impl Fn(LobePlot) + Clone + Send + Sync + 'static) -> Option<Worker<LobeJob>> {
    let work =
        move |_: &mut (), job: LobeJob, context: &runner::JobContext<LobeJob>| lobe::work(&job, context, &report);
    Worker::spawn("lobe", Threads::All, || (), work, |_| {}).ok()
}

/// The threads that render the object: one drafts, one refines. Each receives every job.
pub struct PreviewWorkers {
    draft: Worker<ImageJob>,
    refine: Worker<ImageJob>,
    shared: Arc<shared::SharedState>,
}

impl PreviewWorkers {
    /// Starts both threads; `None` if the system cannot start them.
    pub fn spawn(cache: &Cache, report: impl Fn(ImageResult) + Clone + Send + Sync + 'static) -> Option<Self> {
        let shared = Arc::new(shared::SharedState::default());
        let workers_shared = shared.clone();
        let cache = cache.clone();
        let start = move || image_worker::ImageWorker::new(shared.clone(), &cache);
        let (draft, refine, draft_fault, refine_fault) = (report.clone(), report.clone(), report.clone(), report);
        let draft_work =
            move |state: &mut image_worker::ImageWorker, job: ImageJob, context: &runner::JobContext<ImageJob>| {
                state.draft(&job, context, &draft);
            };
        let refine_work =
            move |state: &mut image_worker::ImageWorker, job: ImageJob, context: &runner::JobContext<ImageJob>| {
                state.refine(&job, context, &refine);
            };
        let draft = Worker::spawn("draft", Threads::All, start.clone(), draft_work, move |text| {
            draft_fault(ImageResult::Fault(text))
        })
        .ok()?;
        let refine = Worker::spawn("refine", Threads::All, start, refine_work, move |text| {
            refine_fault(ImageResult::Fault(text))
        })
        .ok()?;
        Some(Self { draft, refine, shared: workers_shared })
    }

    pub fn submit(&self, job: ImageJob) {
        self.refine(job.clone());
        self.draft(job);
    }

    /// Submits a job for the draft only.
    pub fn draft(&self, job: ImageJob) {
        self.draft.submit(job);
    }

    /// Submits a job for refinement only, after its draft was submitted.
    pub fn refine(&self, job: ImageJob) {
        self.refine.submit(job);
    }

    /// Reports the available GPUs; only the first report counts.
    pub fn share_gpu(&self, gpu_share: GpuShare) {
        let _ = self.shared.gpu_share.set(gpu_share);
    }

    pub fn finish(self, longest: Duration) {
        self.draft.finish(longest);
        self.refine.finish(longest);
    }

    /// The computation that runs at present.
    pub fn running(&self) -> Option<Running> {
        self.refine.running().or_else(|| self.draft.running())
    }

    /// Cancels refinement; the current image stays.
    pub fn stop(&self) {
        self.refine.cancel();
    }
}

/// Starts the thread that renders thumbnails. A thumbnail that fails stays a grey square.
pub fn spawn_thumbnail(report: impl Fn(Thumbnail) + Clone + Send + Sync + 'static) -> Option<Worker<ThumbnailJob>> {
    let work =
        move |state: &mut thumbnail::ThumbnailWorker, job: ThumbnailJob, context: &runner::JobContext<ThumbnailJob>| {
            thumbnail::work(state, job, context, &report);
        };
    Worker::spawn("thumbnails", Threads::OneInBackground, thumbnail::ThumbnailWorker::default, work, |_| {}).ok()
}

/// Starts the thread that measures accuracy against time.
pub fn spawn_accuracy(report: impl Fn(AccuracyResult) + Clone + Send + Sync + 'static) -> Option<Worker<AccuracyJob>> {
    let report_fault = report.clone();
    let work =
        move |state: &mut accuracy::AccuracyWorker, job: AccuracyJob, context: &runner::JobContext<AccuracyJob>| {
            state.work(&job, context, &report);
        };
    let panicked = move |text: String| report_fault(AccuracyResult::Failed(format!("a fault in the program ({text})")));
    Worker::spawn("accuracy", Threads::AllInBackground, accuracy::AccuracyWorker::default, work, panicked).ok()
}

/// Starts the thread that searches settings for targets.
pub fn spawn_target(report: impl Fn(TargetResult) + Clone + Send + Sync + 'static) -> Option<Worker<TargetJob>> {
    let report_fault = report.clone();
    let work = move |_: &mut (), job: TargetJob, context: &runner::JobContext<TargetJob>| {
        target::work(&job, context, &report);
    };
    let panicked = move |text: String| {
        let news = TargetNews::Failed(format!("a fault in the program ({text})"));
        report_fault(TargetResult { serial: None, news });
    };
    Worker::spawn("target", Threads::AllInBackground, || (), work, panicked).ok()
}

/// Starts the thread that reads folders of photographs.
pub fn spawn_capture(report: impl Fn(CaptureResult) + Clone + Send + Sync + 'static) -> Option<Worker<CaptureJob>> {
    let report_fault = report.clone();
    let work = move |state: &mut capture::CaptureWorker, job: CaptureJob, context: &runner::JobContext<CaptureJob>| {
        state.work(job, context, &report);
    };
    let panicked = move |text: String| {
        report_fault(CaptureResult::Failed(None, format!("a fault in the program ({text})")));
    };
    Worker::spawn("capture", Threads::AllInBackground, capture::CaptureWorker::default, work, panicked).ok()
}

/// Starts the thread that measures the drivers of colour maps.
pub fn spawn_color_map(report: impl Fn(ColorMapResult) + Clone + Send + Sync + 'static) -> Option<Worker<ColorMapJob>> {
    let report_fault = report.clone();
    let work = move |state: &mut Pipeline, job: ColorMapJob, context: &runner::JobContext<ColorMapJob>| {
        color_map::work(state, &job, context, &report);
    };
    let panicked = move |text: String| report_fault(ColorMapResult::Failed(format!("a fault in the program ({text})")));
    Worker::spawn("color map", Threads::One, Pipeline::new, work, panicked).ok()
}

/// Starts the thread that plots the light through slabs.
pub fn spawn_slab_lobe(report: impl Fn(SlabLobeResult) + Clone + Send + Sync + 'static) -> Option<Worker<SlabLobeJob>> {
    let report_fault = report.clone();
    let work = move |state: &mut Pipeline, job: SlabLobeJob, context: &runner::JobContext<SlabLobeJob>| {
        slab_lobe::work(state, &job, context, &report);
    };
    let panicked = move |text: String| report_fault(SlabLobeResult::Failed(format!("a fault in the program ({text})")));
    // One thread, because the image of the slab takes the others.
    Worker::spawn("slab lobe", Threads::One, Pipeline::new, work, panicked).ok()
}

/// Starts the thread that renders a scene by several methods.
pub fn spawn_methods(report: impl Fn(MethodsResult) + Clone + Send + Sync + 'static) -> Option<Worker<MethodsJob>> {
    let report_fault = report.clone();
    let work = move |state: &mut methods::MethodsWorker, job: MethodsJob, context: &runner::JobContext<MethodsJob>| {
        state.work(&job, context, &report);
    };
    let panicked =
        move |text: String| report_fault(MethodsResult::Failed(u64::MAX, format!("a fault in the program ({text})")));
    Worker::spawn("methods", Threads::AllInBackground, methods::MethodsWorker::default, work, panicked).ok()
}

/// Starts the thread that writes exports.
pub fn spawn_export(
    cache: &Cache,
    report: impl Fn(ExportResult) + Clone + Send + Sync + 'static,
) -> Option<Worker<ExportJob>> {
    let report_fault = report.clone();
    let cache = cache.clone();
    let work = move |_: &mut (), job: ExportJob, context: &runner::JobContext<ExportJob>| {
        export::work(&job, &cache, context, &report)
    };
    let panicked = move |text: String| report_fault(ExportResult::Failed(format!("a fault in the program ({text})")));
    Worker::spawn("export", Threads::AllInBackground, || (), work, panicked).ok()
}

/// Starts the thread that writes recovery files.
pub fn spawn_autosave(done: impl Fn(Result<(), String>) + Clone + Send + Sync + 'static) -> Option<Worker<Snapshot>> {
    let report_fault = done.clone();
    let work = move |_: &mut (), snapshot: Snapshot, _: &runner::JobContext<Snapshot>| {
        done(snapshot.write().map_err(|error| error.to_string()));
    };
    Worker::spawn("autosave", Threads::One, || (), work, move |text| report_fault(Err(text))).ok()
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::Instant;

    use super::*;

    #[test]
    fn warnings_follow_every_final_image_also_after_an_edit_of_the_exposure() {
        let (sender, results) = channel();
        let workers = PreviewWorkers::spawn(&Cache::default(), move |result| drop(sender.send(result))).unwrap();
        let settings = ["quality.preset=draft", "material.default.color=[3,3,3]"];
        let loaded = crate::scene::open("fig5a_isotropic", &settings.map(str::to_owned)).unwrap();
        let mut found = Vec::new();
        // The second job equals the first, the others change the exposure. The fifth does not wait for the warnings of the
        // fourth.
        for (version, exposure) in [(1, 0.0), (2, 0.0), (3, 1.0), (4, 2.0), (5, 3.0)] {
            let mut loaded = loaded.clone();
            loaded.scene.camera.get_or_insert_default().exposure_ev = exposure;
            let loaded = Arc::new(loaded);
            workers.submit(ImageJob { version, loaded, size: [48, 48], submitted: Instant::now() });
            if version == 4 {
                continue;
            }
            found.push(loop {
                match results.recv_timeout(Duration::from_secs(60)).unwrap() {
                    ImageResult::Warnings(of, texts) if of == version => break texts,
                    ImageResult::Failed(_, text) | ImageResult::Fault(text) => panic!("{text}"),
                    _ => {}
                }
            });
        }
        assert!(found.len() == 4 && !found[0].is_empty(), "{found:?}");
        assert!(found.iter().all(|texts| *texts == found[0]), "{found:?}");
        workers.finish(Duration::from_secs(4));
    }

    #[test]
    fn a_scene_that_is_saved_while_its_final_image_is_computed_shows_that_image() {
        let (sender, results) = channel();
        let workers = PreviewWorkers::spawn(&Cache::default(), move |result| drop(sender.send(result))).unwrap();
        let loaded = crate::scene::open("fig5a_isotropic", &["quality.preset=draft".to_owned()]).unwrap();
        let loaded = Arc::new(loaded);
        let job = |version| ImageJob { version, loaded: loaded.clone(), size: [48, 48], submitted: Instant::now() };
        let wait_for_final = |version| {
            while let Ok(result) = results.recv_timeout(Duration::from_secs(60)) {
                match result {
                    ImageResult::Rendered(image) if image.version == version && image.grade == Grade::Final => {
                        return true;
                    }
                    _ => {}
                }
            }
            false
        };
        workers.submit(job(1));
        assert!(wait_for_final(1));
        // The draft of the saved version ended before the final image was known.
        drop(workers.shared.draft_guard(2));
        workers.refine(job(2));
        assert!(wait_for_final(2));
        workers.finish(Duration::from_secs(4));
    }
}
