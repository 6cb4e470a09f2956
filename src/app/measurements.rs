//! Submission of work that waits for the image: thumbnails, measurements, searches for targets, comparisons of methods.

use super::dialogs::Dialog;
use super::editor::Editor;
use super::worker::{Grade, RenderedPreview};

impl Editor {
    /// Submits thumbnails while no other job waits.
    pub(super) fn render_thumbnails(&mut self) {
        let is_refined =
            |preview: &RenderedPreview| preview.grade >= Grade::Refining && preview.version == self.document.version();
        let is_idle = self.object.preview.as_deref().is_some_and(is_refined) && self.exporting.is_none();
        let varies = matches!(self.dialog, Some(Dialog::Vary(_)));
        let job = self.thumbnails.end_frame(is_idle && !varies && self.background.thumbnails.is_some());
        let Some(worker) = &self.background.thumbnails else { return };
        if let Some(Dialog::Vary(variants)) = &mut self.dialog {
            // A new job cancels that of the gallery.
            self.thumbnails.interrupted();
            if let Some(job) = variants.job(|| self.document.loaded()) {
                worker.submit(job);
            }
            return;
        }
        if let Some(job) = job {
            worker.submit(job);
        } else if !is_idle && self.thumbnails.is_waiting() {
            worker.cancel();
            self.thumbnails.interrupted();
        }
    }

    /// Submits a measurement of accuracy if the panel is open: of the first points at once, of all when the image is final.
    pub(super) fn measure_accuracy(&mut self) {
        let version = self.document.version();
        let Some(worker) = &self.background.accuracy else { return };
        // Both would take all cores, and distort what the other measures.
        if self.accuracy.is_late(version) || self.targets.is_active() && self.accuracy.pause() {
            worker.cancel();
        }
        if self.targets.is_active() {
            return;
        }
        let is_shown = self.object.preview.is_some() && self.exporting.is_none();
        let is_final = self.shows_final_image();
        if let (true, Some((_, loaded))) = (is_shown, &self.background.loaded)
            && let Some(job) = self.accuracy.job(version, loaded, is_final)
        {
            worker.submit(job);
        }
    }

    /// Submits the search for a target that the user asked for, and cancels one that is late.
    pub(super) fn search_for_targets(&mut self) {
        let version = self.document.version();
        let (Some(worker), Some((_, loaded))) = (&self.background.targets, &self.background.loaded) else { return };
        if self.targets.is_late(version, loaded) {
            worker.cancel();
        }
        if self.exporting.is_none()
            && let Some(job) = self.targets.job(version, loaded)
        {
            worker.submit(job);
        }
    }

    /// Submits what the window on a folder of photographs shows.
    pub(super) fn read_capture(&mut self) {
        if let (Some(worker), Some(job)) = (&self.background.captures, self.capture.job()) {
            worker.submit(job);
        }
    }

    /// Returns true if the final image of the document is shown and its warnings are known, so that no worker disturbs a
    /// measurement.
    fn shows_final_image(&self) -> bool {
        let version = self.document.version();
        let preview = self.object.preview.as_deref();
        let is_final = preview.is_some_and(|preview| preview.grade == Grade::Final && preview.version == version);
        is_final && self.object.warnings_of == version
    }

    /// Submits the images of the scene's methods once its own image is final, and cancels those that are late.
    pub(super) fn compare_methods(&mut self) {
        let version = self.document.version();
        let Some(worker) = &self.background.methods else { return };
        if self.methods.is_late(version) {
            worker.cancel();
        }
        let is_final = self.shows_final_image() && self.exporting.is_none();
        if let Some((_, loaded)) = &self.background.loaded
            && let Some(job) = self.methods.job(version, loaded, self.size, is_final)
        {
            worker.submit(job);
        }
    }
}
