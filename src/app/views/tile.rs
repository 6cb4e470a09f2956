//! The tile view. Dragging turns the tile, scrolling zooms, and in paint mode the pointer paints.

use std::f32::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use crate::render::tile_view::TileView;
use crate::scene::{Camera, Light, LoadedScene, MaterialSpec, Painted, Tile};
use eframe::egui::{
    self, Color32, CursorIcon, PointerButton, Pos2, Rect, Response, Sense, TextureHandle, Ui, pos2, vec2,
};
use glam::{Vec2, Vec3};

use super::pointer::{self, Pointer};
use crate::app::paint::Brush;
use crate::app::worker::{RenderedTile, TILE_AZIMUTH_DEG, TILE_ELEVATION_DEG, TileDisplay, TileJob};

/// Inputs of a tile image.
type Inputs = (Tile, Vec<MaterialSpec>, Painted, Option<(Light, Option<Camera>)>);

/// State of the view between frames.
pub struct TileState {
    azimuth: f32,
    elevation: f32,
    /// Tiles across.
    pub span: f32,
    /// Centre, in fractions of the tile.
    center: Vec2,
    pub show: TileMode,
    pub facets: bool,
    pub painting: bool,
    /// Pressure of the pointer; `None` while it is released.
    pressure: Option<f32>,
    pub brush: Brush,
    texture: Option<TextureHandle>,
    pub rendered: Option<Box<RenderedTile>>,
    requested: Option<(TileView, TileDisplay, bool)>,
    inputs: Option<Inputs>,
    size: [usize; 2],
    /// The picked view direction, and the value of f̄ that is displayed as white.
    pub picked: Option<(Vec3, f32)>,
    /// Key of the parameter of the surface that the user is changing.
    pub changing: Option<&'static str>,
    /// The display mode to restore after picking.
    pub before_pick: Option<TileMode>,
    /// The view to restore after painting, which looks straight down.
    before_paint: Option<(f32, f32, f32, Vec2)>,
}

/// Display modes of the toolbar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TileMode {
    Clay,
    Materials,
    Normals,
    Visibility,
    /// Contribution of each facet at the picked point of the object.
    Contribution,
}

impl Default for TileState {
    fn default() -> Self {
        Self {
            azimuth: TILE_AZIMUTH_DEG.to_radians(),
            elevation: TILE_ELEVATION_DEG.to_radians(),
            span: 1.7,
            center: Vec2::splat(0.5),
            show: TileMode::Clay,
            facets: false,
            painting: false,
            pressure: None,
            brush: Brush::default(),
            texture: None,
            rendered: None,
            requested: None,
            inputs: None,
            size: [0, 0],
            picked: None,
            changing: None,
            before_pick: None,
            before_paint: None,
        }
    }
}

impl TileState {
    /// Returns the job for the image to display, unless it is the last request. `direction` points to the light.
    pub fn job(&mut self, loaded: &Arc<LoadedScene>, direction: Vec3) -> Option<TileJob> {
        if self.size[0] == 0 {
            return None;
        }
        let scene = &loaded.scene;
        let show = match self.show {
            TileMode::Clay => TileDisplay::Clay,
            TileMode::Materials => TileDisplay::Materials,
            TileMode::Normals => TileDisplay::Normals,
            TileMode::Visibility => TileDisplay::Visibility(direction),
            TileMode::Contribution => match self.picked {
                Some((viewer, scale)) => TileDisplay::Contribution(direction, viewer, scale),
                None => TileDisplay::Visibility(direction),
            },
        };
        let lit = (self.show == TileMode::Materials).then(|| (scene.light.clone(), scene.camera.clone()));
        let inputs = (scene.tile.clone(), scene.materials.clone(), loaded.painted.clone(), lit);
        let wanted = (self.view(scene.tile.size), show, self.facets);
        if self.requested.as_ref() == Some(&wanted) && self.inputs.as_ref() == Some(&inputs) {
            return None;
        }
        self.inputs = Some(inputs);
        let (view, show, facets) = wanted.clone();
        self.requested = Some(wanted);
        Some(TileJob { loaded: loaded.clone(), view, show, facets })
    }

    fn view(&self, tile: Vec2) -> TileView {
        TileView {
            azimuth: self.azimuth,
            elevation: self.elevation,
            center: self.center * tile,
            span: self.span * tile.max_element(),
            size: self.size,
        }
    }

    pub fn receive(&mut self, ctx: &egui::Context, rendered: Box<RenderedTile>) {
        let options = egui::TextureOptions::LINEAR;
        match &mut self.texture {
            Some(texture) => texture.set(rendered.image.clone(), options),
            None => self.texture = Some(ctx.load_texture("tile", rendered.image.clone(), options)),
        }
        self.rendered = Some(rendered);
    }

    /// Drops what belongs to the old window, so that the new window loads it again.
    pub fn move_to(&mut self) {
        (self.texture, self.requested, self.inputs) = (None, None, None);
    }

    /// Drops the image, as of another tile.
    pub fn forget(&mut self) {
        (self.texture, self.rendered) = (None, None);
    }

    /// Turns paint mode on or off. Paint mode looks straight down.
    pub fn set_painting(&mut self, on: bool) {
        if on == self.painting {
            return;
        }
        self.painting = on;
        if on {
            self.before_paint = Some((self.azimuth, self.elevation, self.span, self.center));
            (self.azimuth, self.elevation, self.span, self.center) = (-FRAC_PI_2, FRAC_PI_2, 1.0, Vec2::splat(0.5));
        } else if let Some(before) = self.before_paint.take() {
            (self.azimuth, self.elevation, self.span, self.center) = before;
        }
    }

    /// Draws the image. Returns the pointer input in paint mode.
    pub fn ui(&mut self, ui: &mut Ui, tile: Vec2, size: egui::Vec2) -> Vec<Pointer> {
        let (area, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Tile view"));
        let pixels = area.size() * ui.pixels_per_point();
        self.size = [pixels.x.round() as usize, pixels.y.round() as usize].map(|side| side.clamp(16, 1600));
        ui.painter().rect_filled(area, 0.0, Color32::from_gray(22));
        if let Some(texture) = &self.texture {
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().image(texture.id(), area, uv, Color32::WHITE);
        }
        self.facets_ui(ui, area, tile);
        let paints = self.painting && !ui.input(|input| input.modifiers.alt);
        self.navigate(ui, &response, tile, paints);
        if paints { self.paint(ui, &response, area, tile) } else { Vec::new() }
    }

    fn navigate(&mut self, ui: &Ui, response: &Response, tile: Vec2, paints: bool) {
        let delta = response.drag_delta();
        let turning = response.dragged_by(PointerButton::Primary) && !paints
            || response.dragged_by(PointerButton::Secondary) && paints;
        if turning {
            self.azimuth = (self.azimuth - delta.x * 0.008 + PI).rem_euclid(2.0 * PI) - PI;
            self.elevation = (self.elevation + delta.y * 0.008).clamp(0.12, FRAC_PI_2);
        } else if response.dragged_by(PointerButton::Middle) || response.dragged_by(PointerButton::Secondary) && !paints
        {
            let view = self.view(tile);
            let [_, right, up] = view.axes();
            let per_point = view.pixel_size() * ui.pixels_per_point();
            let moved = right.truncate() * -delta.x + up.truncate() * (delta.y / self.elevation.sin().max(0.1).powi(2));
            self.center += moved * per_point / tile;
            self.center -= self.center.floor();
        }
        if response.hovered() {
            let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            self.span = (self.span * (-scroll * 0.002).exp() / pinch).clamp(0.1, 12.0);
        }
        if response.double_clicked() && !paints {
            let fresh = Self::default();
            (self.azimuth, self.elevation, self.span, self.center) =
                (fresh.azimuth, fresh.elevation, fresh.span, fresh.center);
        }
    }

    /// Returns the point of the tile at a screen position, in fractions of the tile and not wrapped.
    pub fn tile_point(&self, area: Rect, at: Pos2, tile: Vec2) -> Option<Vec2> {
        let view = self.view(tile);
        let scale = view.size[0] as f32 / area.width().max(1.0);
        let pixel = Vec2::new(at.x - area.left(), at.y - area.top()) * scale;
        let rendered = self.rendered.as_ref()?;
        let hit = rendered.tile.hit(&view, pixel)?;
        Some(hit.position.truncate() / tile)
    }

    /// Draws the outline of the brush. Returns the pointer input since the last frame.
    fn paint(&mut self, ui: &Ui, response: &Response, area: Rect, tile: Vec2) -> Vec<Pointer> {
        if let Some(at) = response.hover_pos().or(response.interact_pointer_pos()) {
            ui.ctx().set_cursor_icon(CursorIcon::Crosshair);
            let shape = tile.min_element() / tile.max_element() * area.width().min(area.height());
            let radius = self.brush.radius / self.span * shape;
            ui.painter().circle_stroke(at, radius, egui::Stroke::new(1.5, Color32::from_white_alpha(220)));
            ui.painter().circle_stroke(at, radius + 1.0, egui::Stroke::new(1.0, Color32::from_black_alpha(160)));
        }
        let strokes = pointer::strokes(ui, area, &mut self.pressure);
        let on_tile = |input: pointer::ScreenPointer| match input {
            pointer::ScreenPointer::At(at, pressure) => {
                self.tile_point(area, at, tile).map(|point| Pointer::Press(point, pressure))
            }
            pointer::ScreenPointer::Released => Some(Pointer::Released),
        };
        strokes.into_iter().filter_map(on_tile).collect()
    }

    /// Draws the centres and normals of a sample of facets.
    fn facets_ui(&self, ui: &Ui, area: Rect, tile: Vec2) {
        let Some(facets) = self.rendered.as_ref().filter(|_| self.facets).and_then(|rendered| rendered.facets.clone())
        else {
            return;
        };
        let view = self.view(tile);
        let [to_viewer, ..] = view.axes();
        let scale = area.width() / view.size[0].max(1) as f32;
        let painter = ui.painter().with_clip_rect(area);
        let length = 0.03 * tile.max_element();
        for (position, normal) in facets.positions.iter().zip(&facets.normals) {
            if normal.dot(to_viewer) <= 0.0 {
                continue;
            }
            let on_screen = |point: Vec3| {
                let at = view.pixel_of(point) * scale;
                pos2(area.left() + at.x, area.top() + at.y)
            };
            let (from, to) = (on_screen(*position), on_screen(*position + *normal * length));
            painter.line_segment([from, to], egui::Stroke::new(1.0, Color32::from_rgb(90, 190, 255)));
            painter.circle_filled(from, 1.2, Color32::from_rgb(255, 200, 80));
        }
    }

    /// Draws the toolbar above the view. Returns whether the user turned painting on or off.
    pub fn toolbar(&mut self, ui: &mut Ui) -> Option<bool> {
        let mut painting = None;
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            ui.spacing_mut().button_padding.x = 5.0;
            ui.strong("Tile");
            ui.add_space(4.0);
            for (mode, name, tip) in [
                (TileMode::Clay, "Clay", "Diffuse grey under one light, which shows the shape best"),
                (TileMode::Materials, "Real", "The materials under the scene's light"),
                (TileMode::Normals, "Normals", "Normals as colours"),
                (
                    TileMode::Visibility,
                    "Visible",
                    "Green: visible from the light of the view Reflection. Red: occluded",
                ),
            ] {
                if ui.selectable_label(self.show == mode, name).on_hover_text(tip).clicked() {
                    self.show = mode;
                }
            }
            ui.toggle_value(&mut self.facets, "Facets").on_hover_text("A sample of the facets that the sum evaluates");
            ui.separator();
            let several = self.span > 2.0;
            if ui.selectable_label(several, "3×3").on_hover_text("Several tiles, or one").clicked() {
                self.span = if several { 1.0 } else { 3.0 };
                self.center = Vec2::splat(0.5);
            }
            if ui.selectable_label(self.painting, "Paint").on_hover_text("Paint on the tile (P)").clicked() {
                painting = Some(!self.painting);
            }
            // The last one, because it appears only when a point is picked.
            if self.picked.is_some() {
                let tip = "Contribution of each place to the reflection at the picked point of the object";
                if ui.selectable_label(self.show == TileMode::Contribution, "Picked").on_hover_text(tip).clicked() {
                    self.show = TileMode::Contribution;
                }
            }
        });
        painting
    }
}

/// Returns the size of a view that leaves `below` points of height free.
pub fn size_above(ui: &Ui, below: f32) -> egui::Vec2 {
    let available = ui.available_size();
    vec2(available.x.max(80.0), (available.y - below).clamp(80.0, 1.25 * available.x.max(80.0)))
}
