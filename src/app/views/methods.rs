//! Methods beside each other in the object view: movable lines divide it into one part per method.

use std::sync::Arc;

use crate::scene::{LoadedScene, Scene};
use eframe::egui::{
    self, Align2, Color32, CursorIcon, FontId, Pos2, Rect, Sense, TextureHandle, TextureOptions, Ui, pos2, vec2,
};

use super::object::covered;
use crate::app::worker::{MethodImage, MethodsJob, MethodsResult};

/// Half of the width in which a line is dragged, and the least distance of two lines [points].
const GRIP: f32 = 8.0;
const LEAST: f32 = 40.0;

/// State of the comparison between frames.
pub struct MethodsState {
    /// True while the user compares methods.
    pub on: bool,
    /// Positions of the lines, from 0 (left) to 1 (right).
    pub lines: [f32; 2],
    requested: Option<(u64, [usize; 2])>,
    /// Version of the images.
    version: u64,
    images: Vec<(MethodImage, TextureHandle)>,
    error: Option<(u64, String)>,
}

impl Default for MethodsState {
    fn default() -> Self {
        let (lines, images) = ([1.0 / 3.0, 2.0 / 3.0], Vec::new());
        Self { on: false, lines, requested: None, version: 0, images, error: None }
    }
}

impl MethodsState {
    /// Returns true if a scene has methods to compare.
    pub fn applies_to(scene: &Scene) -> bool {
        scene.slab.is_some() || scene.color_map.is_some()
    }

    /// Returns the job for a version whose own image is final, unless it is the last request.
    pub fn job(
        &mut self,
        version: u64,
        loaded: &Arc<LoadedScene>,
        size: [usize; 2],
        is_final: bool,
    ) -> Option<MethodsJob> {
        let applies = self.on && is_final && Self::applies_to(&loaded.scene);
        if !applies || self.requested == Some((version, size)) {
            return None;
        }
        self.requested = Some((version, size));
        Some(MethodsJob { version, loaded: loaded.clone(), size })
    }

    /// Returns true if the running job is no longer needed, and forgets it.
    pub fn is_late(&mut self, version: u64) -> bool {
        let late = self.requested.is_some_and(|(requested, _)| requested != version || !self.on);
        if late {
            self.requested = None;
        }
        late
    }

    pub fn receive(&mut self, ctx: &egui::Context, result: MethodsResult) {
        match result {
            MethodsResult::Images(version, images) => {
                let mut textures = std::mem::take(&mut self.images).into_iter().map(|(_, texture)| texture);
                let with_texture = |image: MethodImage| {
                    let texture = match textures.next() {
                        Some(mut texture) => {
                            texture.set(image.image.clone(), TextureOptions::LINEAR);
                            texture
                        }
                        None => ctx.load_texture(image.name, image.image.clone(), TextureOptions::LINEAR),
                    };
                    (image, texture)
                };
                self.images = images.into_iter().map(with_texture).collect();
                (self.version, self.error) = (version, None);
            }
            MethodsResult::Failed(version, text) => self.error = Some((version, text)),
        }
    }

    /// Forgets the images, because textures belong to a window.
    pub fn move_to(&mut self) {
        (self.requested, self.images) = (None, Vec::new());
    }

    /// The images of a version.
    #[cfg(test)]
    pub fn images(&self, version: u64) -> impl Iterator<Item = &MethodImage> {
        self.images.iter().filter(move |_| self.version == version).map(|(image, _)| image)
    }

    /// Returns true if a point lies on a line.
    pub fn is_on_line(&self, area: Rect, at: Pos2) -> bool {
        self.lines.iter().any(|line| (at.x - area.left() - line * area.width()).abs() < 1.5 * GRIP)
    }

    /// Draws the images of a version over the object view, or the reason why there are none.
    pub fn ui(&mut self, ui: &mut Ui, area: Rect, version: u64) {
        let note = match &self.error {
            Some((failed, text)) if *failed == version => text.clone(),
            _ if self.version != version || self.images.is_empty() => {
                "The methods are rendered once the image is final".to_owned()
            }
            _ => {
                self.images_ui(ui, area);
                return;
            }
        };
        ui.painter().text(area.left_top() + vec2(10.0, 40.0), Align2::LEFT_TOP, note, font(), Color32::WHITE);
    }

    fn images_ui(&mut self, ui: &mut Ui, area: Rect) {
        let x = |part: f32| area.left() + part * area.width();
        let edges = [area.left(), x(self.lines[0]), x(self.lines[1]), area.right()];
        let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        for (at, (image, texture)) in self.images.iter().enumerate().take(3) {
            let part = Rect::from_x_y_ranges(edges[at]..=edges[at + 1], area.y_range());
            let painter = ui.painter().with_clip_rect(part.intersect(ui.clip_rect()));
            painter.image(texture.id(), covered(area, texture.size_vec2()), uv, Color32::WHITE);
            let text = painter.layout(describe(image), font(), Color32::WHITE, (part.width() - 20.0).max(40.0));
            let ground = Rect::from_min_size(part.left_top() + vec2(6.0, 6.0), text.size() + vec2(8.0, 6.0));
            painter.rect_filled(ground, 4.0, Color32::from_black_alpha(170));
            painter.galley(ground.min + vec2(4.0, 3.0), text, Color32::WHITE);
        }
        for at in 0..2 {
            let line = edges[at + 1];
            ui.painter().vline(line, area.y_range(), egui::Stroke::new(1.5, Color32::from_white_alpha(200)));
            ui.painter().circle_filled(pos2(line, area.center().y), 7.0, Color32::from_white_alpha(220));
            let grip = Rect::from_x_y_ranges(line - GRIP..=line + GRIP, area.y_range());
            let id = ui.scope_id().with(("method line", at));
            let response = ui.interact(grip, id, Sense::drag()).on_hover_cursor(CursorIcon::ResizeHorizontal);
            let name = ["First line between methods", "Second line between methods"][at];
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Splitter, true, name));
            if response.dragged() {
                let least = (LEAST / area.width()).min(0.3);
                let range = if at == 0 { (0.0, self.lines[1] - least) } else { (self.lines[0] + least, 1.0) };
                let moved = self.lines[at] + response.drag_delta().x / area.width();
                self.lines[at] = moved.clamp(range.0, range.1);
            }
        }
    }
}

fn font() -> FontId {
    FontId::proportional(12.0)
}

/// Name, noise and error of an image.
pub fn describe(image: &MethodImage) -> String {
    let mut text = image.name.to_owned();
    if let Some(difference) = image.difference {
        text += &format!(": {:.1} % from the reference", 100.0 * difference);
    }
    match image.noise {
        Some(noise) => text += &format!("\nstandard error {:.1} %, {} passes", 100.0 * noise, image.passes),
        None if image.passes == 1 && image.difference.is_none() => text += "\nfirst pass",
        None => {}
    }
    text
}
