//! Variants of the open scene, of which one click takes one.

use std::fmt;
use std::sync::Arc;

use eframe::egui::{self, ColorImage, Context, Grid, Id, Image, Sense, TextureHandle, Ui, vec2};

use super::within;
use crate::app::worker::ThumbnailJob;
use crate::scene::{LoadedScene, Scene, variant};

/// Variants per side of the square that shows them.
const PER_SIDE: usize = 3;
/// Largest side of an image [points].
const MAX_SIDE: f32 = 150.0;

/// Nine random variants of a scene with their images.
pub struct Variants {
    base: Scene,
    seed: u64,
    scenes: Vec<Option<Scene>>,
    /// Images that arrived; the inner value is absent if a scene could not be rendered.
    images: Vec<Option<Option<TextureHandle>>>,
    requested: Option<usize>,
}

impl Variants {
    pub fn new(base: &Scene) -> Self {
        Self::drawn(base.clone(), 0)
    }

    fn drawn(base: Scene, seed: u64) -> Self {
        let count = (PER_SIDE * PER_SIDE) as u64;
        let scenes: Vec<Option<Scene>> = (0..count).map(|at| variant(&base, seed * count + at)).collect();
        Self { base, seed, images: scenes.iter().map(|_| None).collect(), scenes, requested: None }
    }

    /// The job of the next missing image, unless one is being rendered. `loaded` is the open scene with its files.
    pub fn job(&mut self, loaded: impl FnOnce() -> LoadedScene) -> Option<ThumbnailJob> {
        if self.requested.is_some() {
            return None;
        }
        let at = (0..self.scenes.len()).find(|at| self.images[*at].is_none() && self.scenes[*at].is_some())?;
        self.requested = Some(at);
        let scene = self.scenes[at].clone()?;
        Some(ThumbnailJob::Variant { seed: self.seed, at, loaded: Box::new(LoadedScene { scene, ..loaded() }) })
    }

    /// Takes the image of a variant of the seed with which these were drawn.
    pub fn receive(&mut self, ctx: &Context, (seed, at): (u64, usize), image: Option<Arc<ColorImage>>) {
        if seed == self.seed {
            let options = egui::TextureOptions::LINEAR;
            self.images[at] = Some(image.map(|image| ctx.load_texture(format!("variant {at}"), image, options)));
            self.requested = None;
        }
    }

    /// Returns true if no image is missing.
    #[cfg(test)]
    pub fn is_complete(&self) -> bool {
        self.images.iter().all(Option::is_some)
    }

    /// Draws the dialog. Returns the scene that the user takes, `None` inside if the dialog is closed without one.
    pub fn ui(&mut self, ctx: &Context) -> Option<Option<Scene>> {
        let mut result = None;
        let modal = egui::Modal::new(Id::unique("vary")).show(ctx, |ui| {
            let row = PER_SIDE as f32 * MAX_SIDE;
            let side = within(ctx, row, 60.0, 0).min(within(ctx, row, 170.0, 1)) / PER_SIDE as f32;
            ui.set_width(PER_SIDE as f32 * (side + 6.0));
            ui.heading("Vary the material");
            ui.label(
                "Each number of the surface, the materials, the slab and the colour map is changed by up to 20 %.",
            );
            ui.add_space(6.0);
            Grid::new("variants").spacing([6.0, 6.0]).show(ui, |ui| {
                for at in 0..self.scenes.len() {
                    if self.item(ui, at, side) {
                        result = Some(self.scenes[at].clone());
                    }
                    if at % PER_SIDE == PER_SIDE - 1 {
                        ui.end_row();
                    }
                }
            });
            ui.add_space(6.0);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if ui.button("Cancel").clicked() {
                    result = Some(None);
                }
                if ui.button("Nine others").clicked() {
                    *self = Self::drawn(self.base.clone(), self.seed + 1);
                }
            });
        });
        if modal.should_close() && result.is_none() {
            result = Some(None);
        }
        result
    }

    /// Draws a variant and returns true if it is clicked.
    fn item(&self, ui: &mut Ui, at: usize, side: f32) -> bool {
        let (rect, response) = ui.allocate_exact_size(vec2(side, side), Sense::click());
        let name = format!("Variant {}", at + 1);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, self.scenes[at].is_some(), &name));
        match &self.images[at] {
            Some(Some(texture)) => Image::new((texture.id(), rect.size())).corner_radius(4).paint_at(ui, rect),
            missing => {
                ui.painter().rect_filled(rect, 4.0, ui.visuals().faint_bg_color);
                if missing.is_none() && self.scenes[at].is_some() {
                    egui::Spinner::new().paint_at(ui, egui::Rect::from_center_size(rect.center(), vec2(24.0, 24.0)));
                }
            }
        }
        if response.hovered() || response.has_focus() {
            let stroke = egui::Stroke::new(2.0, crate::app::theme::ACCENT);
            ui.painter().rect_stroke(rect, 4.0, stroke, egui::StrokeKind::Inside);
        }
        self.scenes[at].is_some() && response.clicked()
    }
}

impl fmt::Debug for Variants {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Variants").field("seed", &self.seed).finish_non_exhaustive()
    }
}
