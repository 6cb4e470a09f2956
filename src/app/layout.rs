//! Layout of the views: gallery, object, tile, and the brush or lobe plot under the smaller view.

use crate::effective::EffectiveBrdf;
use crate::render::CameraView;
use crate::scene::Scene;
use eframe::egui::{self, CentralPanel, Panel, Rect, ScrollArea, Ui};

use super::actions::Action;
use super::editor::Editor;
use super::panels::{self, PanelRequests};
use super::pick;
use super::views::methods::MethodsState;
use super::views::slab_lobe;
use super::views::tile::{self, TileMode};
use super::views::{brushes, difference, section};

/// Windows narrower than this have the tile under the object, and the gallery over it [points].
const NARROW: f32 = 1300.0;
/// Part of the height of both views that the object has in a narrow window.
pub const OBJECT_PART: f32 = 0.58;
/// Minimum and maximum width of the smaller view, and minimum width of the large one [points].
const SIDE: [f32; 2] = [240.0, 900.0];
const MIN_VIEW: f32 = 260.0;
const PARAMETERS: [f32; 2] = [260.0, 620.0];

/// The width of the window in one frame.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    width: f32,
    /// True if the width is that of the last frame.
    is_same: bool,
}

impl Window {
    pub fn is_narrow(&self) -> bool {
        is_narrow(self.width)
    }

    /// A name for the state of a panel. In a window of another width the panel has its stored width again.
    fn salt(&self, name: &'static str) -> (&'static str, u32) {
        (name, self.width as u32)
    }

    /// Stores the width of a panel if the user drags its edge.
    fn store(&self, ui: &Ui, name: &'static str, stored: &mut f32, width: f32) {
        let id = egui::Id::unique(("width of", name));
        let last = ui.data_mut(|data| {
            let last = data.get_temp::<f32>(id);
            data.insert_temp(id, width);
            last
        });
        let is_dragged =
            ui.input(|input| input.pointer.any_down()) && last.is_some_and(|last| (last - width).abs() > 0.1);
        if self.is_same && is_dragged {
            *stored = width;
        }
    }
}

/// Returns true if a window of this width has the tile under the object.
pub fn is_narrow(width: f32) -> bool {
    width < NARROW
}

impl Editor {
    pub(super) fn measure_window(&mut self, ui: &Ui) -> Window {
        let width = ui.ctx().content_rect().width();
        let is_same = (width - self.window_width).abs() < 0.5;
        self.window_width = width;
        Window { width, is_same }
    }

    /// Shows the gallery: beside the object, or in a narrow window over it.
    pub(super) fn gallery_ui(&mut self, ui: &mut Ui, window: Window) -> Option<Action> {
        let chosen = if window.is_narrow() {
            if !self.drawer {
                return None;
            }
            let area = ui.available_rect_before_wrap();
            let drawer = egui::Area::new(egui::Id::unique("gallery drawer")).order(egui::Order::Foreground);
            let shown = drawer.fixed_pos(area.min).show(ui.ctx(), |ui| {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    let margin = 16.0;
                    ui.set_width(150.0);
                    ui.set_height(area.height() - margin);
                    self.gallery.ui(ui, &self.document.name, &self.thumbnails)
                })
            });
            let chosen = shown.inner.inner;
            self.drawer = chosen.is_none();
            chosen
        } else {
            if !self.settings.gallery {
                return None;
            }
            let panel = Panel::left(window.salt("gallery")).default_size(self.settings.gallery_width);
            let shown = panel
                .size_range(118.0..=480.0)
                .show(ui, |ui| self.gallery.ui(ui, &self.document.name, &self.thumbnails));
            window.store(ui, "gallery", &mut self.settings.gallery_width, shown.response.rect.width());
            shown.inner
        };
        chosen.map(|name| Action::OpenShipped(name.to_owned()))
    }

    /// Shows the parameters, and returns the requests of the user.
    pub(super) fn parameters_ui(&mut self, ui: &mut Ui, scene: &mut Scene, window: Window) -> PanelRequests {
        let beside = if window.is_narrow() { 0.55 * window.width } else { SIDE[0] + MIN_VIEW };
        let widest = (ui.available_width() - beside).clamp(PARAMETERS[0], PARAMETERS[1]);
        let panel = Panel::right(window.salt("parameters")).default_size(self.settings.parameters_width.min(widest));
        let shown = panel.size_range(PARAMETERS[0]..=widest).show(ui, |ui| {
            let painted = self.document.painted().clone();
            let scroll = ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
                let (effects, stages) = (self.object.effects(), &self.object.stages[..]);
                let version = self.document.version();
                let file = self.document.path.as_ref().map(|path| path.to_string_lossy().into_owned());
                let file = file.as_deref().unwrap_or(&self.document.name);
                let (accuracy, targets, color_map) = (&mut self.accuracy, &mut self.targets, &mut self.color_map);
                let is_new = std::mem::take(&mut self.is_new);
                let tab = &mut self.tab;
                let reveal = &mut self.reveal;
                let shown = panels::PanelInputs {
                    tab,
                    accuracy,
                    targets,
                    color_map,
                    effects,
                    stages,
                    version,
                    file,
                    reveal,
                    is_new,
                    thumbnails: &self.thumbnails,
                };
                panels::ui(ui, scene, &painted, &self.document.name, &self.slots, shown)
            });
            scroll.inner
        });
        window.store(ui, "parameters", &mut self.settings.parameters_width, shown.response.rect.width());
        shown.inner
    }

    /// Shows both views. Returns the rectangle of the large one.
    pub(super) fn views_ui(&mut self, ui: &mut Ui, scene: &mut Scene, window: Window) -> Rect {
        if window.is_narrow() {
            let height = (1.0 - OBJECT_PART) * ui.available_height();
            let below = Panel::bottom(window.salt("below")).exact_size(height);
            below.show(ui, |ui| self.below_ui(ui, scene));
        } else {
            let widest = (ui.available_width() - MIN_VIEW).clamp(SIDE[0], SIDE[1]);
            let side = Panel::right(window.salt("side")).default_size(self.settings.side_width.min(widest));
            let side = side.size_range(SIDE[0]..=widest).show(ui, |ui| self.side_ui(ui, scene));
            window.store(ui, "side", &mut self.settings.side_width, side.response.rect.width());
        }
        let large = CentralPanel::no_frame().show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 0.0;
            if self.exchanged {
                self.tile_ui(ui, scene, 0.0);
            } else {
                self.object_ui(ui, scene);
            }
        });
        large.response.rect
    }

    /// Shows the smaller view, and the brush or the lobe plot beside it.
    fn below_ui(&mut self, ui: &mut Ui, scene: &mut Scene) {
        let size = ui.available_size();
        let half = egui::vec2(0.5 * size.x - 4.0, size.y);
        ui.horizontal_top(|ui| {
            ui.allocate_ui(half, |ui| {
                ui.vertical(|ui| {
                    if self.exchanged {
                        self.object_ui(ui, scene);
                    } else {
                        self.tile_ui(ui, scene, 0.0);
                    }
                });
            });
            ui.allocate_ui_with_layout(half, egui::Layout::top_down(egui::Align::Min), |ui| {
                ui.set_min_size(half);
                ScrollArea::vertical().id_salt("beside the tile").auto_shrink([false, false]).show(ui, |ui| {
                    self.plots_ui(ui, scene);
                });
            });
        });
    }

    pub(super) fn object_ui(&mut self, ui: &mut Ui, scene: &mut Scene) {
        let fill = ui.visuals().panel_fill;
        egui::Frame::new().fill(fill).inner_margin(egui::Margin::symmetric(6, 3)).show(ui, |ui| {
            ui.take_available_width();
            self.from_view = self.object.toolbar(ui, scene, self.methods.on, &self.thumbnails);
        });
        let version = self.document.version();
        let methods = Some(&mut self.methods).filter(|methods| methods.on && MethodsState::applies_to(scene));
        let area = ui.available_rect_before_wrap();
        self.size = self.object.ui(ui, scene, methods.map(|methods| (methods, version)));
        if self.accuracy.large
            && let Some(shown) = self.accuracy.shown_difference(version)
        {
            self.accuracy.large = difference::ui(ui, area, &shown.texture, &shown.caption);
        }
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
            if self.tile.show != TileMode::Contribution {
                self.tile.before_pick = Some(std::mem::replace(&mut self.tile.show, TileMode::Contribution));
            }
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
            let around = if scene.slab.is_some() { slab_lobe::AROUND } else { 90.0 + section::AROUND };
            let below = if self.tile.painting { 300.0 } else { 0.5 * ui.available_width() + around };
            self.tile_ui(ui, scene, below);
        }
        ui.add_space(6.0);
        ScrollArea::vertical().id_salt("under the tile").show(ui, |ui| self.plots_ui(ui, scene));
    }

    /// Shows the brush, or the plots of reflected or transmitted light.
    fn plots_ui(&mut self, ui: &mut Ui, scene: &Scene) {
        if self.tile.painting {
            if let Some(request) = brushes::ui(ui, &mut self.tile.brush, scene) {
                self.apply_brush_request(request);
            }
        } else if scene.slab.is_some() {
            self.slab_lobe.ui(ui, &mut self.lobe.light, &mut self.lobe.log);
        } else {
            let shown = self.tile.rendered.as_ref().map(|rendered| &*rendered.section);
            let changing = self.tile.changing.and_then(|key| section::length_of(&scene.tile, key));
            section::ui(ui, shown, &scene.tile.unit, changing);
            ui.add_space(4.0);
            self.lobe.ui(ui);
        }
    }
}
