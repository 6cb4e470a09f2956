//! The strip at the foot: state and cost of the image, settings that are faster or finer, and what is left out.
//!
//! A narrow window drops fields by their rank, but never the state and never what is left out.

use eframe::egui::{self, Button, FontId, Label, RichText, TextStyle, Ui, vec2};

use super::editor::Editor;
use super::panels::accuracy;
use super::panels::effects::caption;
use super::panels::fields::display_name;
use super::theme;
use super::views::spinner::spinner;
use super::worker::{AccuracyPoint, Grade, RenderedPreview};
use crate::effective::ErrorEstimate;
use crate::plan::{Effect, LeftOut, switch_mut};
use crate::scene::Switch;

/// Width of a separator with its spacing, of the padding of a button, and of the dot before the state [points].
const SEPARATOR: f32 = 20.0;
const PADDING: f32 = 14.0;
const DOT: f32 = 20.0;

/// A field behind the state.
struct Field {
    text: String,
    /// Fields of a higher rank are dropped first; rank 0 is never dropped.
    rank: u8,
    kind: FieldKind,
}

enum FieldKind {
    /// Settings that a click takes.
    Take(AccuracyPoint),
    Measure,
    LeftOut,
    Warnings,
    Notes,
    Processor,
}

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
            self.state_ui(ui, &preview, reserved);
            self.export_ui(ui);
            for field in that_fit(fields, ui) {
                ui.separator();
                self.field_ui(ui, &field, &preview);
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

    /// Draws what the image shows, or what is being computed. `reserved` points stay free behind it.
    fn state_ui(&mut self, ui: &mut Ui, preview: &RenderedPreview, reserved: f32) {
        let is_failed = self.object.failed == Some(self.document.version());
        let is_pending = self.object.requested_at.is_some();
        if is_failed {
            ui.label("Shows the last image that could be computed: see the message");
        } else if !is_pending && preview.grade == Grade::Final {
            let (dot, _) = ui.allocate_exact_size(vec2(12.0, 12.0), egui::Sense::hover());
            ui.painter().circle_filled(dot.center(), 4.0, egui::Color32::from_rgb(96, 176, 96));
            let text = format!("{} · {}", display_name(preview.preset), self.cost(preview));
            let width = text_width(ui, &text).min(ui.available_width() - reserved).max(60.0);
            let height = ui.spacing().interact_size.y;
            ui.allocate_ui(vec2(width + 1.0, height), |ui| {
                ui.add(Label::new(text).truncate()).on_hover_text(self.cost_tip());
            });
        } else if let Some(doing) = self.object.activity {
            spinner(ui, 13.0, ui.visuals().strong_text_color());
            ui.label(doing);
            if ui.small_button("Stop").on_hover_text("Keep the current image and stop refining it").clicked() {
                self.stop_refining();
            }
        } else if self.object.stopped == Some(preview.version) {
            ui.label("Stopped before the final image");
        } else {
            spinner(ui, 13.0, ui.visuals().strong_text_color());
            ui.label("Updating");
        }
    }

    /// Accuracy and time of an edit at the scene's settings: as measured, else as stated and forecast.
    fn cost(&self, preview: &RenderedPreview) -> String {
        let version = self.document.version();
        if self.document.scene().slab.is_some() {
            return "slab".to_owned();
        }
        if let Some(point) = self.accuracy.now(version) {
            return describe(&point);
        }
        let forecast: f64 = self.effects(preview).iter().filter(|effect| effect.on).map(cost_of).sum();
        let time = if forecast > 0.0 { format!(" · ~{}", time(forecast)) } else { String::new() };
        let accuracy = match self.object.stated_error().and_then(|error| error.psnr_db) {
            Some(psnr) => format!("{psnr:.0} ± {:.0} dB stated", accuracy::STATED_DB),
            None => "accuracy not measured".to_owned(),
        };
        format!("{accuracy}{time}")
    }

    fn cost_tip(&self) -> String {
        let measured = "PSNR of the effective BRDF against the reference, of what is simulated, and the time from an edit of \
                        the geometry to the effective BRDF.";
        match self.object.stated_error() {
            Some(error) => format!("{measured}\n{}", error_parts(&error)),
            None => measured.to_owned(),
        }
    }

    /// The plan of the refined image, so that drafts do not change what is left out.
    fn effects<'a>(&'a self, preview: &'a RenderedPreview) -> &'a [Effect] {
        self.object.refined_effects.as_deref().unwrap_or(&preview.effects)
    }

    fn fields(&self, preview: &RenderedPreview) -> Vec<Field> {
        let field = |text: String, rank: u8, kind: FieldKind| Field { text, rank, kind };
        let mut fields = Vec::new();
        let is_measurable = self.document.scene().slab.is_none();
        let [faster, finer] = self.accuracy.neighbours(self.document.version());
        for (name, point) in [("Faster", faster), ("Finer", finer)] {
            if let Some(point) = point {
                fields.push(field(format!("{name}: {}", describe(&point)), 3, FieldKind::Take(point)));
            }
        }
        if is_measurable && self.accuracy.now(self.document.version()).is_none() {
            let text = if self.accuracy.is_active() { "Measuring" } else { "Measure" };
            fields.push(field(text.to_owned(), 2, FieldKind::Measure));
        }
        let left_out = self.effects(preview).iter().filter(|effect| effect.left_out.is_some()).count();
        if left_out > 0 {
            fields.push(field(format!("{} left out", count(left_out, "effect")), 0, FieldKind::LeftOut));
        }
        if !preview.warnings.is_empty() {
            fields.push(field(count(preview.warnings.len(), "warning"), 1, FieldKind::Warnings));
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
                if ui.add(Button::new(text).frame(false)).on_hover_text(tip).clicked() {
                    let mut scene = (**self.document.scene()).clone();
                    accuracy::take(&mut scene, point.facets, &preview.effects);
                    self.document.edit_as("Quality", scene);
                }
            }
            FieldKind::Measure => {
                let tip = "Measure accuracy and time of these and of faster and finer settings in the background";
                let is_idle = !self.accuracy.is_active();
                if ui.add_enabled(is_idle, Button::new(text).small()).on_hover_text(tip).clicked() {
                    self.accuracy.wanted = true;
                }
            }
            FieldKind::LeftOut => self.left_out_ui(ui, text, preview),
            FieldKind::Warnings => {
                let text = RichText::new(text).color(theme::warning(ui.visuals())).strong();
                ui.menu_button(text, |ui| list_ui(ui, &preview.warnings));
            }
            FieldKind::Notes => {
                ui.menu_button(text, |ui| list_ui(ui, &preview.notes));
            }
            FieldKind::Processor => {
                let tip = format!("The processor that shades the image: {}", preview.rendered_on);
                ui.label(RichText::new(text).weak()).on_hover_text(tip);
            }
        }
    }

    /// Draws the chip of the light that is missing, with a button that adds it.
    fn left_out_ui(&mut self, ui: &mut Ui, text: &str, preview: &RenderedPreview) {
        let missing: Vec<(&'static str, LeftOut)> =
            self.effects(preview).iter().filter_map(|effect| Some((effect.name, effect.left_out?))).collect();
        let mut added = None;
        let text = RichText::new(text).color(theme::warning(ui.visuals())).strong();
        ui.menu_button(text, |ui| {
            ui.set_max_width(360.0);
            for (name, left_out) in &missing {
                ui.label(format!(
                    "{} is left out: up to {:.0} % of the light that is reflected directly, more than the tolerance of \
                     {:.1} %. It takes about {}. The dB are those of what is simulated.",
                    caption(name),
                    100.0 * left_out.share,
                    100.0 * left_out.tolerance,
                    time(left_out.predicted_ms)
                ));
                if ui.button("Add").on_hover_text("Simulate it; one undo step").clicked() {
                    added = Some(*name);
                    ui.close();
                }
            }
        });
        if let Some(name) = added {
            let mut scene = (**self.document.scene()).clone();
            if let Some(switch) = switch_mut(&mut scene.effects, name) {
                *switch = Switch::On;
            }
            self.document.edit_as(&format!("Add {}", caption(name).to_lowercase()), scene);
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
        text_width(ui, &self.text) + SEPARATOR + PADDING
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

fn list_ui(ui: &mut Ui, texts: &[String]) {
    ui.set_max_width(420.0);
    for text in texts {
        ui.label(text);
    }
}

fn count(number: usize, what: &str) -> String {
    if number == 1 { format!("1 {what}") } else { format!("{number} {what}s") }
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
        "The result states an error of about {}: facets {:.2} %, visibility {:.2} %, low-rank factors {:.2} %. Interreflection \
         is not examined.",
        error.describe(),
        100.0 * error.facets,
        100.0 * error.visibility,
        100.0 * error.table
    )
}

fn stages(preview: &RenderedPreview) -> Vec<String> {
    preview.stages.iter().map(|(name, ms)| format!("{name} {}", time(*ms))).collect()
}

fn time(ms: f64) -> String {
    match ms {
        ms if ms < 10.0 => format!("{ms:.1} ms"),
        ms if ms < 1000.0 => format!("{ms:.0} ms"),
        ms => format!("{:.1} s", ms / 1e3),
    }
}

/// Lists every effect with its state and reason.
fn effects(preview: &RenderedPreview) -> String {
    let line =
        |effect: &Effect| format!("{}  {}: {}", if effect.on { "on" } else { "off" }, effect.name, effect.reason);
    preview.effects.iter().map(line).collect::<Vec<_>>().join("\n")
}
