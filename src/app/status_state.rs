//! The first field of the strip at the foot: accuracy and time of the image, or what is being computed.

use eframe::egui::{self, Label, Ui, vec2};

use super::editor::Editor;
use super::panels::accuracy;
use super::panels::effects::caption;
use super::panels::fields::display_name;
use super::views::spinner::spinner;
use super::worker::{AccuracyPoint, Grade, PreviewWorkers, RenderedPreview};
use crate::base::Running;
use crate::effective::ErrorEstimate;
use crate::plan::Effect;

impl Editor {
    fn stop_refining(&mut self) {
        if let Some(images) = &self.background.images {
            images.stop();
        }
        self.object.activity = None;
        self.object.stopped = Some(self.document.version());
    }

    /// Draws what the image shows, or what is being computed.
    pub(super) fn state_ui(&mut self, ui: &mut Ui, preview: &RenderedPreview) {
        let running = self.background.images.as_ref().and_then(PreviewWorkers::running);
        let is_failed = self.object.failed == Some(self.document.version());
        let is_pending = self.object.requested_at.is_some();
        if is_failed {
            // A label that is cut off shows its text when the pointer is over it.
            ui.add(Label::new("Shows the last image that could be computed: see the message").truncate());
        } else if !is_pending && preview.grade == Grade::Final {
            let (dot, _) = ui.allocate_exact_size(vec2(12.0, 12.0), egui::Sense::hover());
            ui.painter().circle_filled(dot.center(), 4.0, egui::Color32::from_rgb(96, 176, 96));
            let text = format!("{} · {}", display_name(preview.preset), self.cost());
            ui.add(Label::new(text).truncate()).on_hover_text(self.cost_tip());
        } else if let Some(doing) = self.object.activity {
            spinner(ui, 13.0, ui.visuals().strong_text_color());
            if ui.small_button("Stop").on_hover_text("Keep the current image and stop refining it").clicked() {
                self.stop_refining();
            }
            ui.add(Label::new(computing(running, doing)).truncate());
        } else if self.object.stopped == Some(preview.version) {
            ui.label("Stopped before the final image");
        } else {
            spinner(ui, 13.0, ui.visuals().strong_text_color());
            ui.add(Label::new(computing(running, "Updating")).truncate());
        }
    }

    /// Accuracy and time of an edit at the scene's settings: as measured, else as stated and forecast.
    fn cost(&self) -> String {
        let version = self.document.version();
        if self.document.scene().slab.is_some() {
            return "slab".to_owned();
        }
        if let Some(point) = self.accuracy.now(version) {
            return describe(&point);
        }
        let forecast: f64 = self.object.effects().iter().filter(|effect| effect.on).map(cost_of).sum();
        let time = if forecast > 0.0 { format!(" · ~{}", time(forecast)) } else { String::new() };
        let accuracy = match self.object.stated_error().and_then(|error| error.psnr_db) {
            Some(psnr) => format!("{psnr:.0} ± {:.0} dB stated", accuracy::STATED_DB),
            None => "accuracy not measured".to_owned(),
        };
        format!("{accuracy}{time}")
    }

    fn cost_tip(&self) -> String {
        let measured = "PSNR of the effective BRDF against the reference, which counts only the light that is simulated, and \
                        the time from an edit of the geometry to the effective BRDF.";
        match self.object.stated_error() {
            Some(error) => format!("{measured}\n{}", error_parts(&error)),
            None => measured.to_owned(),
        }
    }
}

/// Describes what is computed at present: the stage, its steps, and the seconds that are left.
fn computing(running: Option<Running>, otherwise: &str) -> String {
    let Some(running) = running else { return otherwise.to_owned() };
    let name = caption(running.name);
    if running.done == 0 || running.all < running.done {
        return name;
    }
    let left = running.since.elapsed().as_secs_f64() * (running.all - running.done) as f64 / running.done as f64;
    let left = if left < 1.0 { String::new() } else { format!(", {left:.0} s left") };
    format!("{name}, {} of {}{left}", running.done, running.all)
}

/// Accuracy and time of a measured point.
fn describe(point: &AccuracyPoint) -> String {
    let compared = &point.compared;
    let accuracy = match compared.psnr_db {
        psnr if !psnr.is_finite() => "exact".to_owned(),
        psnr if compared.is_stated() => format!("{psnr:.0} ± {:.0} dB stated", compared.psnr_std_error_db),
        psnr => format!("{psnr:.0} ± {:.1} dB", compared.psnr_std_error_db),
    };
    format!("{accuracy} · {}", time(point.ms))
}

fn cost_of(effect: &Effect) -> f64 {
    effect.measured_ms.unwrap_or(effect.predicted_ms)
}

/// Explains a stated error.
fn error_parts(error: &ErrorEstimate) -> String {
    format!(
        "The result states an error of about {}: facets {:.2} %, visibility {:.2} %, low-rank factors {:.2} %, \
         interreflection {:.2} %.",
        error.describe(),
        100.0 * error.facets,
        100.0 * error.visibility,
        100.0 * error.table,
        100.0 * error.interreflection
    )
}

pub fn time(ms: f64) -> String {
    match ms {
        ms if ms < 10.0 => format!("{ms:.1} ms"),
        ms if ms < 1000.0 => format!("{ms:.0} ms"),
        ms => format!("{:.1} s", ms / 1e3),
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn a_stage_that_counts_its_steps_states_what_is_left() {
        let since = Instant::now() - Duration::from_secs(10);
        let running = |done, all| Some(Running { name: "shadow_maps", since, done, all });
        assert_eq!(computing(running(10, 40), ""), "Shadow maps, 10 of 40, 30 s left");
        assert_eq!(computing(running(40, 40), ""), "Shadow maps, 40 of 40");
        assert_eq!(computing(running(0, 0), ""), "Shadow maps");
        assert_eq!(computing(None, "Updating"), "Updating");
    }
}
