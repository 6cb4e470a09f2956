//! The shipped scenes as small pictures to start from.

use std::collections::HashMap;

use crate::scene::shipped;
use eframe::egui::{self, Color32, Context, Rect, RichText, ScrollArea, Sense, TextureHandle, Ui, pos2, vec2};

use crate::app::worker::{Thumbnail, ThumbnailJob};

#[derive(Default)]
pub struct Gallery {
    /// `None` for a scene that could not be shown.
    images: HashMap<&'static str, Option<TextureHandle>>,
    asked: Option<&'static str>,
    /// What is looked for among names and descriptions.
    pub sought: String,
}

impl Gallery {
    pub fn take(&mut self, ctx: &Context, made: Thumbnail) {
        let options = egui::TextureOptions::LINEAR;
        let texture = made.image.map(|image| ctx.load_texture(made.name, image, options));
        self.images.insert(made.name, texture);
        self.asked = None;
    }

    /// The next picture that is missing, if none is being made.
    pub fn job(&mut self) -> Option<ThumbnailJob> {
        if self.asked.is_some() {
            return None;
        }
        let name = shipped::names().find(|name| !self.images.contains_key(name))?;
        self.asked = Some(name);
        Some(ThumbnailJob { name })
    }

    /// What was being made was given up.
    pub fn interrupted(&mut self) {
        self.asked = None;
    }

    pub fn is_waiting(&self) -> bool {
        self.asked.is_some()
    }

    /// The pictures; the one that was clicked.
    pub fn ui(&mut self, ui: &mut Ui, current: &str) -> Option<&'static str> {
        let mut chosen = None;
        ui.add_space(4.0);
        ui.label(RichText::new("Gallery").heading());
        let hint = egui::TextEdit::singleline(&mut self.sought).hint_text("Search").desired_width(f32::INFINITY);
        let field = ui.add(hint).on_hover_text("Words of a name or a description: velvet, groove, silver, Fig. 8");
        field.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SearchInput, true, "Search the gallery"));
        ui.add_space(2.0);
        let found: Vec<_> = shipped::names().filter(|name| is_sought(name, &self.sought)).collect();
        if found.is_empty() {
            ui.weak(format!("No scene is about \"{}\".", self.sought.trim()));
            if ui.button("Show all").clicked() {
                self.sought.clear();
            }
        }
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            let columns = ((ui.available_width() + 6.0) / 118.0).floor().max(1.0);
            // A little less: a row that is too wide by rounding would wrap.
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

/// Whether a scene's name and description have all the words.
fn is_sought(name: &str, sought: &str) -> bool {
    let description = shipped::description(name).unwrap_or_default();
    let text = format!("{name} {} {description}", title(name)).to_lowercase();
    sought.to_lowercase().split_whitespace().all(|word| text.contains(word))
}

/// `fig6a_velvet_spread` as a caption: `Velvet spread`.
pub fn title(name: &str) -> String {
    let rest = match name.split_once('_') {
        Some((first, rest)) if first.starts_with("fig") => rest.to_owned(),
        Some((first, rest)) if first.starts_with("table") => format!("{rest} ({first})"),
        _ => name.to_owned(),
    };
    crate::app::panels::fields::words(&rest)
}
