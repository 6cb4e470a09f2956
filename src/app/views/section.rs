//! The drawing of a section through the tile: height over x in equal scales.

use eframe::egui::{self, Align2, FontId, Pos2, Sense, Stroke, Ui, pos2, vec2};
use glam::Vec2;

use crate::app::panels::fields::format_number;
use crate::app::theme;
use crate::app::worker::Section;

/// Height of the drawing, margin of the lines, and height of the numbers below them [points].
const HEIGHT: f32 = 74.0;
const MARGIN: f32 = 8.0;
const NUMBERS: f32 = 14.0;
/// Height of the drawing with its title [points].
pub const AROUND: f32 = HEIGHT + 34.0;

/// Draws a section. `unit` names the unit of lengths.
pub fn ui(ui: &mut Ui, section: Option<&Section>, unit: &str) {
    ui.horizontal(|ui| {
        ui.strong("Section");
        if let Some(section) = section {
            let (y, height) = (format_number(f64::from(section.y)), format_number(f64::from(section.height())));
            ui.add(
                egui::Label::new(egui::RichText::new(format!("y = {y} {unit}, height {height} {unit}")).weak())
                    .truncate(),
            );
        }
    });
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT), Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Section of the tile"));
    let painter = ui.painter().with_clip_rect(area);
    painter.rect_filled(area, 2.0, ui.visuals().extreme_bg_color);
    let Some(section) = section.filter(|section| section.width > 0.0) else { return };
    let room = area.size() - vec2(2.0 * MARGIN, 2.0 * MARGIN + NUMBERS);
    let scale = (room.x / section.width).min(room.y / section.height().max(1e-6 * section.width));
    let left = area.center().x - 0.5 * scale * section.width;
    let bottom = area.top() + MARGIN + 0.5 * (room.y + scale * section.height());
    let at = |point: Vec2| -> Pos2 { pos2(left + scale * point.x, bottom - scale * (point.y - section.z[0])) };
    let right = left + scale * section.width;
    // Parts of triangles that lie in the neighbouring tiles appear at the opposite side.
    let inside = painter.with_clip_rect(egui::Rect::from_x_y_ranges(left - 1.0..=right + 1.0, area.y_range()));
    let line = Stroke::new(1.5, theme::ACCENT);
    for [a, b] in &section.lines {
        let first = (a.x.min(b.x) / section.width).floor() as i32;
        let last = (a.x.max(b.x) / section.width).floor() as i32;
        for period in first..=last {
            let shift = Vec2::new(period as f32 * section.width, 0.0);
            inside.line_segment([at(*a - shift), at(*b - shift)], line);
        }
    }
    let (font, weak) = (FontId::proportional(9.5), ui.visuals().weak_text_color());
    let below = area.bottom() - 2.0;
    let end = format!("{} {unit}", format_number(f64::from(section.width)));
    painter.text(pos2(left.max(area.left() + 4.0), below), Align2::LEFT_BOTTOM, "0", font.clone(), weak);
    painter.text(pos2(right.min(area.right() - 4.0), below), Align2::RIGHT_BOTTOM, end, font, weak);
    response.on_hover_text("Height over x, with the same scale for both. The plane is where the relief is highest");
}
