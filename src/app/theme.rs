//! The look of the editor: neutral greys, so that users judge colours correctly, one accent colour, and even spacing.

use eframe::egui::{
    Color32, Context, CornerRadius, FontFamily, FontId, Margin, Stroke, TextStyle, Theme, Visuals, vec2,
};

/// Colour of active elements, and of the ground of selected text.
pub const ACCENT: Color32 = Color32::from_rgb(78, 142, 214);
const SELECTION: Color32 = Color32::from_rgb(44, 104, 176);

/// Colour of warnings in a theme.
pub fn warning(visuals: &Visuals) -> Color32 {
    if visuals.dark_mode { Color32::from_rgb(222, 154, 60) } else { Color32::from_rgb(134, 78, 0) }
}

pub fn install(ctx: &Context) {
    ctx.set_visuals_of(Theme::Dark, dark());
    ctx.set_visuals_of(Theme::Light, light());
    ctx.all_styles_mut(|style| {
        let font = |size: f32| FontId::new(size, FontFamily::Proportional);
        style.text_styles = [
            (TextStyle::Small, font(10.5)),
            (TextStyle::Body, font(13.0)),
            (TextStyle::Button, font(13.0)),
            (TextStyle::Heading, font(14.5)),
            (TextStyle::Monospace, FontId::new(12.0, FontFamily::Monospace)),
        ]
        .into();
        style.spacing.item_spacing = vec2(6.0, 5.0);
        style.spacing.button_padding = vec2(7.0, 3.0);
        style.spacing.interact_size = vec2(36.0, 21.0);
        style.spacing.slider_rail_height = 4.0;
        style.spacing.combo_width = 120.0;
        style.spacing.menu_margin = Margin::same(6);
        style.interaction.tooltip_delay = 0.4;
        // The view beside a panel's edge covers half of the handle.
        style.interaction.resize_grab_radius_side = 7.0;
        style.visuals.slider_trailing_fill = true;
    });
}

fn dark() -> Visuals {
    let mut visuals = Visuals::dark();
    visuals.panel_fill = Color32::from_gray(36);
    visuals.window_fill = Color32::from_gray(42);
    visuals.extreme_bg_color = Color32::from_gray(24);
    visuals.faint_bg_color = Color32::from_gray(44);
    visuals.widgets.noninteractive.bg_stroke = Stroke::new(1.0, Color32::from_gray(54));
    visuals.widgets.noninteractive.fg_stroke = Stroke::new(1.0, Color32::from_gray(190));
    visuals.widgets.inactive.weak_bg_fill = Color32::from_gray(58);
    visuals.widgets.inactive.bg_fill = Color32::from_gray(64);
    visuals.widgets.inactive.fg_stroke = Stroke::new(1.0, Color32::from_gray(214));
    visuals.weak_text_color = Some(Color32::from_gray(165));
    visuals.error_fg_color = Color32::from_rgb(255, 110, 100);
    visuals.hyperlink_color = Color32::from_rgb(110, 170, 235);
    accented(visuals)
}

fn light() -> Visuals {
    let mut visuals = Visuals::light();
    visuals.panel_fill = Color32::from_gray(236);
    visuals.window_fill = Color32::from_gray(244);
    visuals.extreme_bg_color = Color32::from_gray(252);
    visuals.faint_bg_color = Color32::from_gray(228);
    visuals.widgets.noninteractive.bg_stroke = Stroke::new(1.0, Color32::from_gray(206));
    visuals.widgets.inactive.weak_bg_fill = Color32::from_gray(218);
    visuals.widgets.inactive.bg_fill = Color32::from_gray(206);
    visuals.widgets.noninteractive.fg_stroke = Stroke::new(1.0, Color32::from_gray(40));
    visuals.weak_text_color = Some(Color32::from_gray(85));
    visuals.error_fg_color = Color32::from_rgb(176, 20, 20);
    visuals.hyperlink_color = Color32::from_rgb(20, 84, 160);
    accented(visuals)
}

fn accented(mut visuals: Visuals) -> Visuals {
    visuals.warn_fg_color = warning(&visuals);
    visuals.selection.bg_fill = SELECTION;
    visuals.selection.stroke = Stroke::new(1.0, Color32::WHITE);
    let radius = CornerRadius::same(4);
    let widgets = &mut visuals.widgets;
    for state in [&mut widgets.inactive, &mut widgets.hovered, &mut widgets.active, &mut widgets.open] {
        state.corner_radius = radius;
        state.expansion = 0.0;
    }
    visuals.window_corner_radius = CornerRadius::same(8);
    visuals.menu_corner_radius = CornerRadius::same(6);
    visuals
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance (WCAG 2).
    fn luminance(color: Color32) -> f32 {
        let linear = |byte: u8| {
            let value = f32::from(byte) / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(color.r()) + 0.7152 * linear(color.g()) + 0.0722 * linear(color.b())
    }

    fn contrast(a: Color32, b: Color32) -> f32 {
        let (a, b) = (luminance(a) + 0.05, luminance(b) + 0.05);
        a.max(b) / a.min(b)
    }

    #[test]
    fn every_text_has_a_contrast_of_at_least_4_5_in_both_themes() {
        for visuals in [dark(), light()] {
            let widgets = &visuals.widgets;
            let texts = [
                ("text", visuals.text_color()),
                ("weak text", visuals.weak_text_color()),
                ("strong text", visuals.strong_text_color()),
                ("warning", warning(&visuals)),
                ("error", visuals.error_fg_color),
                ("link", visuals.hyperlink_color),
            ];
            let grounds = [visuals.panel_fill, visuals.window_fill, visuals.extreme_bg_color, visuals.faint_bg_color];
            for (name, text) in texts {
                for ground in grounds {
                    let contrast = contrast(text, ground);
                    assert!(contrast >= 4.5, "{name} on {ground:?}, dark: {}: {contrast}", visuals.dark_mode);
                }
            }
            let buttons = [
                (widgets.inactive.text_color(), widgets.inactive.weak_bg_fill),
                (widgets.hovered.text_color(), widgets.hovered.weak_bg_fill),
                (widgets.active.text_color(), widgets.active.weak_bg_fill),
                (widgets.open.text_color(), widgets.open.weak_bg_fill),
                (visuals.weak_text_color(), widgets.inactive.weak_bg_fill),
                (visuals.selection.stroke.color, visuals.selection.bg_fill),
            ];
            for (at, (text, ground)) in buttons.into_iter().enumerate() {
                let contrast = contrast(text, ground);
                assert!(contrast >= 4.5, "button {at}, dark: {}: {contrast}", visuals.dark_mode);
            }
        }
    }
}
