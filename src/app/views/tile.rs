//! The small view: the tile itself. Drag turns it, the wheel comes closer; in paint mode the hand paints.

use std::f32::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use crate::render::tile_view::TileView;
use crate::scene::{Camera, Light, LoadedScene, MaterialSpec, Painted, Tile};
use eframe::egui::{
    self, Color32, CursorIcon, PointerButton, Pos2, Rect, Response, Sense, TextureHandle, Ui, pos2, vec2,
};
use glam::{Vec2, Vec3};

use super::hand::{self, Hand};
use crate::app::paint::Brush;
use crate::app::worker::{Show, TileJob, TileMade};

/// What the picture of a tile depends on.
type Inputs = (Tile, Vec<MaterialSpec>, Painted, Option<(Light, Option<Camera>)>);

/// What the view holds between frames.
pub struct TileState {
    azimuth: f32,
    elevation: f32,
    /// Tiles across.
    pub span: f32,
    /// Centre, in parts of the tile.
    center: Vec2,
    pub show: Which,
    pub facets: bool,
    pub painting: bool,
    /// The hand is down, and how hard.
    pressing: Option<f32>,
    pub brush: Brush,
    texture: Option<TextureHandle>,
    pub made: Option<Box<TileMade>>,
    asked: Option<(TileView, Show, bool)>,
    inputs: Option<Inputs>,
    size: [usize; 2],
    /// The picked viewer, and the f̄ that is shown bright.
    pub picked: Option<(Vec3, f32)>,
    /// Before painting turned the view straight down.
    before_paint: Option<(f32, f32, f32, Vec2)>,
}

/// What is shown, as the toolbar offers it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    Clay,
    Materials,
    Normals,
    Visibility,
    /// What was picked on the object.
    Contribution,
}

impl Default for TileState {
    fn default() -> Self {
        Self {
            azimuth: -1.15,
            elevation: 0.82,
            span: 1.7,
            center: Vec2::splat(0.5),
            show: Which::Clay,
            facets: false,
            painting: false,
            pressing: None,
            brush: Brush::default(),
            texture: None,
            made: None,
            asked: None,
            inputs: None,
            size: [0, 0],
            picked: None,
            before_paint: None,
        }
    }
}

impl TileState {
    /// The job for what is to be shown, where it is not what was asked for last. `direction` is the chosen one.
    pub fn job(&mut self, loaded: &Arc<LoadedScene>, direction: Vec3) -> Option<TileJob> {
        if self.size[0] == 0 {
            return None;
        }
        let scene = &loaded.scene;
        let show = match self.show {
            Which::Clay => Show::Clay,
            Which::Materials => Show::Materials,
            Which::Normals => Show::Normals,
            Which::Visibility => Show::Visibility(direction),
            Which::Contribution => match self.picked {
                Some((viewer, scale)) => Show::Contribution(direction, viewer, scale),
                None => Show::Visibility(direction),
            },
        };
        let lit = (self.show == Which::Materials).then(|| (scene.light.clone(), scene.camera.clone()));
        let inputs = (scene.tile.clone(), scene.materials.clone(), loaded.painted.clone(), lit);
        let wanted = (self.view(scene.tile.size), show, self.facets);
        if self.asked.as_ref() == Some(&wanted) && self.inputs.as_ref() == Some(&inputs) {
            return None;
        }
        self.inputs = Some(inputs);
        let (view, show, facets) = wanted.clone();
        self.asked = Some(wanted);
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

    pub fn take(&mut self, ctx: &egui::Context, made: Box<TileMade>) {
        let options = egui::TextureOptions::LINEAR;
        match &mut self.texture {
            Some(texture) => texture.set(made.image.clone(), options),
            None => self.texture = Some(ctx.load_texture("tile", made.image.clone(), options)),
        }
        self.made = Some(made);
    }

    /// Textures belong to a window; in another one they are made anew.
    pub fn move_to(&mut self) {
        (self.texture, self.asked, self.inputs) = (None, None, None);
    }

    /// Turns paint mode on or off; painting looks straight down.
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

    /// Shows the picture; what the hand did, in paint mode.
    pub fn ui(&mut self, ui: &mut Ui, tile: Vec2, size: egui::Vec2) -> Vec<Hand> {
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
        self.turn(ui, &response, tile, paints);
        if paints { self.paint(ui, &response, area, tile) } else { Vec::new() }
    }

    fn turn(&mut self, ui: &Ui, response: &Response, tile: Vec2, paints: bool) {
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
            let per_point = view.pixel() * ui.pixels_per_point();
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

    /// Where on the tile a place of the view is, in parts of the tile, not wrapped.
    pub fn place(&self, area: Rect, at: Pos2, tile: Vec2) -> Option<Vec2> {
        let view = self.view(tile);
        let scale = view.size[0] as f32 / area.width().max(1.0);
        let pixel = Vec2::new(at.x - area.left(), at.y - area.top()) * scale;
        let made = self.made.as_ref()?;
        let hit = made.tile.hit(&view, pixel)?;
        Some(hit.position.truncate() / tile)
    }

    /// The brush's outline, and what the hand did since the last frame.
    fn paint(&mut self, ui: &Ui, response: &Response, area: Rect, tile: Vec2) -> Vec<Hand> {
        if let Some(at) = response.hover_pos().or(response.interact_pointer_pos()) {
            ui.ctx().set_cursor_icon(CursorIcon::Crosshair);
            let shape = tile.min_element() / tile.max_element() * area.width().min(area.height());
            let radius = self.brush.radius / self.span * shape;
            ui.painter().circle_stroke(at, radius, egui::Stroke::new(1.5, Color32::from_white_alpha(220)));
            ui.painter().circle_stroke(at, radius + 1.0, egui::Stroke::new(1.0, Color32::from_black_alpha(160)));
        }
        let strokes = hand::strokes(ui, area, &mut self.pressing);
        let on_tile = |touch: hand::Touch| match touch {
            hand::Touch::At(at, pressure) => self.place(area, at, tile).map(|place| Hand::Press(place, pressure)),
            hand::Touch::Lifted => Some(Hand::Lifted),
        };
        strokes.into_iter().filter_map(on_tile).collect()
    }

    /// Centres and normals of a sample of facets.
    fn facets_ui(&self, ui: &Ui, area: Rect, tile: Vec2) {
        let Some(facets) = self.made.as_ref().filter(|_| self.facets).and_then(|made| made.facets.clone()) else {
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

    /// What is shown and how, above the view.
    pub fn toolbar(&mut self, ui: &mut Ui) -> Option<bool> {
        let mut painting = None;
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            ui.spacing_mut().button_padding.x = 5.0;
            if self.picked.is_some() {
                let tip = "What each place adds to the reflection at the point that was picked on the object";
                if ui.selectable_label(self.show == Which::Contribution, "Picked").on_hover_text(tip).clicked() {
                    self.show = Which::Contribution;
                }
            }
            for (which, name, tip) in [
                (Which::Clay, "Clay", "Matte, under one lamp: the shape is read best"),
                (Which::Materials, "Real", "The materials under the scene's light"),
                (Which::Normals, "Normals", "Where the surface faces, as colours"),
                (Which::Visibility, "Seen", "Green: sees the light of the lobe view. Red: something is in the way"),
            ] {
                if ui.selectable_label(self.show == which, name).on_hover_text(tip).clicked() {
                    self.show = which;
                }
            }
            ui.toggle_value(&mut self.facets, "Facets").on_hover_text("A sample of the facets that are summed over");
            ui.separator();
            let several = self.span > 2.0;
            if ui.selectable_label(several, "3×3").on_hover_text("Several tiles, or one").clicked() {
                self.span = if several { 1.0 } else { 3.0 };
                self.center = Vec2::splat(0.5);
            }
            if ui.selectable_label(self.painting, "Paint").on_hover_text("Paint on the tile (P)").clicked() {
                painting = Some(!self.painting);
            }
        });
        painting
    }
}

/// The width, and as much height as leaves room for what stands below.
pub fn fitting(ui: &Ui, below: f32) -> egui::Vec2 {
    let available = ui.available_size();
    vec2(available.x.max(80.0), (available.y - below).clamp(80.0, 1.25 * available.x.max(80.0)))
}
