//! Comparison of two images in one view: the stored image A left of a movable line, the current one right of it.

use std::sync::Arc;

use crate::scene::Scene;
use eframe::egui::{self, Color32, ColorImage, CursorIcon, Pos2, Rect, Sense, TextureHandle, TextureOptions, Ui, pos2};

use super::object::{ObjectView, covered};

/// An image that is stored for comparison.
pub struct ComparisonImage {
    pub(super) image: Arc<ColorImage>,
    /// Version of the document.
    pub(super) version: u64,
    pub texture: TextureHandle,
    pub scene: Arc<Scene>,
    pub name: String,
}

impl ObjectView {
    /// Stores the current image for comparison. Returns false if it cannot be read back from the GPU.
    pub fn store_comparison(&mut self, ctx: &egui::Context, scene: &Arc<Scene>, name: &str) -> bool {
        let Some(preview) = &self.preview else { return true };
        let Some(image) = preview.image.pixels() else { return false };
        let texture = ctx.load_texture("comparison", image.clone(), TextureOptions::LINEAR);
        self.comparison = Some(ComparisonImage {
            image,
            version: preview.version,
            texture,
            scene: scene.clone(),
            name: name.to_owned(),
        });
        self.wipe = 0.5;
        true
    }

    pub(super) fn is_on_wipe(&self, area: Rect, at: Pos2) -> bool {
        (at.x - (area.left() + self.wipe * area.width())).abs() < 12.0
    }

    /// Draws image A to the left of the movable line.
    pub(super) fn wipe_ui(&mut self, ui: &mut Ui, area: Rect) {
        let Some(comparison) = &self.comparison else { return };
        let x = area.left() + self.wipe * area.width();
        let left = Rect::from_min_max(area.min, pos2(x, area.bottom()));
        let shown = covered(area, comparison.texture.size_vec2());
        let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().with_clip_rect(left).image(comparison.texture.id(), shown, uv, Color32::WHITE);
        ui.painter().vline(x, area.y_range(), egui::Stroke::new(1.5, Color32::from_white_alpha(200)));
        ui.painter().circle_filled(pos2(x, area.center().y), 7.0, Color32::from_white_alpha(220));
        let font = egui::FontId::proportional(12.0);
        let white = Color32::from_white_alpha(210);
        let at = pos2(x - 8.0, area.top() + 8.0);
        ui.painter().text(at, egui::Align2::RIGHT_TOP, format!("A  {}", comparison.name), font.clone(), white);
        ui.painter().text(pos2(x + 8.0, area.top() + 8.0), egui::Align2::LEFT_TOP, "B  current", font, white);
        let grip = Rect::from_min_max(pos2(x - 8.0, area.top()), pos2(x + 8.0, area.bottom()));
        let response =
            ui.interact(grip, ui.scope_id().with("wipe"), Sense::drag()).on_hover_cursor(CursorIcon::ResizeHorizontal);
        if response.dragged() {
            self.wipe = (self.wipe + response.drag_delta().x / area.width()).clamp(0.0, 1.0);
        }
    }
}
