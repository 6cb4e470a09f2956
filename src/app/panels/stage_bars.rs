//! Bars of the time that each stage took from an edit to its refined image.

use eframe::egui::{self, Align2, FontId, Sense, Ui, vec2};

use super::accuracy_chart::milliseconds;
use super::effects::caption;
use crate::app::theme;

/// Height of a row, width of the names and of the times [points].
const ROW: f32 = 17.0;
const NAMES: f32 = 116.0;
const TIMES: f32 = 66.0;
const TEXT: f32 = 11.5;
/// Room for the scroll bar of the panel [points].
const SCROLL_BAR: f32 = 8.0;

/// Draws one bar per stage, in their order, and the sum.
pub fn ui(ui: &mut Ui, stages: &[(&'static str, f64)]) {
    if stages.is_empty() {
        ui.weak("The times appear once an image is refined.");
        return;
    }
    let sum: f64 = stages.iter().map(|(_, ms)| ms).sum();
    let longest = stages.iter().map(|(_, ms)| *ms).fold(0.0, f64::max).max(1e-9);
    let rows = stages.len() + 1;
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), ROW * rows as f32), Sense::hover());
    let label = format!("Stages, {} in all", milliseconds(sum));
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, label.clone()));
    let painter = ui.painter().with_clip_rect(area);
    let (text, font) = (ui.visuals().text_color(), FontId::proportional(TEXT));
    let lines = stages.iter().map(|(name, ms)| (caption(name), *ms, Some(*ms / longest)));
    for (at, (name, ms, part)) in lines.chain([("Sum".to_owned(), sum, None)]).enumerate() {
        let row =
            egui::Rect::from_min_size(area.min + vec2(0.0, ROW * at as f32), vec2(area.width() - SCROLL_BAR, ROW));
        painter.text(row.left_center(), Align2::LEFT_CENTER, name, font.clone(), text);
        painter.text(row.right_center(), Align2::RIGHT_CENTER, milliseconds(ms), font.clone(), text);
        let width = row.width() - NAMES - TIMES;
        match part {
            Some(part) => {
                let size = vec2((width * part as f32).max(1.0), ROW - 6.0);
                let bar = egui::Rect::from_min_size(row.left_top() + vec2(NAMES, 3.0), size);
                painter.rect_filled(bar, 2.0, theme::ACCENT);
            }
            None => {
                let line = ui.visuals().widgets.noninteractive.bg_stroke;
                painter.line_segment([row.left_top(), row.right_top()], line);
            }
        }
    }
    response.on_hover_text("Time of each stage from the last edit to its refined image");
}
