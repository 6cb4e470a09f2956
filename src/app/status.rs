//! The status line: what was recomputed, how long it took, on what, and what is still being done.

use eframe::egui::{self, RichText, Ui};

use super::editor::Editor;
use super::theme;
use super::views::wheel::wheel;
use super::worker::Grade;

impl Editor {
    fn stop_refining(&mut self) {
        if let Some(images) = &self.background.images {
            images.stop();
        }
        self.object.doing = None;
        self.object.stopped = Some(self.document.version());
    }

    pub(super) fn status_ui(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let failed = self.object.failed == Some(self.document.version());
            let Some(made) = self.object.made.clone() else {
                if failed {
                    ui.label("No picture could be made: see the message");
                } else {
                    ui.label("Computing the first picture");
                }
                return;
            };
            let waits = self.object.since.is_some();
            match (waits, made.grade, self.object.doing) {
                _ if failed => {
                    ui.label("Shows the last picture that could be made: see the message");
                }
                (false, Grade::Final, _) => {
                    let (dot, _) = ui.allocate_exact_size(egui::Vec2::splat(12.0), egui::Sense::hover());
                    ui.painter().circle_filled(dot.center(), 4.0, egui::Color32::from_rgb(96, 176, 96));
                    ui.label(format!("Final, {} quality", made.preset));
                }
                (_, _, Some(doing)) => {
                    wheel(ui, 13.0, ui.visuals().strong_text_color());
                    ui.label(doing);
                    let stop = ui.small_button("Stop").on_hover_text("What is shown is good enough");
                    if stop.clicked() {
                        self.stop_refining();
                    }
                }
                _ if self.object.stopped == Some(made.version) => {
                    ui.label("Stopped before the final picture");
                }
                _ => {
                    wheel(ui, 13.0, ui.visuals().strong_text_color());
                    ui.label("Following");
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
            ui.separator();
            let stages: Vec<String> = made.stages.iter().map(|(name, ms)| format!("{name} {}", time(*ms))).collect();
            let tip = format!("{}\n\n{}", stages.join("\n"), effects(&made));
            let text = format!("{} after the edit", time(made.latency_ms));
            ui.label(text).on_hover_text(&tip);
            ui.separator();
            ui.add(egui::Label::new(RichText::new(stages.join(" · ")).weak()).truncate()).on_hover_text(tip);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.add(egui::Label::new(RichText::new(&made.device).weak()).truncate())
                    .on_hover_text("Where the picture is shaded");
                if !made.notes.is_empty() {
                    ui.label(count(made.notes.len(), "note")).on_hover_text(made.notes.join("\n"));
                }
                if !made.warnings.is_empty() {
                    let text = RichText::new(count(made.warnings.len(), "warning")).color(theme::WARNING).strong();
                    ui.label(text).on_hover_text(made.warnings.join("\n\n"));
                }
            });
        });
    }
}

fn count(number: usize, what: &str) -> String {
    if number == 1 { format!("1 {what}") } else { format!("{number} {what}s") }
}

fn time(ms: f64) -> String {
    match ms {
        ms if ms < 10.0 => format!("{ms:.1} ms"),
        ms if ms < 1000.0 => format!("{ms:.0} ms"),
        ms => format!("{:.1} s", ms / 1e3),
    }
}

/// Every effect, on or off, and why.
fn effects(made: &super::worker::Made) -> String {
    let line = |effect: &crate::plan::Effect| {
        format!("{}  {}: {}", if effect.on { "on" } else { "off" }, effect.name, effect.reason)
    };
    made.effects.iter().map(line).collect::<Vec<_>>().join("\n")
}
