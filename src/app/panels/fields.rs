//! Widgets from the scene catalogue: a field's shape decides its control; its range, unit and text come along.

use crate::scene::{Field, FieldShape};
use eframe::egui::{self, Align, Layout, RichText, Ui};
use toml::Table;

use super::controls::{starting_value, value_ui};

/// Width of captions beside controls.
const CAPTION: f32 = 104.0;

/// What panels know of the document around the table they edit.
#[derive(Debug, Clone, Default)]
pub struct Around {
    /// What a tile unit is called.
    pub unit: String,
    /// A file was asked for: the key of the field.
    pub browse: Option<&'static str>,
    /// What is wrong with a value that was typed.
    pub complaint: Option<String>,
}

/// Controls for all fields of a table but `skip`. The table holds what the person left.
pub fn table_ui(ui: &mut Ui, table: &mut Table, fields: &[Field], skip: &[&str], around: &mut Around) {
    for field in fields.iter().filter(|field| !skip.contains(&field.key)) {
        field_ui(ui, table, field, around);
    }
}

/// One field's caption and control.
pub fn field_ui(ui: &mut Ui, table: &mut Table, field: &Field, around: &mut Around) {
    let value = table.get(field.key).cloned();
    let is_optional = value.is_none() || field.default.is_none() && matches!(field.shape, FieldShape::Path);
    if let Some(mut value) = value {
        let keep = caption_row(ui, field, around, |ui, around| {
            value_ui(ui, &mut value, &field.shape, field, around);
            let droppable = is_optional && matches!(field.key, "color_path" | "slot_path");
            !(droppable && ui.small_button("×").on_hover_text("Use none").clicked())
        });
        if keep {
            table.insert(field.key.to_owned(), value);
        } else {
            table.remove(field.key);
        }
    } else if let Some(start) = starting_value(&field.shape) {
        caption_row(ui, field, around, |ui, around| match field.shape {
            FieldShape::Path => {
                if ui.button("Choose…").on_hover_text(field.doc).clicked() {
                    around.browse = Some(field.key);
                }
            }
            _ => {
                let button = ui.add(egui::Button::new(RichText::new("automatic").weak()).frame(false));
                if button.on_hover_text("Click to set by hand").clicked() {
                    table.insert(field.key.to_owned(), start.clone());
                }
            }
        });
    }
}

/// A caption with the field's text as tooltip, and a control that fills the rest of the row.
pub fn caption_row<R>(
    ui: &mut Ui,
    field: &Field,
    around: &mut Around,
    control: impl FnOnce(&mut Ui, &mut Around) -> R,
) -> R {
    row(ui, &caption(field), &tooltip(field, around), |ui| control(ui, around))
}

/// The field's name as a person would say it.
pub(super) fn caption(field: &Field) -> String {
    match field.key {
        "path" => "File".to_owned(),
        "color_path" => "Colour image".to_owned(),
        "slot_path" => "Material image".to_owned(),
        "color" => "Colour".to_owned(),
        "f0" => "Reflectance".to_owned(),
        "fov_deg" => "Field of view".to_owned(),
        "exposure_ev" => "Exposure".to_owned(),
        "count" if field.doc.contains("lights") => "Lights".to_owned(),
        _ => field.label(),
    }
}

/// A row of any caption and control. It is as wide as the panel, whatever the control asks for: panels never grow by
/// themselves.
pub fn row<R>(ui: &mut Ui, caption: &str, tip: &str, control: impl FnOnce(&mut Ui) -> R) -> R {
    let height = ui.spacing().interact_size.y;
    let place = egui::Rect::from_min_size(ui.cursor().min, egui::vec2(ui.available_width(), height));
    let builder = egui::UiBuilder::new().max_rect(place).layout(Layout::left_to_right(Align::Center));
    let mut line = ui.new_child(builder);
    let captioned =
        line.allocate_ui_with_layout(egui::vec2(CAPTION, height), Layout::left_to_right(Align::Center), |ui| {
            ui.set_min_width(CAPTION);
            ui.add(egui::Label::new(caption).truncate())
        });
    let label = if tip.is_empty() { captioned.inner } else { captioned.inner.on_hover_text(tip) };
    let result = line.label_inputs_by(label.id, control);
    let used = line.min_rect().height().max(height);
    ui.allocate_rect(egui::Rect::from_min_size(place.min, egui::vec2(place.width(), used)), egui::Sense::hover());
    result
}

fn tooltip(field: &Field, around: &Around) -> String {
    let mut text = field.doc.to_owned();
    if !field.unit.is_empty() {
        text.push_str(&format!("\nIn {}.", unit_words(field.unit, around)));
    }
    match field.shape {
        FieldShape::Number { min, max, .. } => text.push_str(&format!("\n{} to {}.", short(min), short(max))),
        FieldShape::Integer { min, max } if max < i64::MAX => text.push_str(&format!("\n{min} to {max}.")),
        _ => {}
    }
    if let Some(default) = field.default {
        text.push_str(&format!("\nUsually {}.", short(default)));
    }
    text
}

fn unit_words(unit: &str, around: &Around) -> String {
    if unit == "tile units" && !around.unit.is_empty() { around.unit.clone() } else { unit.to_owned() }
}

/// A number as a person writes it.
pub fn short(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

pub(super) fn suffix(unit: &str, around: &Around) -> String {
    match unit {
        "degrees" => "°".to_owned(),
        "tile units" if !around.unit.is_empty() => format!(" {}", around.unit),
        "EV" => " EV".to_owned(),
        _ => String::new(),
    }
}

/// `cook_torrance` as a person reads it.
pub fn words(name: &str) -> String {
    match name {
        "merl" => return "Measured (MERL)".to_owned(),
        "rgl" => return "Measured (RGL)".to_owned(),
        "utia" => return "Measured (UTIA)".to_owned(),
        "npz" => return "Table (.npz)".to_owned(),
        "ggx" => return "GGX".to_owned(),
        "heightfield" => return "Height-field".to_owned(),
        "blinn_phong" => return "Blinn-Phong".to_owned(),
        "cook_torrance" => return "Cook-Torrance".to_owned(),
        "v" | "u" => return format!("{}-shaped", name.to_uppercase()),
        "wu2011" => return "As the 2011 paper".to_owned(),
        _ => {}
    }
    let words = name.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}
