//! Settings for a target: a PSNR to reach or a time to keep, searched in the background, and what the search found.

use std::sync::Arc;

use crate::plan::Settings;
use crate::scene::{LoadedScene, Scene};
use crate::tuning::choose::{Measurement, Target};
use eframe::egui::{self, Key, TextEdit, Ui};

use super::{accuracy_chart, fields};
use crate::app::views::spinner::spinner;
use crate::app::worker::{FoundSettings, TargetJob, TargetNews, TargetResult, without_settings};

/// Rows that are reserved for the result of a search, so that nothing below moves when it arrives.
const RESULT_ROWS: f32 = 3.4;
/// Largest targets: PSNR [dB] and time [ms].
const LARGEST: [f64; 2] = [1000.0, 1e7];

/// State of the fields between frames.
#[derive(Default)]
pub struct TargetState {
    /// Texts of the fields: PSNR [dB] and time [ms].
    texts: [String; 2],
    /// A search that the user asked for and that no worker has.
    asked: Option<Target>,
    /// Number of the last search.
    serial: u64,
    /// The last step of the running search, in words.
    step: Option<String>,
    /// The user cancelled the running search, or edited its scene.
    cancelled: bool,
    /// Scene without settings of the last search, and the version that was last compared with it.
    searched_in: Option<Box<LoadedScene>>,
    compared: u64,
    found: Option<FoundSettings>,
    error: Option<String>,
}

impl TargetState {
    /// Returns the search that the user asked for.
    pub fn job(&mut self, version: u64, loaded: &Arc<LoadedScene>) -> Option<TargetJob> {
        let target = self.asked.take()?;
        self.serial += 1;
        self.step = Some("Starting".to_owned());
        self.searched_in = Some(Box::new(without_settings(loaded)));
        (self.compared, self.cancelled) = (version, false);
        Some(TargetJob { serial: self.serial, loaded: loaded.clone(), target })
    }

    /// Returns true while a search waits or runs.
    pub fn is_active(&self) -> bool {
        self.asked.is_some() || self.step.is_some()
    }

    /// Returns true once if the running search must end: the user cancelled it, or edited more than its settings.
    pub fn is_late(&mut self, version: u64, loaded: &LoadedScene) -> bool {
        if self.compared != version {
            self.compared = version;
            if self.searched_in.as_ref().is_some_and(|scene| **scene != without_settings(loaded)) {
                self.cancelled |= self.step.is_some();
                (self.found, self.error, self.searched_in) = (None, None, None);
            }
        }
        let late = std::mem::take(&mut self.cancelled);
        if late {
            self.step = None;
            self.serial += 1;
        }
        late
    }

    pub fn receive(&mut self, result: TargetResult) {
        if result.serial.is_some_and(|serial| serial != self.serial) {
            return;
        }
        match result.news {
            TargetNews::Step(step) => self.step = Some(step),
            TargetNews::Found(found) => (self.step, self.found) = (None, Some(*found)),
            TargetNews::Failed(text) => (self.step, self.error) = (None, Some(text)),
        }
    }

    /// Drops what was found for the last document.
    pub fn forget(&mut self) {
        self.cancelled |= self.step.is_some();
        (self.asked, self.found, self.error, self.searched_in) = (None, None, None, None);
    }

    fn ask(&mut self, target: Target) {
        self.cancelled = self.step.is_some();
        (self.asked, self.found, self.error) = (Some(target), None, None);
    }
}

/// Draws the fields and the result. `file` is the path or the name by which the command line opens the scene.
pub fn ui(ui: &mut Ui, scene: &mut Scene, state: &mut TargetState, file: &str) {
    let rows = [
        ("At least", "dB", "The cheapest settings with this PSNR. Press Enter to search for them in the background."),
        (
            "At most",
            "ms",
            "The finest settings whose edits take at most this time. Press Enter to search in the background.",
        ),
    ];
    for (at, (name, unit, tip)) in rows.into_iter().enumerate() {
        fields::row(ui, name, tip, |ui| {
            let edit = ui.add(TextEdit::singleline(&mut state.texts[at]).desired_width(64.0));
            ui.label(unit);
            let entered = edit.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            if ui.button("Search").on_hover_text(tip).clicked() || entered {
                match target(at, &state.texts[at]) {
                    Ok(target) => state.ask(target),
                    Err(error) => (state.found, state.error) = (None, Some(error)),
                }
            }
        });
    }
    fields::reserved(ui, RESULT_ROWS, |ui| result_ui(ui, scene, state, file));
}

/// The target in a field.
fn target(at: usize, text: &str) -> Result<Target, String> {
    let number = text.trim().replace(',', ".").parse::<f64>().unwrap_or(f64::NAN);
    if !(number > 0.0 && number <= LARGEST[at]) {
        return Err(format!("Found \"{text}\"; expected a number above 0 and at most {}.", LARGEST[at]));
    }
    Ok(if at == 0 { Target::Psnr(number) } else { Target::Milliseconds(number) })
}

fn result_ui(ui: &mut Ui, scene: &mut Scene, state: &mut TargetState, file: &str) {
    if let Some(step) = &state.step {
        ui.horizontal(|ui| {
            spinner(ui, 13.0, ui.visuals().strong_text_color());
            if ui.button("Cancel").clicked() {
                state.cancelled = true;
            }
            ui.add(egui::Label::new(step).truncate());
        });
    } else if let Some(error) = &state.error {
        ui.colored_label(ui.visuals().error_fg_color, error);
    } else if let Some(found) = &state.found {
        found_ui(ui, scene, found, file);
    } else {
        ui.weak("Type a PSNR or a time and press Enter. The search tries settings in the background.");
    }
}

fn found_ui(ui: &mut Ui, scene: &mut Scene, found: &FoundSettings, file: &str) {
    ui.label(describe(found));
    if !found.chosen.reaches_target {
        return;
    }
    let chosen = &found.chosen.scene.scene.quality;
    ui.horizontal(|ui| {
        let is_used = scene.quality == *chosen;
        let tip = if is_used { "The scene has these settings" } else { "Give the scene these settings" };
        if ui.add_enabled(!is_used, egui::Button::new("Use")).on_hover_text(tip).on_disabled_hover_text(tip).clicked() {
            scene.quality.clone_from(chosen);
        }
        let tip = "Copy a command that renders the saved scene with these settings";
        if ui.button("Copy as command").on_hover_text(tip).clicked() {
            let (file, image) = (quoted(file), quoted(&format!("{}.png", found.chosen.scene.name)));
            ui.copy_text(format!("biscale render {file} -o {image} {}", found.chosen.options()));
        }
    });
}

/// An argument of a shell.
fn quoted(argument: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./".contains(letter);
    if argument.chars().all(is_plain) { argument.to_owned() } else { format!("'{}'", argument.replace('\'', "'\\''")) }
}

/// Describes what a search reached, and the settings.
fn describe(found: &FoundSettings) -> String {
    let Measurement { ms, psnr_db, psnr_std_error_db, .. } = found.chosen.reached;
    let time = accuracy_chart::milliseconds(ms);
    let accuracy = match (found.chosen.target, found.stated_db) {
        (Target::Milliseconds(_), Some(stated)) => format!("About {stated:.1} dB (stated)"),
        (Target::Milliseconds(_), None) => "No stated error".to_owned(),
        (Target::Psnr(_), _) if psnr_db.is_finite() => format!("{psnr_db:.1} ± {psnr_std_error_db:.1} dB"),
        (Target::Psnr(_), _) => "No difference".to_owned(),
    };
    if !found.chosen.reaches_target {
        return match found.chosen.target {
            Target::Psnr(_) => format!("Not reached: best {accuracy} in {time}."),
            Target::Milliseconds(_) => format!("Not reached: the fastest settings take {time}."),
        };
    }
    let settings = Settings::from_quality(&found.chosen.scene.scene.quality);
    format!("{accuracy} in {time}: {} facets, {} azimuths.", settings.facets, settings.horizon_azimuths)
}
