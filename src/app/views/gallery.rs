//! The gallery: thumbnails of the shipped scenes.

use std::collections::HashMap;
use std::sync::LazyLock;

use crate::scene::shipped;
use eframe::egui::{self, RichText, ScrollArea, Sense, Ui};

use super::thumbnails::Thumbnails;
use crate::app::worker::Subject;

#[derive(Default)]
pub struct Gallery {
    /// Search text for names and descriptions.
    pub search: String,
}

/// A scene of the gallery that is dragged, and whose material a slot takes.
#[derive(Debug, Clone, Copy)]
pub struct DraggedScene(pub &'static str);

impl Gallery {
    /// Draws the thumbnails and returns the clicked one.
    pub fn ui(&mut self, ui: &mut Ui, current: &str, thumbnails: &Thumbnails) -> Option<&'static str> {
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
                    if item(ui, (name, side, name == current), thumbnails) {
                        chosen = Some(name);
                    }
                }
            });
        });
        chosen
    }
}

/// Draws a scene of the gallery, and returns true if it is clicked.
fn item(ui: &mut Ui, (name, side, is_current): (&'static str, f32, bool), thumbnails: &Thumbnails) -> bool {
    let subject = Subject::Scene(name);
    let response = thumbnails.button(ui, (subject, title(name)), side, is_current, Sense::click_and_drag());
    response.dnd_set_drag_payload(DraggedScene(name));
    if response.dragged() {
        thumbnails.drag_image(ui.ctx(), subject);
    }
    let tip = |ui: &mut Ui| {
        let description = shipped::description(name).unwrap_or_default();
        ui.label(format!("{name}\n{description}\nDrag it onto a material to use the scene's material there."));
    };
    response.on_hover_ui(tip).clicked()
}

/// Returns true if a scene's name and description contain all words of the search text.
fn matches_search(name: &str, search: &str) -> bool {
    let description = shipped::description(name).unwrap_or_default();
    let text = format!("{name} {} {description}", title(name)).to_lowercase();
    search.to_lowercase().split_whitespace().all(|word| text.contains(word))
}

/// Returns the caption of a shipped scene, or an empty one for another name. All captions are made once, because the gallery
/// draws them in every frame.
fn title(name: &str) -> &'static str {
    static TITLES: LazyLock<HashMap<&str, String>> =
        LazyLock::new(|| shipped::names().map(|name| (name, new_title(name))).collect());
    TITLES.get(name).map_or("", |title| title)
}

/// Makes the caption of a scene: `Velvet spread` for `fig6a_velvet_spread`, `Slab: window` for `slab_window`. Scenes that
/// show one subject are told apart by their figures.
fn new_title(name: &str) -> String {
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
        let mut titles: Vec<&str> = shipped::names().map(title).collect();
        assert!(titles.iter().all(|title| !title.contains('_')), "{titles:?}");
        titles.sort();
        let count = titles.len();
        titles.dedup();
        assert_eq!(titles.len(), count, "{titles:?}");
    }
}
