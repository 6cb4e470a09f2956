//! Light that the result lacks although it may matter: the chip of the strip, a note once per scene, and a line in exports.

use eframe::egui::{RichText, Ui};

use super::editor::Editor;
use super::messages::{Level, Reply};
use super::panels::effects::caption;
use super::status::text_menu;
use super::status_state::time;
use super::theme;
use crate::plan::{LeftOut, switch_mut};
use crate::scene::Switch;

/// Source of the note, and its buttons.
pub(super) const SOURCE: &str = "left out";
const BUTTONS: &[&str] = &["Add", "Keep out"];

impl Editor {
    /// Effects that are left out although they may add more light than the quality tolerates.
    pub(super) fn left_out(&self) -> Vec<(&'static str, LeftOut)> {
        self.object.effects().iter().filter_map(|effect| Some((effect.name, effect.left_out?))).collect()
    }

    /// The effects that are left out, in one line; `None` if there are none.
    pub(super) fn left_out_line(&self) -> Option<String> {
        let lines: Vec<String> = self.left_out().iter().map(|(name, left_out)| line(name, left_out)).collect();
        (!lines.is_empty()).then(|| lines.join(" "))
    }

    /// Draws the chip, which opens what is left out with a button that adds it.
    pub(super) fn left_out_ui(&mut self, ui: &mut Ui, text: &str) {
        let missing = self.left_out();
        let mut added = None;
        let text = RichText::new(text).color(theme::warning(ui.visuals())).strong();
        text_menu(ui, text, |ui| {
            for (name, left_out) in &missing {
                ui.label(line(name, left_out));
                let tolerance = 100.0 * left_out.tolerance;
                ui.label(format!(
                    "The quality tolerates {tolerance:.1} %. The PSNR counts only the light that is simulated."
                ));
                if ui.button("Add").on_hover_text("Simulate it; one undo step").clicked() {
                    added = Some(*name);
                    ui.close();
                }
            }
        });
        if let Some(name) = added {
            self.add_effect(name);
        }
    }

    /// Notes once per scene what its refined image lacks.
    pub(super) fn note_left_out(&mut self) {
        if self.object.refined_effects.is_none() || self.noted_left_out {
            return;
        }
        if let Some(line) = self.left_out_line() {
            self.noted_left_out = true;
            self.messages.put_with(Level::Guide, SOURCE, line, BUTTONS);
        }
    }

    /// Takes the answer to the note.
    pub(super) fn answer_left_out(&mut self, reply: &Reply) {
        if reply.source == SOURCE && reply.button == Some(0) {
            self.left_out().into_iter().for_each(|(name, _)| self.add_effect(name));
        }
    }

    fn add_effect(&mut self, name: &'static str) {
        let mut scene = (**self.document.scene()).clone();
        if let Some(switch) = switch_mut(&mut scene.effects, name) {
            *switch = Switch::On;
        }
        self.messages.clear(SOURCE);
        self.document.edit_as(&format!("Add {}", caption(name).to_lowercase()), scene);
    }
}

fn line(name: &str, left_out: &LeftOut) -> String {
    let (share, error, ms) = (100.0 * left_out.share, 100.0 * left_out.std_error, time(left_out.predicted_ms));
    format!("{} is left out: {share:.0} ± {error:.0} % of the light. It takes about {ms}.", caption(name))
}
