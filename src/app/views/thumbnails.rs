//! Thumbnails of scenes and of choices. They are rendered when a view asks for them for the first time.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use eframe::egui::{
    self, Align2, Color32, ColorImage, ComboBox, Context, FontId, Rect, Response, Sense, TextureHandle, Ui, pos2, vec2,
};

use crate::app::theme;
use crate::app::worker::{Subject, ThumbnailJob};

/// Height of a thumbnail over its width. The margins above and below the subject are cut off.
const ASPECT: f32 = 0.82;
/// Height of a caption [points].
const CAPTION: f32 = 17.0;
/// Width of a picker's thumbnails, the gap between them, and their number per row.
const SIDE: f32 = 92.0;
const GAP: f32 = 6.0;
const COLUMNS: usize = 3;

/// The thumbnails, which all views share.
#[derive(Clone, Default)]
pub struct Thumbnails(Rc<RefCell<State>>);

#[derive(Default)]
struct State {
    /// Textures; `None` if a subject cannot be rendered.
    textures: HashMap<Subject, Option<TextureHandle>>,
    /// Subjects without a texture that a view asked for in this frame.
    missing: Vec<Subject>,
    requested: Option<Subject>,
}

impl Thumbnails {
    pub fn receive(&self, ctx: &Context, subject: Subject, image: Option<Arc<ColorImage>>) {
        let options = egui::TextureOptions::LINEAR;
        let texture = image.map(|image| ctx.load_texture(format!("{subject:?}"), image, options));
        let mut state = self.0.borrow_mut();
        state.textures.insert(subject, texture);
        state.requested = None;
    }

    /// Ends a frame. Returns the job of the next thumbnail that it missed, unless one is being rendered or `is_idle` is
    /// false. Open pickers come before the gallery.
    pub fn end_frame(&self, is_idle: bool) -> Option<ThumbnailJob> {
        let mut state = self.0.borrow_mut();
        let missing = std::mem::take(&mut state.missing);
        if state.requested.is_some() || !is_idle {
            return None;
        }
        let choice = missing.iter().find(|subject| !matches!(subject, Subject::Scene(_)));
        let next = *choice.or(missing.first())?;
        state.requested = Some(next);
        Some(ThumbnailJob::Subject(next))
    }

    /// Notes that the current job was cancelled.
    pub fn interrupted(&self) {
        self.0.borrow_mut().requested = None;
    }

    pub fn is_waiting(&self) -> bool {
        self.0.borrow().requested.is_some()
    }

    #[cfg(test)]
    pub fn has_image(&self, subject: Subject) -> bool {
        matches!(self.0.borrow().textures.get(&subject), Some(Some(_)))
    }

    /// Returns the texture of a subject. The outer value is absent until the subject is rendered.
    fn texture(&self, subject: Subject) -> Option<Option<TextureHandle>> {
        let mut state = self.0.borrow_mut();
        let texture = state.textures.get(&subject).cloned();
        if texture.is_none() {
            state.missing.push(subject);
        }
        texture
    }

    /// Draws a thumbnail with a caption as a button.
    pub fn button(
        &self,
        ui: &mut Ui,
        (subject, caption): (Subject, &str),
        side: f32,
        is_current: bool,
        sense: Sense,
    ) -> Response {
        let texture = self.texture(subject);
        let (area, response) = ui.allocate_exact_size(vec2(side, side * ASPECT + CAPTION), sense);
        response.widget_info(|| egui::WidgetInfo::selected(egui::Role::Button, true, is_current, caption));
        if !ui.is_rect_visible(area) {
            return response;
        }
        let frame = Rect::from_min_size(area.min, vec2(side, side * ASPECT));
        let painter = ui.painter().with_clip_rect(area.intersect(ui.clip_rect()));
        match &texture {
            Some(Some(texture)) => {
                let margin = 0.5 * (1.0 - ASPECT);
                let uv = Rect::from_min_max(pos2(0.0, margin), pos2(1.0, 1.0 - margin));
                egui::Image::new((texture.id(), frame.size())).uv(uv).corner_radius(4).paint_at(ui, frame);
            }
            missing => {
                painter.rect_filled(frame, 4.0, ui.visuals().faint_bg_color);
                if missing.is_some() && !matches!(subject, Subject::Scene(_)) {
                    let (font, color) = (FontId::proportional(11.0), ui.visuals().weak_text_color());
                    painter.text(frame.center(), Align2::CENTER_CENTER, "from a file", font, color);
                }
            }
        }
        let is_marked = is_current || response.hovered() || response.has_focus();
        let color = if is_marked { theme::ACCENT } else { Color32::TRANSPARENT };
        painter.rect_stroke(frame, 4.0, egui::Stroke::new(2.0, color), egui::StrokeKind::Inside);
        let text = if is_current { ui.visuals().strong_text_color() } else { ui.visuals().text_color() };
        let at = pos2(area.left() + 1.0, frame.bottom() + 2.0);
        painter.text(at, Align2::LEFT_TOP, caption, FontId::proportional(11.0), text);
        response
    }

    /// Draws the thumbnail of a subject that is dragged, at the pointer.
    pub fn drag_image(&self, ctx: &Context, subject: Subject) {
        let (Some(Some(texture)), Some(at)) = (self.texture(subject), ctx.pointer_interact_pos()) else { return };
        let painter =
            ctx.layer_painter(egui::LayerId::new(egui::Order::Tooltip, egui::Id::unique("dragged thumbnail")));
        let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        let rect = Rect::from_min_size(at + vec2(8.0, 8.0), vec2(64.0, 64.0));
        painter.image(texture.id(), rect, uv, Color32::from_white_alpha(200));
    }

    /// Draws a picker: a combo box whose list shows the choices as thumbnails. Returns the choice that the user takes
    /// instead of `now`.
    pub fn picker(
        &self,
        ui: &mut Ui,
        combo: ComboBox,
        now: &str,
        choices: impl IntoIterator<Item = Choice>,
    ) -> Option<&'static str> {
        let mut chosen = None;
        combo.height(440.0).show_ui(ui, |ui| {
            ui.set_min_width(COLUMNS as f32 * (SIDE + GAP));
            egui::Grid::new("choices").spacing([GAP, GAP]).show(ui, |ui| {
                for (at, choice) in choices.into_iter().enumerate() {
                    let is_current = choice.name == now;
                    let button = (choice.subject, &*choice.caption);
                    let response = self.button(ui, button, SIDE, is_current, Sense::click());
                    let response = if choice.doc.is_empty() { response } else { response.on_hover_text(&choice.doc) };
                    if response.clicked() && !is_current {
                        chosen = Some(choice.name);
                    }
                    if at % COLUMNS == COLUMNS - 1 {
                        ui.end_row();
                    }
                }
            });
        });
        chosen
    }
}

/// A choice of a picker.
pub struct Choice {
    pub name: &'static str,
    pub caption: String,
    pub doc: String,
    pub subject: Subject,
}
