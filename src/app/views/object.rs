//! The object view, shaded by the effective BRDF. Dragging turns the object, and scrolling zooms.

use std::sync::Arc;
use std::time::Instant;

use crate::effective::{EffectiveBrdf, ErrorEstimate};
use crate::plan::Effect;
use crate::scene::{Background, Camera, Scene};
use eframe::egui::{
    self, Color32, CursorIcon, PointerButton, Rect, Response, Sense, TextureHandle, TextureId, TextureOptions, Ui,
    pos2, vec2,
};

use super::methods::MethodsState;
use super::spinner::spinner;
use super::wipe::ComparisonImage;
use super::zoom::zoom;
use crate::app::worker::{DisplayImage, GpuImage, Grade, RenderedPreview};

/// Delay before the view reports that an image is being computed [s].
const PROGRESS_DELAY: f32 = 0.33;
/// Logarithm of the factor on the background's distance per point that the pointer moves.
const BACKGROUND_SPEED: f32 = 0.01;
/// Distances of a background that is dragged [world units].
const NEAR_BACKGROUND: f32 = 1e-3;
const FAR_BACKGROUND: f32 = 1e3;
/// Margin that the view leaves to the drag handles of the panels [points].
const HANDLE_MARGIN: f32 = 6.0;
/// Stages of the image alone.
const IMAGE_STAGES: [&str; 5] = ["picture table", "g-buffer", "shadows", "shading", "tone"];

/// The texture that the view draws.
enum Texture {
    Uploaded(TextureHandle),
    OnGpu(Arc<GpuImage>),
}

impl Texture {
    fn id(&self) -> TextureId {
        match self {
            Self::Uploaded(texture) => texture.id(),
            Self::OnGpu(image) => image.id,
        }
    }

    fn size(&self) -> egui::Vec2 {
        match self {
            Self::Uploaded(texture) => texture.size_vec2(),
            Self::OnGpu(image) => vec2(image.size[0] as f32, image.size[1] as f32),
        }
    }
}

/// State of the view between frames.
#[derive(Default)]
pub struct ObjectView {
    texture: Option<Texture>,
    pub preview: Option<Box<RenderedPreview>>,
    /// Version and size of the last request.
    pub requested: Option<(u64, [usize; 2])>,
    /// Current activity of the worker, for the status line.
    pub activity: Option<&'static str>,
    /// The version whose refinement was cancelled.
    pub stopped: Option<u64>,
    /// The error that a BRDF states.
    pub stated: Option<(Arc<EffectiveBrdf>, ErrorEstimate)>,
    /// The plan of the last refined image.
    pub refined_effects: Option<Vec<Effect>>,
    /// The warnings of the newest final image whose warnings are known.
    pub warnings: Vec<String>,
    /// The version of that image. Warnings of older versions are ignored.
    pub warnings_of: u64,
    /// Milliseconds of the stages from the last edit to its refined image.
    pub stages: Vec<(&'static str, f64)>,
    /// The version that could not be rendered.
    pub failed: Option<u64>,
    /// Image A, which the view compares with the current one.
    pub comparison: Option<ComparisonImage>,
    /// Position of the dividing line, from 0 (left) to 1 (right).
    pub wipe: f32,
    /// Time at which the pending image was requested.
    pub requested_at: Option<Instant>,
    /// True in pick mode.
    pub picking: bool,
    /// Position of the pointer in pick mode, in fractions of the view.
    pub pick_position: Option<egui::Vec2>,
}

impl ObjectView {
    /// Displays an image, unless the displayed one is newer or better.
    pub fn receive(&mut self, ctx: &egui::Context, mut preview: Box<RenderedPreview>) {
        // For one version, a draft in the view's current aspect ratio is better than a final image in another one.
        let rank = |preview: &RenderedPreview| (preview.version, self.has_shape(preview), preview.grade);
        if self.preview.as_ref().is_some_and(|shown| rank(shown) > rank(&preview)) {
            return;
        }
        (self.requested_at, self.failed) = (None, None);
        let options = TextureOptions::LINEAR;
        match (&mut self.texture, &preview.image) {
            (Some(Texture::Uploaded(texture)), DisplayImage::Pixels(image)) => texture.set(image.clone(), options),
            (texture, DisplayImage::Pixels(image)) => {
                *texture = Some(Texture::Uploaded(ctx.load_texture("object", image.clone(), options)));
            }
            (texture, DisplayImage::OnGpu(image)) => *texture = Some(Texture::OnGpu(image.clone())),
        }
        if preview.grade == Grade::Final {
            self.activity = None;
        }
        if preview.grade >= Grade::Refining {
            self.refined_effects = Some(preview.effects.clone());
            self.note_stages(&preview.stages);
        }
        // If A was stored before its image was final, the final image replaces it.
        if let Some(comparison) = &mut self.comparison
            && comparison.version == preview.version
            && let Some(image) = preview.image.pixels()
        {
            comparison.texture.set(image.clone(), options);
            comparison.image = image;
        }
        // Plots show the last known BRDF until the next one arrives.
        preview.brdf = preview.brdf.or_else(|| self.preview.as_ref().and_then(|last| last.brdf.clone()));
        self.preview = Some(preview);
    }

    /// Replaces the times of stages by those of a refined image. If only the image was rendered again, the other times stay.
    fn note_stages(&mut self, stages: &[(&'static str, f64)]) {
        if stages.iter().any(|(name, _)| !IMAGE_STAGES.contains(name)) {
            self.stages.clear();
        }
        for (name, ms) in stages {
            match self.stages.iter_mut().find(|(noted, _)| noted == name) {
                Some(noted) => noted.1 = *ms,
                None => self.stages.push((*name, *ms)),
            }
        }
    }

    /// The plan of the refined image, because drafts leave out more. Until it exists, that of the displayed image.
    pub fn effects(&self) -> &[Effect] {
        let shown = || self.preview.as_ref().map(|preview| &preview.effects[..]);
        self.refined_effects.as_deref().or_else(shown).unwrap_or_default()
    }

    /// The stated error of the displayed BRDF, once it is known.
    pub fn stated_error(&self) -> Option<ErrorEstimate> {
        let (brdf, error) = self.stated.as_ref()?;
        let shown = self.preview.as_ref()?.brdf.as_ref()?;
        Arc::ptr_eq(brdf, shown).then_some(*error)
    }

    /// Notes that a version cannot be rendered.
    pub fn fail(&mut self, version: u64) {
        (self.activity, self.requested_at, self.failed) = (None, None, Some(version));
    }

    /// Returns true if an image has the requested aspect ratio.
    fn has_shape(&self, preview: &RenderedPreview) -> bool {
        let ratio = |width: usize, height: usize| width as f32 / height.max(1) as f32;
        self.requested.is_none_or(|(_, [width, height])| {
            let [has_width, has_height] = preview.image.size();
            let (has, wanted) = (ratio(has_width, has_height), ratio(width, height));
            (has / wanted - 1.0).abs() < 0.03
        })
    }

    /// Moves to another window. Textures belong to a window, so they are loaded again.
    pub fn move_to(&mut self, ctx: &egui::Context) {
        (self.texture, self.requested, self.requested_at) = (None, None, None);
        if let Some(comparison) = &mut self.comparison {
            comparison.texture = ctx.load_texture("comparison", comparison.image.clone(), TextureOptions::LINEAR);
        }
        match self.preview.as_ref().map(|preview| &preview.image) {
            Some(DisplayImage::Pixels(image)) => {
                let texture = ctx.load_texture("object", image.clone(), TextureOptions::LINEAR);
                self.texture = Some(Texture::Uploaded(texture));
            }
            // The texture was lost with the old window.
            Some(DisplayImage::OnGpu(_)) => self.preview = None,
            None => {}
        }
    }

    /// Draws the image, and moves the scene's camera and light with the pointer. Images by other methods lie over it, if they
    /// are of the given version. Returns the size in pixels.
    pub fn ui(&mut self, ui: &mut Ui, scene: &mut Scene, methods: Option<(&mut MethodsState, u64)>) -> [usize; 2] {
        let size = ui.available_size().max(vec2(64.0, 64.0));
        let (id, area) = ui.allocate_space(size);
        // The margin keeps the edges of the neighbouring panels draggable.
        let response = ui.interact(area.shrink2(vec2(HANDLE_MARGIN, 0.0)), id, Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Object view"));
        ui.painter().rect_filled(area, 0.0, Color32::from_gray(22));
        if let Some(texture) = &self.texture {
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            let painter = ui.painter().with_clip_rect(area.intersect(ui.clip_rect()));
            painter.image(texture.id(), covered(area, texture.size()), uv, Color32::WHITE);
        } else if self.failed.is_none() {
            self.placeholder_ui(ui, area);
        }
        self.progress_ui(ui, area);
        let press = response.interact_pointer_pos();
        let on_wipe = match methods {
            Some((methods, version)) => {
                methods.ui(ui, area, version);
                press.is_some_and(|at| methods.is_on_line(area, at))
            }
            None => {
                self.wipe_ui(ui, area);
                self.comparison.is_some() && press.is_some_and(|at| self.is_on_wipe(area, at))
            }
        };
        if !on_wipe {
            navigate(ui, &response, scene, area, self.preview.as_ref().map_or(4.0, |preview| preview.distance));
        }
        let picks = self.picking && !response.dragged();
        self.pick_position = response
            .hover_pos()
            .filter(|_| picks)
            .map(|at| ((at - area.min) / area.size()).clamp(egui::Vec2::ZERO, egui::Vec2::splat(1.0)));
        let pixels = area.size() * ui.pixels_per_point();
        [pixels.x.round() as usize, pixels.y.round() as usize]
    }

    /// Draws static text while no image exists. An animation would delay the image if the CPU also draws the window.
    fn placeholder_ui(&self, ui: &Ui, area: Rect) {
        let seconds = self.requested_at.map_or(0.0, |since| since.elapsed().as_secs_f32());
        let text = match seconds {
            ..1.0 => "Computing the image".to_owned(),
            _ => format!("Computing the image, {seconds:.0} s"),
        };
        ui.ctx().request_repaint_after_secs(1.0 - seconds.fract());
        let font = egui::FontId::proportional(13.0);
        ui.painter().text(area.center(), egui::Align2::CENTER_CENTER, text, font, Color32::from_gray(150));
    }

    /// Draws a progress note if the first image of an edit takes long.
    fn progress_ui(&self, ui: &mut Ui, area: Rect) {
        let Some(since) = self.requested_at.filter(|_| self.texture.is_some()) else { return };
        let left = PROGRESS_DELAY - since.elapsed().as_secs_f32();
        if left > 0.0 {
            ui.ctx().request_repaint_after_secs(left);
            return;
        }
        // The note is at the top, because messages are at the bottom.
        let note = Rect::from_min_size(area.left_top() + vec2(10.0, 8.0), vec2(170.0, 26.0));
        ui.painter().rect_filled(note, 5.0, Color32::from_black_alpha(150));
        let left = Rect::from_center_size(note.left_center() + vec2(14.0, 0.0), vec2(14.0, 14.0));
        ui.scope_builder(egui::UiBuilder::new().max_rect(left), |ui| spinner(ui, 14.0, Color32::WHITE));
        let text = format!("Computing, {:.0} s", since.elapsed().as_secs_f32());
        let font = egui::FontId::proportional(12.0);
        ui.painter().text(note.left_center() + vec2(28.0, 0.0), egui::Align2::LEFT_CENTER, text, font, Color32::WHITE);
    }
}

/// Returns the centred rectangle of an image that covers `area` without distortion.
pub(super) fn covered(area: Rect, image: egui::Vec2) -> Rect {
    let scale = (area.width() / image.x.max(1.0)).max(area.height() / image.y.max(1.0));
    let rect = Rect::from_center_size(area.center(), image * scale);
    if (rect.width() - area.width()).abs() < 4.0 && (rect.height() - area.height()).abs() < 4.0 { area } else { rect }
}

/// Applies pointer input. Dragging turns the object, and the middle button moves it. Shift-drag or the right button
/// turns the light, Ctrl-drag moves the background of a slab away or near, and scrolling zooms.
fn navigate(ui: &Ui, response: &Response, scene: &mut Scene, area: Rect, distance: f32) {
    let delta = response.drag_delta();
    let shift = ui.input(|input| input.modifiers.shift);
    let light = response.dragged_by(PointerButton::Secondary) || response.dragged_by(PointerButton::Primary) && shift;
    let moves_background = response.dragged_by(PointerButton::Primary) && ui.input(|input| input.modifiers.command);
    let background = scene.background.as_mut().filter(|_| moves_background).and_then(Background::distance_mut);
    if let Some(distance) = background {
        *distance = ((distance.max(NEAR_BACKGROUND)) * (-delta.y * BACKGROUND_SPEED).exp()).min(FAR_BACKGROUND);
    } else if light && delta.x != 0.0 {
        scene.light.rotation_deg = wrapped(scene.light.rotation_deg + delta.x * 0.5);
    } else if response.dragged_by(PointerButton::Middle) && delta != egui::Vec2::ZERO {
        let camera = scene.camera.get_or_insert_default();
        // The point under the pointer stays under it. The view spans this many radii.
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
            zoom(scene, factor, distance);
        }
    }
    if response.double_clicked() {
        frame(scene);
    }
    if response.dragged() {
        ui.ctx().set_cursor_icon(if light { CursorIcon::ResizeHorizontal } else { CursorIcon::Grabbing });
    }
}

/// Frames the object from the current direction.
pub fn frame(scene: &mut Scene) {
    if let Some(camera) = &mut scene.camera {
        camera.distance = 0.0;
        camera.pan = glam::Vec2::ZERO;
        camera.fov_deg = Camera::default().fov_deg;
    }
}

fn wrapped(degrees: f32) -> f32 {
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}
