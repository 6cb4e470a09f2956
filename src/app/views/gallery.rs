//! The gallery: thumbnails of the shipped scenes.

use std::collections::HashMap;
use std::sync::Arc;

use crate::scene::shipped;
use eframe::egui::{
    self, Color32, ColorImage, Context, Rect, RichText, ScrollArea, Sense, TextureHandle, Ui, pos2, vec2,
};

use crate::app::worker::ThumbnailJob;

#[derive(Default)]
pub struct Gallery {
    /// Thumbnails. `None` means that a scene could not be rendered.
    images: HashMap<&'static str, Option<TextureHandle>>,
    requested: Option<&'static str>,
    /// Search text for names and descriptions.
    pub search: String,
}

impl Gallery {
    pub fn receive(&mut self, ctx: &Context, name: &'static str, image: Option<Arc<ColorImage>>) {
        let options = egui::TextureOptions::LINEAR;
        let texture = image.map(|image| ctx.load_texture(name, image, options));
        self.images.insert(name, texture);
        self.requested = None;
    }

    /// Returns the job for the next missing thumbnail, unless one is being rendered.
    pub fn job(&mut self) -> Option<ThumbnailJob> {
        if self.requested.is_some() {
            return None;
        }
        let name = shipped::names().find(|name| !self.images.contains_key(name))?;
        self.requested = Some(name);
        Some(ThumbnailJob::Shipped(name))
    }

    /// Notes that the current job was cancelled.
    pub fn interrupted(&mut self) {
        self.requested = None;
    }

    pub fn is_waiting(&self) -> bool {
        self.requested.is_some()
    }

    /// Draws the thumbnails and returns the clicked one.
    pub fn ui(&mut self, ui: &mut Ui, current: &str) -> Option<&'static str> {
        let mut chosen = None;
        ui.add_space(4.0);
        ui.label(RichText::new("Gallery").heading());
        let hint = egui::TextEdit::singleline(&mut self.search).hint_text("Search").desired_width(f32::INFINITY);
        let field = ui.add(hint).on_hover_text("Words in a name or a description: velvet, groove, silver, Fig. 8");
        field.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SearchInput, true, "Search the gallery"));
        ui.add_space(2.0);
        let found: Vec<_> = shipped::names().filter(|name| matches_search(name, &self.search)).collect();
        if found.is_empty() {
            ui.weak(format!("No scene matches \"{}\".", self.search.trim()));
            if ui.button("Show all").clicked() {
                self.search.clear();
            }
        }
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            let columns = ((ui.available_width() + 6.0) / 118.0).floor().max(1.0);
            // One point less, because a row that rounding makes too wide would wrap.
            let side = ((ui.available_width() - (columns - 1.0) * 6.0) / columns).floor() - 1.0;
            ui.horizontal_wrapped(|ui| {
                for name in found {
                    if self.item(ui, name, side, name == current) {
                        chosen = Some(name);
                    }
                }
            });
        });
        chosen
    }

    fn item(&self, ui: &mut Ui, name: &'static str, side: f32, current: bool) -> bool {
        let (area, response) = ui.allocate_exact_size(vec2(side, side * 0.82 + 17.0), Sense::click());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, title(name)));
        if !ui.is_rect_visible(area) {
            return response.clicked();
        }
        let frame = Rect::from_min_size(area.min, vec2(side, side * 0.82));
        let painter = ui.painter().with_clip_rect(area.intersect(ui.clip_rect()));
        match self.images.get(name) {
            Some(Some(texture)) => {
                let uv = Rect::from_min_max(pos2(0.0, 0.09), pos2(1.0, 0.91));
                let image = egui::Image::new((texture.id(), frame.size())).uv(uv).corner_radius(4);
                image.paint_at(ui, frame);
            }
            _ => {
                painter.rect_filled(frame, 4.0, ui.visuals().faint_bg_color);
            }
        }
        let color = if current || response.hovered() { super::super::theme::ACCENT } else { Color32::TRANSPARENT };
        painter.rect_stroke(frame, 4.0, egui::Stroke::new(2.0, color), egui::StrokeKind::Inside);
        let text = if current { ui.visuals().strong_text_color() } else { ui.visuals().text_color() };
        let at = pos2(area.left() + 1.0, frame.bottom() + 2.0);
        painter.text(at, egui::Align2::LEFT_TOP, title(name), egui::FontId::proportional(11.0), text);
        response.on_hover_text(format!("{name}\n{}", shipped::description(name).unwrap_or_default())).clicked()
    }
}

/// Returns true if a scene's name and description contain all words of the search text.
fn matches_search(name: &str, search: &str) -> bool {
    let description = shipped::description(name).unwrap_or_default();
    let text = format!("{name} {} {description}", title(name)).to_lowercase();
    search.to_lowercase().split_whitespace().all(|word| text.contains(word))
}

/// Returns the caption of a scene: `Velvet spread` for `fig6a_velvet_spread`, `Slab: window` for `slab_window`. Scenes that
/// show one subject are told apart by their figures.
pub fn title(name: &str) -> String {
    let subject = subject(name);
    let repeats = |other: &str| other != name && self::subject(other) == subject;
    match name.split('_').find(|part| part.starts_with("fig")) {
        Some(figure) if shipped::names().any(repeats) => format!("{subject} ({figure})"),
        _ => subject,
    }
}

fn subject(name: &str) -> String {
    if let Some(rest) = name.strip_prefix("slab_") {
        return slab_subject(rest);
    }
    if let Some(rest) = name.strip_suffix("_color_map") {
        let rest = rest.split_once('_').map_or(rest, |(_, rest)| rest);
        return format!("Colours: {}", rest.replace('_', " "));
    }
    let rest = match name.split_once('_') {
        Some((first, rest)) if first.starts_with("fig") => rest.to_owned(),
        Some((first, rest)) if first.starts_with("table") => format!("{rest} ({first})"),
        _ => name.to_owned(),
    };
    crate::app::panels::fields::display_name(&rest)
}

/// Returns the subject of a scene with a slab from its name without `slab_`.
fn slab_subject(name: &str) -> String {
    let rest = match name.split_once('_') {
        Some((figure, rest)) if figure.starts_with("fig") => rest,
        _ => name,
    };
    match rest {
        "top" | "bottom" | "both" => format!("Slab: {rest} rough"),
        angle if angle.bytes().all(|byte| byte.is_ascii_digit()) => format!("Slab: light at {angle}°"),
        rest => format!("Slab: {}", rest.replace('_', " ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_of_shipped_scenes_are_words_that_differ() {
        assert_eq!(title("fig6a_velvet_spread"), "Velvet spread");
        assert_eq!(title("slab_fig3_top"), "Slab: top rough");
        assert_eq!(title("slab_fig5_30"), "Slab: light at 30°");
        assert_eq!(title("slab_fig7_leaf_glass"), "Slab: leaf glass (fig7)");
        assert_eq!(title("fig1a_noise_color_map"), "Colours: noise");
        let mut titles: Vec<String> = shipped::names().map(title).collect();
        assert!(titles.iter().all(|title| !title.contains('_')), "{titles:?}");
        titles.sort();
        let count = titles.len();
        titles.dedup();
        assert_eq!(titles.len(), count, "{titles:?}");
    }
}
