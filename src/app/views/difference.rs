//! The difference from the reference, large in the object's view, with the scale of its colours.

use crate::render::image::tone_map::srgb_byte;
use crate::report::{FULL_SCALE, heat};
use eframe::egui::{Align2, Color32, FontId, Key, Rect, Sense, TextureHandle, Ui, UiBuilder, pos2, vec2};

/// Width of the scale with its numbers, of its bar, and margin around the image [points].
const SCALE: f32 = 64.0;
const BAR: f32 = 14.0;
const MARGIN: f32 = 30.0;
/// Colours of the bar.
const STEPS: usize = 64;

/// The colour of a ΔE.
pub fn color(delta_e: f32) -> Color32 {
    let [r, g, b] = heat(delta_e).to_array().map(srgb_byte);
    Color32::from_rgb(r, g, b)
}

/// Draws an image of ΔE over `area`. Returns false if the user closed it.
pub fn ui(ui: &mut Ui, area: Rect, texture: &TextureHandle, caption: &str) -> bool {
    // The image covers the view, so that no drag turns the object below it.
    let response = ui.interact(area, ui.scope_id().with("difference"), Sense::click_and_drag());
    let painter = ui.painter().with_clip_rect(area);
    painter.rect_filled(area, 0.0, Color32::from_gray(22));
    let inner = area.shrink(MARGIN);
    let side = (inner.width() - SCALE).min(inner.height()).max(16.0);
    let image = Rect::from_center_size(inner.center() - vec2(0.5 * SCALE, 0.0), vec2(side, side));
    let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    painter.image(texture.id(), image, uv, Color32::WHITE);
    let bar = Rect::from_min_size(image.right_top() + vec2(14.0, 0.0), vec2(BAR, side));
    let y = |part: f32| bar.bottom() - part * bar.height();
    for step in 0..STEPS {
        let [from, to] = [step, step + 1].map(|step| step as f32 / STEPS as f32);
        let cell = Rect::from_min_max(pos2(bar.left(), y(to)), pos2(bar.right(), y(from)));
        painter.rect_filled(cell, 0.0, color(0.5 * (from + to) * FULL_SCALE));
    }
    let (font, grey) = (FontId::proportional(11.0), Color32::from_gray(200));
    for tick in 0..=5_u8 {
        let part = f32::from(tick) / 5.0;
        let end = if tick == 5 { " +" } else { "" };
        let text = format!("{}{end}", part * FULL_SCALE);
        painter.text(pos2(bar.right() + 5.0, y(part)), Align2::LEFT_CENTER, text, font.clone(), grey);
    }
    painter.text(bar.center_top() - vec2(0.0, 4.0), Align2::CENTER_BOTTOM, "ΔE", font.clone(), grey);
    painter.text(area.left_top() + vec2(10.0, 8.0), Align2::LEFT_TOP, caption, font, grey);
    let place = Rect::from_min_size(area.right_top() + vec2(-64.0, 6.0), vec2(58.0, 22.0));
    let close = ui.scope_builder(UiBuilder::new().max_rect(place), |ui| ui.button("Close")).inner;
    let escaped = response.hovered() && ui.input(|input| input.key_pressed(Key::Escape));
    !(close.on_hover_text("Show the object again").clicked() || escaped)
}
