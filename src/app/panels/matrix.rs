//! The pattern of a weave: a name, or a matrix of cells.

use crate::scene::FloatPattern;
use eframe::egui::{self, Color32, Sense, Ui, vec2};
use toml::Value;

use super::fields::display_name;

const CELL: f32 = 15.0;

pub fn is_matrix(value: &Value) -> bool {
    value.as_array().is_some_and(|rows| rows.iter().all(Value::is_array))
}

/// Draws the choice of a named pattern or a matrix.
pub fn pattern_ui(ui: &mut Ui, value: &mut Value, names: &[&str], key: &str) {
    ui.vertical(|ui| {
        let now = value.as_str().unwrap_or("matrix").to_owned();
        egui::ComboBox::from_id_salt((key, "pattern")).selected_text(display_name(&now)).show_ui(ui, |ui| {
            for name in names {
                if ui.selectable_label(*name == now, display_name(name)).clicked() {
                    *value = Value::String((*name).to_owned());
                }
            }
            if ui.selectable_label(now == "matrix", "Matrix").clicked() && now != "matrix" {
                *value = matrix_of(&now);
            }
        });
        if is_matrix(value) {
            self::ui(ui, value);
        }
    });
}

/// Returns a named pattern as a matrix, which the user can then edit.
fn matrix_of(name: &str) -> Value {
    let bit: fn(usize, usize) -> bool = match FloatPattern::ALL.iter().find(|pattern| pattern.name() == name) {
        Some(FloatPattern::Twill) => |row, column| (row + column) % 4 < 2,
        Some(FloatPattern::Satin) => |row, column| (row * 2) % 5 != column % 5,
        _ => |row, column| (row + column) % 2 == 0,
    };
    let side = match name {
        "twill" => 4,
        "satin" => 5,
        _ => 2,
    };
    let row = |row: usize| Value::Array((0..side).map(|column| Value::Integer(i64::from(bit(row, column)))).collect());
    Value::Array((0..side).map(row).collect())
}

/// Draws the cells of a matrix. A click inverts a cell, and cells with the warp on top are filled.
pub fn ui(ui: &mut Ui, value: &mut Value) {
    let Value::Array(rows) = value else { return };
    let columns = rows.first().and_then(Value::as_array).map_or(0, Vec::len);
    let size = vec2(columns as f32, rows.len() as f32) * CELL;
    let (area, response) = ui.allocate_exact_size(size, Sense::click());
    let clicked = response.interact_pointer_pos().filter(|_| response.clicked());
    for (row, cells) in rows.iter_mut().enumerate() {
        let Value::Array(cells) = cells else { continue };
        for (column, cell) in cells.iter_mut().enumerate() {
            let corner = area.min + vec2(column as f32, row as f32) * CELL;
            let cell_rect = egui::Rect::from_min_size(corner, egui::Vec2::splat(CELL)).shrink(1.0);
            if clicked.is_some_and(|at| cell_rect.contains(at)) {
                *cell = Value::Integer(i64::from(cell.as_integer() == Some(0)));
            }
            let is_warp = cell.as_integer() != Some(0);
            let fill = if is_warp { ui.visuals().selection.bg_fill } else { Color32::from_gray(120) };
            ui.painter().rect_filled(cell_rect, 2.0, fill);
        }
    }
    response.on_hover_text("Blue: the warp (along y) is on top. Each row is a weft thread.");
}
