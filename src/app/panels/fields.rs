//! Rows of captions and controls for fields of the scene catalogue, with range, unit and tooltip.

use crate::base::capitalized;
use crate::scene::{Field, FieldShape};
use eframe::egui::{self, Align, Layout, RichText, Ui};
use toml::Table;

use super::controls::{starting_value, value_ui};
use crate::app::views::thumbnails::Thumbnails;

/// Width of the captions [points].
const CAPTION_WIDTH: f32 = 104.0;

/// The document's unit, and the requests that the rows of a panel collect.
#[derive(Clone, Default)]
pub struct PanelContext {
    /// Name of the tile unit.
    pub unit: String,
    /// Key of the field for which the user requests a file.
    pub browse: Option<&'static str>,
    /// Message about an invalid value.
    pub error: Option<String>,
    /// Values in force of fields that are not set.
    pub in_force: Vec<(&'static str, String)>,
    /// The field that has no effect at present, and why.
    pub ignored: Option<(&'static str, &'static str)>,
    /// Images of the choices.
    pub thumbnails: Thumbnails,
    /// Key of the field whose number the user is changing.
    pub changing: Option<&'static str>,
}

/// Draws controls for all fields of a table except `skip`, and writes edits into the table.
pub fn table_ui(ui: &mut Ui, table: &mut Table, fields: &[Field], skip: &[&str], context: &mut PanelContext) {
    for field in fields.iter().filter(|field| !skip.contains(&field.key)) {
        field_ui(ui, table, field, context);
    }
}

/// Draws the caption and the control of one field.
pub fn field_ui(ui: &mut Ui, table: &mut Table, field: &Field, context: &mut PanelContext) {
    let value = table.get(field.key).cloned();
    let is_optional = value.is_none() || field.default.is_none() && matches!(field.shape, FieldShape::Path);
    if let Some(mut value) = value {
        let keep = caption_row(ui, field, context, |ui, context| {
            value_ui(ui, &mut value, &field.shape, field, context);
            let droppable = is_optional && matches!(field.key, "color_path" | "slot_path");
            !(droppable && ui.small_button("×").on_hover_text("Use none").clicked())
        });
        if keep {
            table.insert(field.key.to_owned(), value);
        } else {
            table.remove(field.key);
        }
    } else if let Some(start) = starting_value(&field.shape) {
        caption_row(ui, field, context, |ui, context| match field.shape {
            FieldShape::Path => {
                if ui.button("Choose…").on_hover_text(field.doc).clicked() {
                    context.browse = Some(field.key);
                }
            }
            _ => {
                let in_force = context.in_force.iter().find(|(key, _)| *key == field.key);
                let text = in_force.map_or_else(|| "automatic".to_owned(), |(_, value)| format!("automatic: {value}"));
                let button = ui.add(egui::Button::new(RichText::new(text).weak()).frame(false));
                if button.on_hover_text("Click to set a value").clicked() {
                    table.insert(field.key.to_owned(), start.clone());
                }
            }
        });
    }
}

/// Draws a caption with the field's documentation as tooltip, and a control that fills the rest of the row.
pub fn caption_row<R>(
    ui: &mut Ui,
    field: &Field,
    context: &mut PanelContext,
    control: impl FnOnce(&mut Ui, &mut PanelContext) -> R,
) -> R {
    let Some((_, why)) = context.ignored.filter(|(key, _)| *key == field.key) else {
        return row(ui, &caption(field), &tooltip(field, context), |ui| control(ui, context));
    };
    let tip = format!("{}\nInactive: {why}.", tooltip(field, context));
    row(ui, &caption(field), &tip, |ui| ui.add_enabled_ui(false, |ui| control(ui, context)).inner)
}

/// Returns the field's caption.
pub(super) fn caption(field: &Field) -> String {
    match field.key {
        "path" => "File".to_owned(),
        "color_path" => "Colour image".to_owned(),
        "slot_path" => "Material image".to_owned(),
        "color" => "Colour".to_owned(),
        "colors" if field.doc.contains("directions") => "Colour directions".to_owned(),
        "colors" => "Colours".to_owned(),
        "f0" => "Reflectance".to_owned(),
        "eta" => "Index".to_owned(),
        "svbtdf" => "Captured sheet".to_owned(),
        "fov_deg" => "Field of view".to_owned(),
        "exposure_ev" => "Exposure".to_owned(),
        "count" if field.doc.contains("lights") => "Lights".to_owned(),
        _ => field.label(),
    }
}

/// Draws a row of a caption and a control. The row is as wide as the panel, so a wide control never widens the panel.
pub fn row<R>(ui: &mut Ui, caption: &str, tip: &str, control: impl FnOnce(&mut Ui) -> R) -> R {
    let height = ui.spacing().interact_size.y;
    let row_rect = egui::Rect::from_min_size(ui.cursor().min, egui::vec2(ui.available_width(), height));
    let builder = egui::UiBuilder::new().max_rect(row_rect).layout(Layout::left_to_right(Align::Center));
    let mut row = ui.new_child(builder);
    let captioned =
        row.allocate_ui_with_layout(egui::vec2(CAPTION_WIDTH, height), Layout::left_to_right(Align::Center), |ui| {
            ui.set_min_width(CAPTION_WIDTH);
            ui.add(egui::Label::new(caption).truncate())
        });
    let label = if tip.is_empty() { captioned.inner } else { captioned.inner.on_hover_text(tip) };
    let result = row.label_inputs_by(label.id, control);
    let used = row.min_rect().height().max(height);
    ui.allocate_rect(egui::Rect::from_min_size(row_rect.min, egui::vec2(row_rect.width(), used)), egui::Sense::hover());
    result
}

/// Draws in a place that is at least some rows of text high, so that what lies below does not move.
pub fn reserved<R>(ui: &mut Ui, rows: f32, content: impl FnOnce(&mut Ui) -> R) -> R {
    let text = rows * (ui.text_style_height(&egui::TextStyle::Body) + ui.spacing().item_spacing.y);
    // A row may hold a button.
    let height = text.max(ui.spacing().interact_size.y);
    let inner = ui.scope(|ui| {
        ui.set_min_size(egui::vec2(ui.available_width(), height));
        content(ui)
    });
    inner.inner
}

fn tooltip(field: &Field, context: &PanelContext) -> String {
    let mut text = field.doc.to_owned();
    if !field.unit.is_empty() {
        text.push_str(&format!("\nIn {}.", unit_name(field.unit, context)));
    }
    match field.shape {
        FieldShape::Number { min, max, .. } => {
            text.push_str(&format!("\n{} to {}.", format_number(min), format_number(max)))
        }
        FieldShape::Integer { min, max } if max < i64::MAX => text.push_str(&format!("\n{min} to {max}.")),
        _ => {}
    }
    if let Some(default) = field.default {
        text.push_str(&format!("\nDefault: {}.", format_number(default)));
    }
    text
}

fn unit_name(unit: &str, context: &PanelContext) -> String {
    if unit == "tile units" && !context.unit.is_empty() { context.unit.clone() } else { unit.to_owned() }
}

/// Formats a number with up to four decimals, without trailing zeros.
pub fn format_number(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

pub(super) fn suffix(unit: &str, context: &PanelContext) -> String {
    match unit {
        "degrees" => "°".to_owned(),
        "tile units" if !context.unit.is_empty() => format!(" {}", context.unit),
        "EV" => " EV".to_owned(),
        _ => String::new(),
    }
}

/// Returns the displayed form of a key: `cook_torrance` becomes `Cook-Torrance`.
pub fn display_name(name: &str) -> String {
    match name {
        "merl" => return "Measured (MERL)".to_owned(),
        "rgl" => return "Measured (RGL)".to_owned(),
        "utia" => return "Measured (UTIA)".to_owned(),
        "npz" => return "Table (.npz)".to_owned(),
        "ggx" => return "GGX".to_owned(),
        "cpu" | "gpu" => return name.to_uppercase(),
        "heightfield" => return "Height field".to_owned(),
        "blinn_phong" => return "Blinn-Phong".to_owned(),
        "cook_torrance" => return "Cook-Torrance".to_owned(),
        "v" | "u" => return format!("{}-shaped", name.to_uppercase()),
        "wu2011" => return "As the 2011 paper".to_owned(),
        _ => {}
    }
    capitalized(&name.replace('_', " "))
}
