//! Layout of the views: gallery, object, tile, and the brush or lobe plot under the smaller view.

use crate::effective::EffectiveBrdf;
use crate::render::CameraView;
use crate::scene::Scene;
use eframe::egui::{self, Panel, ScrollArea, Ui};

use super::actions::Action;
use super::editor::Editor;
use super::pick;
use super::views::brushes;
use super::views::slab_lobe;
use super::views::tile::{self, TileMode};

impl Editor {
    pub(super) fn gallery_ui(&mut self, ui: &mut Ui) -> Option<Action> {
        if !self.settings.gallery {
            return None;
        }
        let panel = Panel::left("gallery").default_size(self.settings.gallery_width).size_range(118.0..=480.0);
        let shown = panel.show(ui, |ui| self.gallery.ui(ui, &self.document.name));
        self.settings.gallery_width = shown.response.rect.width();
        let chosen = shown.inner;
        chosen.map(|name| Action::OpenShipped(name.to_owned()))
    }

    pub(super) fn object_ui(&mut self, ui: &mut Ui, scene: &mut Scene) {
        let fill = ui.visuals().panel_fill;
        egui::Frame::new().fill(fill).inner_margin(egui::Margin::symmetric(6, 3)).show(ui, |ui| {
            ui.take_available_width();
            self.from_view = self.object.toolbar(ui, scene);
        });
        self.size = self.object.ui(ui, scene);
        self.pick();
    }

    /// Passes the point under the pointer to the lobe plot and the tile view.
    fn pick(&mut self) {
        let (Some(at), Some(preview)) = (self.object.pick_position, &self.object.preview) else { return };
        let Some(scene) = &preview.lit_object else { return };
        let size = preview.image.size();
        let Ok(view) = CameraView::new(&preview.camera, scene.mesh(), size) else { return };
        let pixel = glam::Vec2::new(at.x * size[0] as f32, at.y * size[1] as f32);
        if let Some(picked) = pick::pick(scene.mesh(), &scene.lights().directional, &view, pixel) {
            self.lobe.viewer = Some(picked.viewer);
            self.lobe.light = picked.light.unwrap_or(self.lobe.light);
            let value = |brdf: &EffectiveBrdf| brdf.eval(self.lobe.light, picked.viewer).max_element();
            let value = preview.brdf.as_deref().map_or(0.0, value);
            self.tile.picked = Some((picked.viewer, 4.0 * value));
            self.tile.show = TileMode::Contribution;
        }
    }

    /// Shows the tile with its toolbar; `below` stays free.
    pub(super) fn tile_ui(&mut self, ui: &mut Ui, scene: &Scene, below: f32) {
        ui.add_space(3.0);
        if let Some(on) = self.tile.toolbar(ui) {
            self.tile.set_painting(on);
        }
        let size = if below > 0.0 { tile::size_above(ui, below) } else { ui.available_size() };
        self.pointer = self.tile.ui(ui, scene.tile.size, size);
    }

    /// Shows the smaller view, and under it the brush or the lobe plot.
    pub(super) fn side_ui(&mut self, ui: &mut Ui, scene: &mut Scene) {
        if self.exchanged {
            let size = tile::size_above(ui, 330.0);
            ui.allocate_ui(size, |ui| self.object_ui(ui, scene));
        } else {
            let around = if scene.slab.is_some() { slab_lobe::AROUND } else { 90.0 };
            let below = if self.tile.painting { 300.0 } else { 0.5 * ui.available_width() + around };
            self.tile_ui(ui, scene, below);
        }
        ui.add_space(6.0);
        if self.tile.painting {
            ScrollArea::vertical().show(ui, |ui| {
                if let Some(request) = brushes::ui(ui, &mut self.tile.brush, scene) {
                    self.apply_brush_request(request);
                }
            });
        } else if scene.slab.is_some() {
            self.slab_lobe.ui(ui, &mut self.lobe.light, &mut self.lobe.log);
        } else {
            self.lobe.ui(ui);
        }
    }
}
