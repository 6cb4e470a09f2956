//! What went wrong and what to do, above the views until it is read or mended.

use eframe::egui::{self, Color32, Frame, Ui};

use super::theme;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    Note,
    Trouble,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Message {
    level: Level,
    /// A message of the same source replaces it; when the source is well again it goes.
    source: &'static str,
    text: String,
}

/// All that is to be read.
#[derive(Debug, Default)]
pub struct Messages {
    list: Vec<Message>,
}

impl Messages {
    pub fn put(&mut self, level: Level, source: &'static str, text: impl Into<String>) {
        self.clear(source);
        self.list.push(Message { level, source, text: text.into() });
    }

    pub fn clear(&mut self, source: &str) {
        self.list.retain(|message| message.source != source);
    }

    #[cfg(test)]
    pub fn texts(&self) -> Vec<&str> {
        self.list.iter().map(|message| message.text.as_str()).collect()
    }

    /// Shows them; the source of one that was closed.
    pub fn ui(&mut self, ui: &mut Ui) -> Option<&'static str> {
        let mut closed = None;
        for (at, message) in self.list.iter().enumerate() {
            // Two workers may complain of one thing.
            if self.list[..at].iter().any(|before| before.text == message.text) {
                continue;
            }
            let color = match message.level {
                Level::Note => theme::ACCENT,
                Level::Trouble => theme::WARNING,
            };
            let frame = Frame::new()
                .fill(ui.visuals().panel_fill.lerp_to_gamma(color, 0.22))
                .inner_margin(egui::Margin::symmetric(10, 5));
            frame.show(ui, |ui| {
                ui.horizontal(|ui| {
                    let (dot, _) = ui.allocate_exact_size(egui::Vec2::splat(10.0), egui::Sense::hover());
                    ui.painter().circle_filled(dot.center(), 4.0, color);
                    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                        if ui.add(egui::Button::new("×").fill(Color32::TRANSPARENT)).on_hover_text("Close").clicked() {
                            closed = Some(at);
                        }
                        ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                            ui.add(egui::Label::new(message.text.as_str()).wrap());
                        });
                    });
                });
            });
        }
        let closed = closed.map(|at| self.list.remove(at))?;
        self.list.retain(|message| message.text != closed.text);
        Some(closed.source)
    }
}
