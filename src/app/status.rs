//! The strip at the foot: state and cost of the image, settings that are faster or finer, and what is left out.
//!
//! A narrow window drops fields by their rank, but never the state and never what is left out. The state and the settings
//! have places of fixed width, so that nothing moves while results arrive.

use eframe::egui::{self, Button, FontId, Label, RichText, TextStyle, Ui, vec2};

use super::editor::Editor;
use super::panels::effects::caption;
use super::panels::{accuracy, place_of_remedy};
use super::status_state::time;
use super::theme;
use super::worker::{AccuracyPoint, RenderedPreview};
use crate::base::capitalized;
use crate::plan::Effect;

/// Width of a separator with its spacing, of the padding of a button, and of the dot before the state [points].
const SEPARATOR: f32 = 20.0;
const PADDING: f32 = 14.0;
const DOT: f32 = 20.0;
/// Widths of the places of the state, and of faster or finer settings [points].
const STATE: f32 = 310.0;
const SETTINGS: f32 = 158.0;
/// Width of a menu of texts [points].
const MENU: f32 = 400.0;

/// A field behind the state.
struct Field {
    text: String,
    /// Fields of a higher rank are dropped first; rank 0 is never dropped.
    rank: u8,
    /// Width of its place [points], if that does not follow the text.
    fixed: Option<f32>,
    kind: FieldKind,
}

enum FieldKind {
    /// Settings that a click takes.
    Take(AccuracyPoint),
    Measure,
    /// A text that says why there are no such settings.
    Text,
    LeftOut,
    Warnings,
    Notes,
    Processor,
}

impl Editor {
    pub(super) fn status_ui(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let Some(preview) = self.object.preview.clone() else {
                if self.object.failed == Some(self.document.version()) {
                    ui.label("No image could be computed: see the message");
                } else {
                    ui.label("Computing the first image");
                }
                return;
            };
            let fields = self.fields(&preview);
            let reserved: f32 = fields.iter().filter(|field| field.rank == 0).map(|field| field.width(ui)).sum();
            let state = vec2(STATE.min(ui.available_width() - reserved).max(60.0), ui.spacing().interact_size.y);
            self.place(ui, state, |editor, ui| editor.state_ui(ui, &preview));
            self.export_ui(ui);
            for field in that_fit(fields, ui) {
                // A place without a text is no field.
                ui.add_visible(!field.text.is_empty(), egui::Separator::default());
                match field.fixed {
                    Some(width) => {
                        let size = vec2(width, ui.spacing().interact_size.y);
                        self.place(ui, size, |editor, ui| editor.field_ui(ui, &field, &preview));
                    }
                    None => self.field_ui(ui, &field, &preview),
                }
            }
            if ui.available_width() > 3.0 * SEPARATOR {
                ui.separator();
                let stages = stages(&preview);
                let tip = format!("{}\n\n{}", stages.join("\n"), effects(&preview));
                let text = format!("took {} · {}", time(preview.latency_ms), stages.join(" · "));
                ui.add(Label::new(RichText::new(text).weak()).truncate()).on_hover_text(tip);
            }
        });
    }

    /// Draws in a place of fixed size.
    fn place(&mut self, ui: &mut Ui, size: egui::Vec2, content: impl FnOnce(&mut Self, &mut Ui)) {
        let (area, _) = ui.allocate_exact_size(size, egui::Sense::hover());
        let layout = egui::Layout::left_to_right(egui::Align::Center);
        let mut inner = ui.new_child(egui::UiBuilder::new().max_rect(area).layout(layout));
        inner.set_clip_rect(area.intersect(ui.clip_rect()));
        content(self, &mut inner);
    }

    fn fields(&self, preview: &RenderedPreview) -> Vec<Field> {
        let field = |text: String, rank: u8, kind: FieldKind| Field { text, rank, fixed: None, kind };
        let mut fields = Vec::new();
        let (version, is_measurable) = (self.document.version(), self.document.scene().slab.is_none());
        if is_measurable {
            let is_measured = self.accuracy.now(version).is_some();
            for (at, point) in self.accuracy.neighbours(version).into_iter().enumerate() {
                let name = ["Faster", "Finer"][at];
                let (text, kind) = match point {
                    Some(point) => (format!("{name}: {}", briefly(&point)), FieldKind::Take(point)),
                    None if is_measured => (format!("{name}: none"), FieldKind::Text),
                    None if at > 0 => (String::new(), FieldKind::Text),
                    None => ("Measure".to_owned(), FieldKind::Measure),
                };
                fields.push(Field { text, rank: 2 + at as u8, fixed: Some(SETTINGS), kind });
            }
        }
        let left_out = self.left_out();
        if !left_out.is_empty() {
            fields.push(field(format!("{} left out", count(left_out.len(), "effect")), 0, FieldKind::LeftOut));
        }
        if !self.object.warnings.is_empty() {
            fields.push(field(count(self.object.warnings.len(), "warning"), 1, FieldKind::Warnings));
        }
        if !preview.notes.is_empty() {
            fields.push(field(count(preview.notes.len(), "note"), 5, FieldKind::Notes));
        }
        let processor = preview.rendered_on.split(" (").next().unwrap_or_default();
        fields.push(field(processor.to_owned(), 4, FieldKind::Processor));
        fields
    }

    fn field_ui(&mut self, ui: &mut Ui, field: &Field, preview: &RenderedPreview) {
        let text = field.text.as_str();
        match &field.kind {
            FieldKind::Take(point) => {
                let tip = format!("Use these settings: {}", accuracy::describe_point(point));
                if ui.add(Button::new(text).frame(false).truncate()).on_hover_text(tip).clicked() {
                    let mut scene = (**self.document.scene()).clone();
                    accuracy::take(&mut scene, point.facets, &preview.effects);
                    self.document.edit_as("Quality", scene);
                }
            }
            FieldKind::Measure => {
                let tip = "Measure accuracy and time of these and of faster and finer settings in the background";
                if let Some(activity) = &self.accuracy.activity {
                    ui.add(Label::new(RichText::new(format!("Measuring: {activity}")).weak()).truncate());
                } else if ui.add(Button::new(text).small()).on_hover_text(tip).clicked() {
                    self.accuracy.wanted = true;
                }
            }
            FieldKind::Text => {
                ui.weak(text);
            }
            FieldKind::LeftOut => self.left_out_ui(ui, text),
            FieldKind::Warnings => {
                let text = RichText::new(text).color(theme::warning(ui.visuals())).strong();
                text_menu(ui, text, |ui| self.warnings_ui(ui));
            }
            FieldKind::Notes => {
                text_menu(ui, text, |ui| {
                    for note in &preview.notes {
                        ui.label(note);
                    }
                });
            }
            FieldKind::Processor => {
                let tip = format!("The processor that shades the image: {}", preview.rendered_on);
                ui.label(RichText::new(text).weak()).on_hover_text(tip);
            }
        }
    }

    /// Lists the warnings, each with a button that shows where its remedy is.
    fn warnings_ui(&mut self, ui: &mut Ui) {
        for warning in &self.object.warnings {
            // The command line quotes names, and puts `warning:` before the text. The names themselves stay as they are.
            let text = warning.replace('`', "");
            ui.label(if warning.starts_with('`') { text } else { capitalized(&text) });
            let (tab, section) = place_of_remedy(warning);
            if ui.button("Show").on_hover_text(format!("Open {section} of the parameters")).clicked() {
                (self.tab, self.reveal) = (tab, Some(section));
                ui.close();
            }
        }
    }

    fn export_ui(&mut self, ui: &mut Ui) {
        let Some((part, what)) = self.exporting else { return };
        ui.separator();
        ui.add(egui::ProgressBar::new(part).desired_width(140.0).text(what));
        if ui.small_button("Cancel").clicked()
            && let Some(worker) = &self.background.exports
        {
            worker.cancel();
            self.exporting = None;
        }
    }
}

impl Field {
    fn width(&self, ui: &Ui) -> f32 {
        SEPARATOR + self.fixed.unwrap_or_else(|| text_width(ui, &self.text) + PADDING)
    }
}

fn text_width(ui: &Ui, text: &str) -> f32 {
    let font: FontId = TextStyle::Body.resolve(ui.style());
    ui.painter().layout_no_wrap(text.to_owned(), font, ui.visuals().text_color()).size().x
}

/// Drops fields by their rank until the others fit.
fn that_fit(mut fields: Vec<Field>, ui: &Ui) -> Vec<Field> {
    let width = |fields: &[Field]| fields.iter().map(|field| field.width(ui)).sum::<f32>();
    while width(&fields) > ui.available_width() - DOT {
        let worst = (0..fields.len()).rev().max_by_key(|at| (fields[*at].rank, std::cmp::Reverse(*at)));
        match worst.filter(|at| fields[*at].rank > 0) {
            Some(at) => drop(fields.remove(at)),
            None => break,
        }
    }
    fields
}

/// Draws a button that opens texts and buttons. The layout of menus would space words out.
pub fn text_menu(ui: &mut Ui, name: impl Into<egui::WidgetText>, content: impl FnOnce(&mut Ui)) {
    ui.menu_button(name.into(), |ui| {
        ui.set_max_width(MENU);
        ui.with_layout(egui::Layout::top_down(egui::Align::Min), content);
    });
}

fn count(number: usize, what: &str) -> String {
    if number == 1 { format!("1 {what}") } else { format!("{number} {what}s") }
}

fn stages(preview: &RenderedPreview) -> Vec<String> {
    preview.stages.iter().map(|(name, ms)| format!("{} {}", caption(name).to_lowercase(), time(*ms))).collect()
}

/// PSNR and time of a point.
fn briefly(point: &AccuracyPoint) -> String {
    let psnr = point.compared.psnr_db;
    let accuracy = if psnr.is_finite() { format!("{psnr:.0} dB") } else { "exact".to_owned() };
    format!("{accuracy} · {}", time(point.ms))
}

/// Lists every effect with its state and reason.
fn effects(preview: &RenderedPreview) -> String {
    let line =
        |effect: &Effect| format!("{}  {}: {}", if effect.on { "on" } else { "off" }, effect.name, effect.reason);
    preview.effects.iter().map(line).collect::<Vec<_>>().join("\n")
}
