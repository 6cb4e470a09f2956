//! Two pictures in one view: what was kept as A, left of a line that can be moved, and what is there now.

use std::sync::Arc;

use crate::scene::Scene;
use eframe::egui::{self, Color32, ColorImage, CursorIcon, Pos2, Rect, Sense, TextureHandle, TextureOptions, Ui, pos2};

use super::object::{ObjectView, covered};

/// A picture kept for comparison.
pub struct Kept {
    pub(super) image: Arc<ColorImage>,
    /// Of the document.
    pub(super) version: u64,
    pub texture: TextureHandle,
    pub scene: Arc<Scene>,
    pub name: String,
}

impl ObjectView {
    /// Keeps what is shown now beside what comes; false where it cannot be had from the device.
    pub fn keep(&mut self, ctx: &egui::Context, scene: &Arc<Scene>, name: &str) -> bool {
        let Some(made) = &self.made else { return true };
        let Some(image) = made.image.pixels() else { return false };
        let texture = ctx.load_texture("kept", image.clone(), TextureOptions::LINEAR);
        self.kept = Some(Kept { image, version: made.version, texture, scene: scene.clone(), name: name.to_owned() });
        self.wipe = 0.5;
        true
    }

    pub(super) fn is_on_wipe(&self, area: Rect, at: Pos2) -> bool {
        (at.x - (area.left() + self.wipe * area.width())).abs() < 12.0
    }

    /// What was kept, left of a line that can be moved.
    pub(super) fn wipe_ui(&mut self, ui: &mut Ui, area: Rect) {
        let Some(kept) = &self.kept else { return };
        let x = area.left() + self.wipe * area.width();
        let left = Rect::from_min_max(area.min, pos2(x, area.bottom()));
        let shown = covered(area, kept.texture.size_vec2());
        let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().with_clip_rect(left).image(kept.texture.id(), shown, uv, Color32::WHITE);
        ui.painter().vline(x, area.y_range(), egui::Stroke::new(1.5, Color32::from_white_alpha(200)));
        ui.painter().circle_filled(pos2(x, area.center().y), 7.0, Color32::from_white_alpha(220));
        let font = egui::FontId::proportional(12.0);
        let white = Color32::from_white_alpha(210);
        let at = pos2(x - 8.0, area.top() + 8.0);
        ui.painter().text(at, egui::Align2::RIGHT_TOP, format!("A  {}", kept.name), font.clone(), white);
        ui.painter().text(pos2(x + 8.0, area.top() + 8.0), egui::Align2::LEFT_TOP, "B  now", font, white);
        let grip = Rect::from_min_max(pos2(x - 8.0, area.top()), pos2(x + 8.0, area.bottom()));
        let response =
            ui.interact(grip, ui.scope_id().with("wipe"), Sense::drag()).on_hover_cursor(CursorIcon::ResizeHorizontal);
        if response.dragged() {
            self.wipe = (self.wipe + response.drag_delta().x / area.width()).clamp(0.0, 1.0);
        }
    }
}
