//! The look of the editor: neutral greys, so that users judge colours correctly, one accent colour, and even spacing.

use eframe::egui::{
    Color32, Context, CornerRadius, FontFamily, FontId, Margin, Stroke, TextStyle, Theme, Visuals, vec2,
};

/// Colour of active elements.
pub const ACCENT: Color32 = Color32::from_rgb(78, 142, 214);
pub const WARNING: Color32 = Color32::from_rgb(222, 154, 60);

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
    accented(visuals)
}

fn accented(mut visuals: Visuals) -> Visuals {
    visuals.selection.bg_fill = ACCENT;
    visuals.selection.stroke = Stroke::new(1.0, Color32::WHITE);
    visuals.hyperlink_color = ACCENT;
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
