//! The drawing of a section through the tile: height over x in equal scales.

use eframe::egui::{self, Align2, FontId, Pos2, Sense, Stroke, Ui, pos2, vec2};
use glam::Vec2;

use crate::app::panels::fields::format_number;
use crate::app::theme;
use crate::app::worker::Section;
use crate::scene::{Geometry, Tile};

/// Height of the drawing, margin of the lines, and height of the numbers below them [points].
const HEIGHT: f32 = 74.0;
const MARGIN: f32 = 8.0;
const NUMBERS: f32 = 14.0;
/// Height of the drawing with its title [points].
pub const AROUND: f32 = HEIGHT + 34.0;

/// A length in a section [tile units].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Length {
    /// Upwards from the lowest point.
    Up(f32),
    /// Across, from the left edge.
    Across(f32),
}

/// Returns the length that a parameter of the surface sets in a section, if it is one.
pub fn length_of(tile: &Tile, key: &str) -> Option<Length> {
    let pitch = |count: u32| tile.size.x / count.max(1) as f32;
    // A whole number of cells fits the tile.
    let fitted = |spacing: f32| tile.size.x / (tile.size.x / spacing).round().max(1.0);
    Some(match (&tile.geometry, key) {
        (Geometry::Grooves(grooves), "depth") => Length::Up(grooves.depth),
        (Geometry::Grooves(grooves), "bottom_width") => Length::Across(grooves.bottom_width * pitch(grooves.count)),
        (Geometry::Pyramids(pyramids), "height") => Length::Up(pyramids.height * (1.0 - pyramids.truncation)),
        (Geometry::Pyramids(pyramids), "spacing") => Length::Across(fitted(pyramids.spacing)),
        (Geometry::Pyramids(pyramids), "base_size") => Length::Across(pyramids.base_size * fitted(pyramids.spacing)),
        (Geometry::Rods(rods), "length") => Length::Up(rods.length * rods.lean_deg.to_radians().cos()),
        (Geometry::Rods(rods), "radius") => Length::Across(2.0 * rods.radius),
        (Geometry::Weave(weave), "warp_height") => Length::Up(weave.warp_height),
        (Geometry::Weave(weave), "weft_height") => Length::Up(weave.weft_height),
        (Geometry::Heightfield(field), "height_scale") => Length::Up(field.height_scale.abs()),
        _ => return None,
    })
}

/// Draws a section. `unit` names the unit of lengths. A length that the user is `changing` is drawn as a dimension line.
pub fn ui(ui: &mut Ui, section: Option<&Section>, unit: &str, changing: Option<Length>) {
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
    if let Some(length) = changing {
        let (origin, end, aside) = match length {
            Length::Up(up) => (pos2(left - 4.0, bottom), pos2(left - 4.0, bottom - scale * up), vec2(3.0, 0.0)),
            Length::Across(across) => {
                (pos2(left, bottom + 4.0), pos2(left + scale * across, bottom + 4.0), vec2(0.0, 3.0))
            }
        };
        let stroke = Stroke::new(2.0, ui.visuals().strong_text_color());
        painter.line_segment([origin, end], stroke);
        for tip in [origin, end] {
            painter.line_segment([tip - aside, tip + aside], stroke);
        }
    }
    let (font, weak) = (FontId::proportional(9.5), ui.visuals().weak_text_color());
    let below = area.bottom() - 2.0;
    let end = format!("{} {unit}", format_number(f64::from(section.width)));
    painter.text(pos2(left.max(area.left() + 4.0), below), Align2::LEFT_BOTTOM, "0", font.clone(), weak);
    painter.text(pos2(right.min(area.right() - 4.0), below), Align2::RIGHT_BOTTOM, end, font, weak);
    response.on_hover_text("Height over x, with the same scale for both. The plane is where the relief is highest");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_of_a_parameter_is_that_in_the_section() {
        let tile = |geometry: &str| {
            let text = format!("[tile]\nsize = [2.0, 1.0]\ngeometry = {geometry}\n");
            crate::scene::parse(&text).unwrap().tile
        };
        let grooves = tile("{ kind = \"grooves\", count = 5, depth = 0.3, bottom_width = 0.5 }");
        assert_eq!(length_of(&grooves, "depth"), Some(Length::Up(0.3)));
        assert_eq!(length_of(&grooves, "bottom_width"), Some(Length::Across(0.2)));
        assert_eq!(length_of(&grooves, "side_angle_deg"), None);
        let pyramids = tile("{ kind = \"pyramids\", spacing = 0.55, height = 0.4, truncation = 0.5 }");
        assert_eq!(length_of(&pyramids, "height"), Some(Length::Up(0.2)));
        assert_eq!(length_of(&pyramids, "spacing"), Some(Length::Across(0.5)));
        let rods = tile("{ kind = \"rods\", radius = 0.05, length = 0.4, lean_deg = 60 }");
        assert_eq!(length_of(&rods, "radius"), Some(Length::Across(0.1)));
        let Some(Length::Up(up)) = length_of(&rods, "length") else { panic!("the length of rods goes up") };
        assert!((up - 0.2).abs() < 1e-6, "{up}");
    }
}
