//! The status line: the stages that ran, their times, the processor that rendered, and the current activity.

use eframe::egui::{self, RichText, Ui};

use super::editor::Editor;
use super::theme;
use super::views::spinner::spinner;
use super::worker::Grade;
use crate::effective::ErrorEstimate;

impl Editor {
    fn stop_refining(&mut self) {
        if let Some(images) = &self.background.images {
            images.stop();
        }
        self.object.activity = None;
        self.object.stopped = Some(self.document.version());
    }

    pub(super) fn status_ui(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let failed = self.object.failed == Some(self.document.version());
            let Some(preview) = self.object.preview.clone() else {
                if failed {
                    ui.label("No image could be computed: see the message");
                } else {
                    ui.label("Computing the first image");
                }
                return;
            };
            let is_pending = self.object.requested_at.is_some();
            match (is_pending, preview.grade, self.object.activity) {
                _ if failed => {
                    ui.label("Shows the last image that could be computed: see the message");
                }
                (false, Grade::Final, _) => {
                    let (dot, _) = ui.allocate_exact_size(egui::Vec2::splat(12.0), egui::Sense::hover());
                    ui.painter().circle_filled(dot.center(), 4.0, egui::Color32::from_rgb(96, 176, 96));
                    ui.label(format!("Final, {} quality", preview.preset));
                }
                (_, _, Some(doing)) => {
                    spinner(ui, 13.0, ui.visuals().strong_text_color());
                    ui.label(doing);
                    let stop = ui.small_button("Stop").on_hover_text("Keep the current image and stop refining it");
                    if stop.clicked() {
                        self.stop_refining();
                    }
                }
                _ if self.object.stopped == Some(preview.version) => {
                    ui.label("Stopped before the final image");
                }
                _ => {
                    spinner(ui, 13.0, ui.visuals().strong_text_color());
                    ui.label("Updating");
                }
            }
            if let Some((part, what)) = self.exporting {
                ui.separator();
                ui.add(egui::ProgressBar::new(part).desired_width(140.0).text(what));
                if ui.small_button("Cancel").clicked()
                    && let Some(worker) = &self.background.exports
                {
                    worker.cancel();
                    self.exporting = None;
                }
            }
            if let Some(error) = self.object.stated_error() {
                ui.separator();
                ui.label(format!("Error about {}", error.describe())).on_hover_text(error_parts(&error));
            }
            ui.separator();
            let stages: Vec<String> = preview.stages.iter().map(|(name, ms)| format!("{name} {}", time(*ms))).collect();
            let tip = format!("{}\n\n{}", stages.join("\n"), effects(&preview));
            let text = format!("{} after the edit", time(preview.latency_ms));
            ui.label(text).on_hover_text(&tip);
            ui.separator();
            ui.add(egui::Label::new(RichText::new(stages.join(" · ")).weak()).truncate()).on_hover_text(tip);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.add(egui::Label::new(RichText::new(&preview.rendered_on).weak()).truncate())
                    .on_hover_text("The processor that shades the image");
                if !preview.notes.is_empty() {
                    ui.label(count(preview.notes.len(), "note")).on_hover_text(preview.notes.join("\n"));
                }
                if !preview.warnings.is_empty() {
                    let text = RichText::new(count(preview.warnings.len(), "warning")).color(theme::WARNING).strong();
                    ui.label(text).on_hover_text(preview.warnings.join("\n\n"));
                }
            });
        });
    }
}

fn count(number: usize, what: &str) -> String {
    if number == 1 { format!("1 {what}") } else { format!("{number} {what}s") }
}

/// Explains a stated error.
fn error_parts(error: &ErrorEstimate) -> String {
    format!(
        "Stated error of the effective BRDF: relative L2, and PSNR over pairs of a light and a viewer.\n\
         Facets {:.2} %, visibility {:.2} %, low-rank factors {:.2} %. Interreflection is not examined.\n\
         The panel Accuracy compares it with a reference.",
        100.0 * error.facets,
        100.0 * error.visibility,
        100.0 * error.table
    )
}

fn time(ms: f64) -> String {
    match ms {
        ms if ms < 10.0 => format!("{ms:.1} ms"),
        ms if ms < 1000.0 => format!("{ms:.0} ms"),
        ms => format!("{:.1} s", ms / 1e3),
    }
}

/// Lists every effect with its state and reason.
fn effects(preview: &super::worker::RenderedPreview) -> String {
    let line = |effect: &crate::plan::Effect| {
        format!("{}  {}: {}", if effect.on { "on" } else { "off" }, effect.name, effect.reason)
    };
    preview.effects.iter().map(line).collect::<Vec<_>>().join("\n")
}
