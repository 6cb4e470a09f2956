//! The large view: the object, shaded by the effective BRDF. Drag turns it, the wheel comes closer.

use std::sync::Arc;
use std::time::Instant;

use crate::scene::{Camera, OBJECT_KINDS, Scene};
use eframe::egui::{
    self, Color32, CursorIcon, PointerButton, Rect, Response, Sense, TextureHandle, TextureId, TextureOptions, Ui,
    pos2, vec2,
};

use super::wheel::wheel;
use super::wipe::Kept;
use crate::app::actions::Action;
use crate::app::panels::fields::words;
use crate::app::worker::{DeviceImage, DisplayImage, Grade, Made};

/// The camera comes no nearer than this many radii; the lens does the rest.
const NEAREST: f32 = 2.2;
/// What takes longer than this says so [s].
const SLOW: f32 = 0.33;
/// A lens narrower than this widens before the camera moves away.
const NARROW: f32 = 14.0;
/// What the view leaves to the edges of panels, points.
const EDGE: f32 = 6.0;

/// What the view draws.
enum Texture {
    Uploaded(TextureHandle),
    OnDevice(Arc<DeviceImage>),
}

impl Texture {
    fn id(&self) -> TextureId {
        match self {
            Self::Uploaded(texture) => texture.id(),
            Self::OnDevice(image) => image.id,
        }
    }

    fn size(&self) -> egui::Vec2 {
        match self {
            Self::Uploaded(texture) => texture.size_vec2(),
            Self::OnDevice(image) => vec2(image.size[0] as f32, image.size[1] as f32),
        }
    }
}

/// What the view holds between frames.
#[derive(Default)]
pub struct ObjectView {
    texture: Option<Texture>,
    pub made: Option<Box<Made>>,
    /// Version and size of the picture that was asked for last.
    pub asked: Option<(u64, [usize; 2])>,
    /// What the worker is at, for the status line.
    pub doing: Option<&'static str>,
    /// The version whose refinement was given up.
    pub stopped: Option<u64>,
    /// The version of which no picture could be made.
    pub failed: Option<u64>,
    pub kept: Option<Kept>,
    /// Where the wipe stands, 0 left to 1 right.
    pub wipe: f32,
    /// When the picture that is awaited was asked for.
    pub since: Option<Instant>,
    /// Whether the pointer picks.
    pub picking: bool,
    /// What the pointer is over, in parts of the view, while it picks.
    pub pointed: Option<egui::Vec2>,
}

impl ObjectView {
    /// Shows a picture, unless what is shown is newer or better.
    pub fn take(&mut self, ctx: &egui::Context, mut made: Box<Made>) {
        // Of two pictures of one version a draft in the view's present shape is better than a full one in another.
        let rank = |made: &Made| (made.version, self.has_shape(made), made.grade);
        if self.made.as_ref().is_some_and(|shown| rank(shown) > rank(&made)) {
            return;
        }
        (self.since, self.failed) = (None, None);
        let options = TextureOptions::LINEAR;
        match (&mut self.texture, &made.image) {
            (Some(Texture::Uploaded(texture)), DisplayImage::Pixels(image)) => texture.set(image.clone(), options),
            (texture, DisplayImage::Pixels(image)) => {
                *texture = Some(Texture::Uploaded(ctx.load_texture("object", image.clone(), options)));
            }
            (texture, DisplayImage::OnDevice(image)) => *texture = Some(Texture::OnDevice(image.clone())),
        }
        if made.grade == Grade::Final {
            self.doing = None;
        }
        // A was kept before it was finished: it gets the finished picture.
        if let Some(kept) = &mut self.kept
            && kept.version == made.version
            && let Some(image) = made.image.pixels()
        {
            kept.texture.set(image.clone(), options);
            kept.image = image;
        }
        // Until the next one is known, plots show the last.
        made.brdf = made.brdf.or_else(|| self.made.as_ref().and_then(|last| last.brdf.clone()));
        self.made = Some(made);
    }

    /// No picture of this version comes: nothing is awaited any more.
    pub fn fail(&mut self, version: u64) {
        (self.doing, self.since, self.failed) = (None, None, Some(version));
    }

    /// Whether a picture has the shape that was asked for last.
    fn has_shape(&self, made: &Made) -> bool {
        let ratio = |width: usize, height: usize| width as f32 / height.max(1) as f32;
        self.asked.is_none_or(|(_, [width, height])| {
            let [has_width, has_height] = made.image.size();
            let (has, wanted) = (ratio(has_width, has_height), ratio(width, height));
            (has / wanted - 1.0).abs() < 0.03
        })
    }

    /// Textures belong to a window; in another one they are made anew.
    pub fn move_to(&mut self, ctx: &egui::Context) {
        (self.texture, self.asked, self.since) = (None, None, None);
        if let Some(kept) = &mut self.kept {
            kept.texture = ctx.load_texture("kept", kept.image.clone(), TextureOptions::LINEAR);
        }
        match self.made.as_ref().map(|made| &made.image) {
            Some(DisplayImage::Pixels(image)) => {
                let texture = ctx.load_texture("object", image.clone(), TextureOptions::LINEAR);
                self.texture = Some(Texture::Uploaded(texture));
            }
            // It went with the window.
            Some(DisplayImage::OnDevice(_)) => self.made = None,
            None => {}
        }
    }

    /// Shows the picture and moves the scene's camera and light by what the hand does. Returns the pixels it covers.
    pub fn ui(&mut self, ui: &mut Ui, scene: &mut Scene) -> [usize; 2] {
        let size = ui.available_size().max(vec2(64.0, 64.0));
        let (id, area) = ui.allocate_space(size);
        // The edges of the panels beside it can be had from here, too.
        let response = ui.interact(area.shrink2(vec2(EDGE, 0.0)), id, Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Object view"));
        ui.painter().rect_filled(area, 0.0, Color32::from_gray(22));
        if let Some(texture) = &self.texture {
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            let painter = ui.painter().with_clip_rect(area.intersect(ui.clip_rect()));
            painter.image(texture.id(), covered(area, texture.size()), uv, Color32::WHITE);
        } else if self.failed.is_none() {
            self.first_ui(ui, area);
        }
        self.waiting_ui(ui, area);
        self.wipe_ui(ui, area);
        let on_wipe =
            self.kept.is_some() && response.interact_pointer_pos().is_some_and(|at| self.is_on_wipe(area, at));
        if !on_wipe {
            turn(ui, &response, scene, area, self.made.as_ref().map_or(4.0, |made| made.distance));
        }
        let picks = self.picking && !response.dragged();
        self.pointed = response
            .hover_pos()
            .filter(|_| picks)
            .map(|at| ((at - area.min) / area.size()).clamp(egui::Vec2::ZERO, egui::Vec2::splat(1.0)));
        let pixels = area.size() * ui.pixels_per_point();
        [pixels.x.round() as usize, pixels.y.round() as usize]
    }

    /// Says that there is no picture yet, in still words: while the processor draws the window, too, every frame holds the
    /// picture up.
    fn first_ui(&self, ui: &Ui, area: Rect) {
        let seconds = self.since.map_or(0.0, |since| since.elapsed().as_secs_f32());
        let text = match seconds {
            ..1.0 => "Computing the picture".to_owned(),
            _ => format!("Computing the picture, {seconds:.0} s"),
        };
        ui.ctx().request_repaint_after_secs(1.0 - seconds.fract());
        let font = egui::FontId::proportional(13.0);
        ui.painter().text(area.center(), egui::Align2::CENTER_CENTER, text, font, Color32::from_gray(150));
    }

    /// Says that the first picture of an edit is still being computed, once that takes long.
    fn waiting_ui(&self, ui: &mut Ui, area: Rect) {
        let Some(since) = self.since.filter(|_| self.texture.is_some()) else { return };
        let left = SLOW - since.elapsed().as_secs_f32();
        if left > 0.0 {
            ui.ctx().request_repaint_after_secs(left);
            return;
        }
        // Messages lie at the foot.
        let place = Rect::from_min_size(area.left_top() + vec2(10.0, 8.0), vec2(170.0, 26.0));
        ui.painter().rect_filled(place, 5.0, Color32::from_black_alpha(150));
        let left = Rect::from_center_size(place.left_center() + vec2(14.0, 0.0), vec2(14.0, 14.0));
        ui.scope_builder(egui::UiBuilder::new().max_rect(left), |ui| wheel(ui, 14.0, Color32::WHITE));
        let text = format!("Computing, {:.0} s", since.elapsed().as_secs_f32());
        let font = egui::FontId::proportional(12.0);
        ui.painter().text(place.left_center() + vec2(28.0, 0.0), egui::Align2::LEFT_CENTER, text, font, Color32::WHITE);
    }

    /// What is looked at and how, above the view.
    pub fn toolbar(&mut self, ui: &mut Ui, scene: &mut Scene) -> Option<Action> {
        let mut action = None;
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            ui.name_inputs("Object", |ui| object_ui(ui, scene));
            ui.name_inputs("Exposure", |ui| exposure_ui(ui, scene));
            ui.separator();
            for (which, name, tip, on) in [
                (Action::Frame, "Frame", "Show the whole object (F)", false),
                (Action::Snapshot, "A/B", "Keep this picture and compare with what follows (B)", self.kept.is_some()),
                (
                    Action::Pick,
                    "Pick",
                    "Point at the object: how it reflects there, and what the facets add to it (I)",
                    self.picking,
                ),
            ] {
                if ui.selectable_label(on, name).on_hover_text(tip).clicked() {
                    action = Some(which);
                }
            }
            if self.kept.is_some() && ui.button("Back to A").on_hover_text("Undo all edits since A, as one").clicked() {
                action = Some(Action::BackToA);
            }
        });
        action
    }
}

fn object_ui(ui: &mut Ui, scene: &mut Scene) {
    let combo = egui::ComboBox::from_id_salt("object here").selected_text(words(&scene.object.kind)).width(90.0);
    combo.show_ui(ui, |ui| {
        for kind in OBJECT_KINDS.iter().filter(|kind| **kind != "mesh") {
            if ui.selectable_label(scene.object.kind == *kind, words(kind)).clicked() {
                (*kind).clone_into(&mut scene.object.kind);
                scene.object.path = None;
            }
        }
    });
}

fn exposure_ui(ui: &mut Ui, scene: &mut Scene) {
    let camera = scene.camera.clone().unwrap_or_default();
    let mut exposure = camera.exposure_ev;
    let drag = egui::DragValue::new(&mut exposure).range(-10.0..=10.0).speed(0.03).suffix(" EV").max_decimals(2);
    let response = ui.add(drag).on_hover_text("Exposure: drag sideways");
    if response.changed() && exposure.is_finite() {
        scene.camera = Some(Camera { exposure_ev: exposure, ..camera });
    }
}

/// The rectangle that covers `area` with a picture of another shape, centred: a resized view keeps the object's shape.
pub(super) fn covered(area: Rect, image: egui::Vec2) -> Rect {
    let scale = (area.width() / image.x.max(1.0)).max(area.height() / image.y.max(1.0));
    let rect = Rect::from_center_size(area.center(), image * scale);
    if (rect.width() - area.width()).abs() < 4.0 && (rect.height() - area.height()).abs() < 4.0 { area } else { rect }
}

/// Drag turns, the middle button moves, shift-drag or the right button turns the light, the wheel comes closer.
fn turn(ui: &Ui, response: &Response, scene: &mut Scene, area: Rect, distance: f32) {
    let delta = response.drag_delta();
    let shift = ui.input(|input| input.modifiers.shift);
    let light = response.dragged_by(PointerButton::Secondary) || response.dragged_by(PointerButton::Primary) && shift;
    if light && delta.x != 0.0 {
        scene.light.rotation_deg = wrapped(scene.light.rotation_deg + delta.x * 0.5);
    } else if response.dragged_by(PointerButton::Middle) && delta != egui::Vec2::ZERO {
        let camera = scene.camera.get_or_insert_default();
        // What is under the hand stays under it: the view spans this many radii.
        let span = 2.0 * distance * (0.5 * camera.fov_deg).to_radians().tan();
        camera.pan += glam::Vec2::new(-delta.x, delta.y) * span / area.width().min(area.height());
    } else if response.dragged_by(PointerButton::Primary) && delta != egui::Vec2::ZERO {
        let camera = scene.camera.get_or_insert_default();
        let speed = (camera.fov_deg / 30.0).min(1.0);
        camera.azimuth_deg = wrapped(camera.azimuth_deg - delta.x * 0.4 * speed);
        camera.elevation_deg = (camera.elevation_deg + delta.y * 0.3 * speed).clamp(-89.0, 89.0);
    }
    if response.hovered() {
        let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
        let factor = (-scroll * 0.002).exp() / pinch;
        if factor != 1.0 {
            closer(scene, factor, distance);
        }
    }
    if response.double_clicked() {
        frame(scene);
    }
    if response.dragged() {
        ui.ctx().set_cursor_icon(if light { CursorIcon::ResizeHorizontal } else { CursorIcon::Grabbing });
    }
}

/// Frames the object, from where it is looked at.
pub fn frame(scene: &mut Scene) {
    if let Some(camera) = &mut scene.camera {
        camera.distance = 0.0;
        camera.pan = glam::Vec2::ZERO;
        camera.fov_deg = Camera::default().fov_deg;
    }
}

/// Comes closer by a factor, from where automatic framing had put the camera; near the object the lens narrows instead,
/// until single tiles show.
fn closer(scene: &mut Scene, factor: f32, distance: f32) {
    let camera = scene.camera.get_or_insert_default();
    let from = if camera.distance > 0.0 { camera.distance } else { distance };
    let narrows = factor < 1.0 && from * factor < NEAREST || factor > 1.0 && camera.fov_deg < NARROW;
    if narrows {
        camera.fov_deg = (camera.fov_deg * factor).clamp(1.0, Camera::default().fov_deg.max(camera.fov_deg));
        camera.distance = from;
    } else {
        camera.distance = (from * factor).clamp(NEAREST.min(from), 60.0);
    }
}

fn wrapped(degrees: f32) -> f32 {
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}
