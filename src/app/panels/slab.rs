//! The panel of a thin transparent slab: its faces, its material, its background, its lobe and where the light goes.

use crate::scene::{Background, Kind, Scene, Slab, SlabFace};
use eframe::egui::{Align2, Color32, FontId, Pos2, Rect, Sense, Stroke, Ui, pos2, vec2};
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Table;

use super::controls;
use super::fields::{self, PanelContext};
use crate::app::worker::SlabPlot;

/// Height of the polar plot and of the bar [points].
const PLOT: f32 = 150.0;
const BAR: f32 = 18.0;
/// Colours of the curves and of the parts of the light.
const CURVES: [Color32; 3] =
    [Color32::from_rgb(255, 170, 60), Color32::from_rgb(90, 180, 255), Color32::from_rgb(160, 160, 160)];
const PARTS: [Color32; 4] = [
    Color32::from_rgb(120, 200, 120),
    Color32::from_rgb(230, 220, 120),
    Color32::from_rgb(110, 150, 230),
    Color32::from_rgb(90, 90, 90),
];

/// Draws the controls of the slab, which a scene may have or not.
pub fn ui(ui: &mut Ui, scene: &mut Scene, plot: Option<&SlabPlot>, context: &mut PanelContext) {
    let mut has_slab = scene.slab.is_some();
    let tip = "The surface is a sheet of glass or plastic between two rough faces.";
    if ui.checkbox(&mut has_slab, "Thin transparent slab").on_hover_text(tip).changed() {
        if has_slab {
            let bottom = SlabFace::with_defaults("ggx").unwrap_or(SlabFace::Smooth {});
            scene.slab = Some(Slab { bottom, ..Slab::default() });
            scene.background = Background::with_defaults("checkerboard");
        } else {
            (scene.slab, scene.background) = (None, None);
        }
    }
    let Some(slab) = &mut scene.slab else { return };
    for (caption, side) in [("Top", 0), ("Bottom", 1)] {
        let face = if side == 0 { &mut slab.top } else { &mut slab.bottom };
        let now = face.kind();
        let with_defaults =
            |kind: &str| SlabFace::with_defaults(kind).filter(|face| face.path().is_none() || kind == "tile");
        ui.push_id(caption, |ui| tagged_ui(ui, caption, face, now, &SlabFace::kinds(), with_defaults, context));
    }
    edit(ui, slab, &["top", "bottom"], context);
    if let Some(background) = &mut scene.background {
        let now = background.kind();
        let with_defaults =
            |kind: &str| Background::with_defaults(kind).filter(|background| background.path().is_none());
        ui.push_id("background", |ui| {
            tagged_ui(ui, "Background", background, now, &Background::kinds(), with_defaults, context);
        });
    } else if ui.button("Add a background").clicked() {
        scene.background = Background::with_defaults("checkerboard");
    }
    if let Some(plot) = plot {
        ui.add_space(4.0);
        polar_ui(ui, plot);
        bar_ui(ui, plot);
    }
}

/// Draws the fields of the slab itself.
fn edit(ui: &mut Ui, slab: &mut Slab, skip: &[&str], context: &mut PanelContext) {
    let Ok(mut table) = Table::try_from(&*slab) else { return };
    let before = table.clone();
    fields::table_ui(ui, &mut table, &Slab::fields(), skip, context);
    if table != before
        && let Ok(changed) = table.try_into()
    {
        *slab = changed;
    }
}

/// Draws the choice of a kind and its fields. `with_defaults` returns `None` for kinds that need a file first.
fn tagged_ui<T: Serialize + DeserializeOwned>(
    ui: &mut Ui,
    caption: &str,
    value: &mut T,
    now: &str,
    kinds: &[Kind],
    with_defaults: impl Fn(&str) -> Option<T>,
    context: &mut PanelContext,
) {
    let Some(kind) = kinds.iter().find(|kind| kind.kind == now) else { return };
    let offered: Vec<Kind> =
        kinds.iter().filter(|kind| kind.kind == now || with_defaults(kind.kind).is_some()).cloned().collect();
    let chosen = fields::row(ui, caption, kind.doc, |ui| controls::kind_ui(ui, caption, now, &offered));
    if let Some(chosen) = chosen.and_then(with_defaults) {
        *value = chosen;
        return;
    }
    let Ok(mut table) = Table::try_from(&*value) else { return };
    let before = table.clone();
    fields::table_ui(ui, &mut table, &kind.fields, &["path", "scene"], context);
    if table != before
        && let Ok(changed) = table.try_into()
    {
        *value = changed;
    }
}

/// Draws the lobe in the plane of incidence: the light arrives from the upper left, and the slab is the line on top.
fn polar_ui(ui: &mut Ui, plot: &SlabPlot) {
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), PLOT), Sense::hover());
    response.on_hover_text(format!(
        "What the slab transmits of light at {:.0}°, in the plane of incidence, each curve on the scale of the largest. Straight light is left out.",
        plot.theta_deg
    ));
    let painter = ui.painter_at(area);
    painter.rect_filled(area, 2.0, Color32::from_gray(12));
    let center = pos2(area.center().x, area.top() + 34.0);
    let radius = (0.5 * area.width() - 8.0).min(area.bottom() - center.y - 6.0);
    let line = Stroke::new(1.0, Color32::from_gray(110));
    painter.line_segment([center - vec2(radius, 0.0), center + vec2(radius, 0.0)], line);
    let (sin, cos) = plot.theta_deg.to_radians().sin_cos();
    painter.arrow(center - 30.0 * vec2(sin, cos), 26.0 * vec2(sin, cos), Stroke::new(1.5, Color32::YELLOW));
    let peak =
        plot.curves.iter().flat_map(|(_, values)| values).fold(f32::MIN_POSITIVE, |peak, value| peak.max(*value));
    for ((name, values), (k, color)) in plot.curves.iter().zip(CURVES.iter().enumerate()) {
        let steps = (values.len().max(2) - 1) as f32;
        let point = |(at, value): (usize, &f32)| -> Pos2 {
            let angle = (at as f32 / steps - 0.5) * std::f32::consts::PI;
            center + radius * value / peak * vec2(angle.sin(), angle.cos())
        };
        let points: Vec<Pos2> = values.iter().enumerate().map(point).collect();
        painter.add(eframe::egui::Shape::line(points, Stroke::new(1.5, *color)));
        let at = area.left_bottom() + vec2(6.0, -6.0 - 13.0 * k as f32);
        painter.text(at, Align2::LEFT_BOTTOM, *name, FontId::proportional(11.0), *color);
    }
}

/// Draws the parts of the light as a bar.
fn bar_ui(ui: &mut Ui, plot: &SlabPlot) {
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), BAR), Sense::hover());
    let painter = ui.painter_at(area);
    let mut left = area.left();
    let mut text = Vec::new();
    for ((name, part), color) in plot.parts.iter().zip(PARTS) {
        let width = area.width() * part.clamp(0.0, 1.0);
        let part_area = Rect::from_min_size(pos2(left, area.top()), vec2(width, BAR));
        painter.rect_filled(part_area, 0.0, color);
        left += width;
        text.push(format!("{name} {:.1} %", 100.0 * part));
    }
    let text = text.join(", ");
    response.on_hover_text(format!("Light at {:.0}°: {text}", plot.theta_deg));
    ui.small(text);
}
