//! Plots of the light that a slab transmits: over the disc, in the plane of incidence, and its parts.

use std::path::PathBuf;
use std::sync::Arc;

use crate::math::directions::to_angles;
use crate::scene::{LoadedScene, Painted, Quality, SlabSpec, Tile};
use eframe::egui::{self, Align2, Color32, FontId, Pos2, Rect, Sense, Stroke, TextureHandle, Ui, Vec2, pos2, vec2};
use glam::Vec3;

use super::lobe;
use crate::app::worker::{LobeCurve, SlabLobe, SlabLobeJob, SlabLobeResult};

/// Height of the energy bar, of the line below the plots and of the legends [points].
const BAR: f32 = 16.0;
/// Height of everything around the two plots [points].
pub const AROUND: f32 = 150.0;
/// Colours of the curves and their names, on dark and on light ground.
const CURVES: [Color32; 3] =
    [Color32::from_rgb(255, 170, 60), Color32::from_rgb(90, 180, 255), Color32::from_rgb(150, 220, 120)];
const CURVES_ON_LIGHT: [Color32; 3] =
    [Color32::from_rgb(164, 84, 0), Color32::from_rgb(16, 92, 180), Color32::from_rgb(40, 108, 20)];
/// Colours of the parts of the light.
const PARTS: [Color32; 5] = [
    Color32::from_rgb(90, 180, 255),
    Color32::from_rgb(150, 110, 220),
    Color32::from_rgb(240, 215, 110),
    Color32::from_rgb(225, 120, 90),
    Color32::from_rgb(110, 110, 110),
];

/// Inputs of the plots besides the light.
type Key = (SlabSpec, Tile, Quality, PathBuf, Painted);

/// State of the plots between frames.
#[derive(Default)]
pub struct SlabLobeState {
    pub shown: Option<Box<SlabLobe>>,
    pub error: Option<String>,
    texture: Option<TextureHandle>,
    /// Document version, light and scale that were examined last.
    examined: Option<(u64, Vec3, bool)>,
    requested: Option<(Box<Key>, Vec3, bool)>,
}

impl SlabLobeState {
    /// Returns the job for the plots of a scene with a slab, unless it is the last request.
    pub fn job(&mut self, version: u64, loaded: &Arc<LoadedScene>, light: Vec3, log: bool) -> Option<SlabLobeJob> {
        let scene = &loaded.scene;
        let Some(slab) = &scene.slab else {
            (self.shown, self.requested) = (None, None);
            return None;
        };
        if self.examined == Some((version, light, log)) {
            return None;
        }
        self.examined = Some((version, light, log));
        let (tile, quality) = (scene.tile.clone(), scene.quality.clone());
        let key = Box::new((slab.clone(), tile, quality, loaded.base_dir.clone(), loaded.painted.clone()));
        let wanted = (key, light, log);
        if self.requested.as_ref() == Some(&wanted) {
            return None;
        }
        self.requested = Some(wanted);
        Some(SlabLobeJob { loaded: loaded.clone(), light, log })
    }

    pub fn receive(&mut self, ctx: &egui::Context, result: SlabLobeResult) {
        match result {
            SlabLobeResult::Lobe(lobe) => {
                let options = egui::TextureOptions::LINEAR;
                match &mut self.texture {
                    Some(texture) => texture.set(lobe.disc.clone(), options),
                    None => self.texture = Some(ctx.load_texture("slab lobe", lobe.disc.clone(), options)),
                }
                (self.shown, self.error) = (Some(lobe), None);
            }
            // The image reports the same error as a message.
            SlabLobeResult::Failed(text) => (self.shown, self.error) = (None, Some(text)),
        }
    }

    /// Drops what belongs to the old window.
    pub fn move_to(&mut self) {
        (self.texture, self.requested, self.examined) = (None, None, None);
    }

    /// Draws the plots. The user drags the light on the disc.
    pub fn ui(&mut self, ui: &mut Ui, light: &mut Vec3, log: &mut bool) {
        let (theta, phi) = to_angles(*light);
        ui.horizontal(|ui| {
            ui.strong("Transmission");
            ui.weak(format!("light {:.0}° / {:.0}°", theta.to_degrees(), phi.to_degrees()))
                .on_hover_text("Polar angle and azimuth");
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.toggle_value(log, "Log").on_hover_text("Logarithmic scale of the disc over three decades");
            });
        });
        let width = ui.available_width();
        let side = (0.5 * (width - 8.0)).min(ui.available_height() - AROUND + 44.0).max(60.0);
        ui.horizontal(|ui| {
            let tip = "Light that leaves below the slab by its direction, seen from above. Drag the light.";
            let named = ("Transmitted lobe", tip);
            lobe::disc_ui(ui, side, self.texture.as_ref(), light, None, named);
            self.polar_ui(ui, vec2(width - side - 8.0, side));
        });
        if let Some(error) = &self.error {
            ui.colored_label(ui.visuals().error_fg_color, error);
        }
        if let Some(shown) = &self.shown {
            energy_ui(ui, shown);
            truth_ui(ui, shown);
        }
    }

    /// Draws the curves below the slab, which is a line. The light arrives from the upper left.
    fn polar_ui(&self, ui: &mut Ui, size: Vec2) {
        let (area, response) = ui.allocate_exact_size(size, Sense::hover());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Lobe in the plane of incidence"));
        response.on_hover_text(
            "BTDF in the plane of incidence, by the angle of the viewer below the slab. Eq. 11: the dual-microfacet model. \
             Faces: a sum over facets. Reference: photons, with a band of one standard error that narrows over time. Straight \
             light is left out.",
        );
        let painter = ui.painter().with_clip_rect(area);
        let radius = (0.5 * area.width() - 4.0).min(area.height() - 40.0).max(10.0);
        let origin = pos2(area.center().x, area.bottom() - radius - 6.0);
        let grid = Stroke::new(1.0, ui.visuals().widgets.noninteractive.bg_stroke.color);
        for part in [0.5, 1.0] {
            let arc = (0..=48).map(|k| below(origin, radius * part, k as f32 * 3.75 - 90.0)).collect();
            painter.add(egui::Shape::line(arc, grid));
        }
        for angle in [-60.0, -30.0, 0.0, 30.0, 60.0] {
            painter.line_segment([origin, below(origin, radius, angle)], grid);
        }
        let face = Stroke::new(2.0, ui.visuals().weak_text_color());
        painter.line_segment([origin - vec2(radius, 0.0), origin + vec2(radius, 0.0)], face);
        let Some(shown) = &self.shown else { return };
        let theta = to_angles(shown.light).0.to_degrees();
        let ray = lobe::on_arc(origin, 30.0, -theta);
        painter.line_segment([origin, ray], Stroke::new(1.0, Color32::from_rgb(255, 205, 90)));
        lobe::sun(ui, ray);
        // The noise of the first photons must not shrink the models.
        let of_models = shown.curves.iter().filter(|curve| curve.errors.is_none()).flat_map(|curve| &curve.values);
        let peak = 1.05 * of_models.fold(f32::MIN_POSITIVE, |peak, value| peak.max(*value));
        let colors = if ui.visuals().dark_mode { CURVES } else { CURVES_ON_LIGHT };
        for (k, (curve, color)) in shown.curves.iter().zip(colors).enumerate() {
            draw_curve(&painter, curve, origin, radius / peak, color);
            let at = area.left_top() + vec2(2.0, 13.0 * k as f32);
            painter.text(at, Align2::LEFT_TOP, curve.name, FontId::proportional(10.5), color);
        }
    }
}

/// Draws a curve, with a band of its standard errors.
fn draw_curve(painter: &egui::Painter, curve: &LobeCurve, origin: Pos2, scale: f32, color: Color32) {
    let steps = (curve.values.len().max(2) - 1) as f32;
    let point = |step: usize, value: f32| below(origin, scale * value.max(0.0), (step as f32 / steps - 0.5) * 180.0);
    if let Some(errors) = &curve.errors {
        // A mesh, because the smooth edges of polygons would be wider than a narrow band.
        let mut band = egui::Mesh::default();
        for (k, error) in errors.iter().enumerate() {
            for sign in [-1.0, 1.0] {
                band.colored_vertex(point(k, curve.values[k] + sign * error), color.gamma_multiply(0.35));
            }
            let Some(first) = (2 * k as u32).checked_sub(2) else { continue };
            band.add_triangle(first, first + 1, first + 2);
            band.add_triangle(first + 1, first + 2, first + 3);
        }
        painter.add(band);
    }
    let line = curve.values.iter().enumerate().map(|(k, value)| point(k, *value)).collect();
    painter.add(egui::Shape::line(line, Stroke::new(1.5, color)));
}

/// Returns a point on an arc below `origin`. 0° is down, and positive angles are to the right.
fn below(origin: Pos2, radius: f32, degrees: f32) -> Pos2 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    origin + vec2(sin, cos) * radius
}

/// Draws the parts of the light as a bar with a legend.
fn energy_ui(ui: &mut Ui, shown: &SlabLobe) {
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), BAR), Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Energy bar"));
    let painter = ui.painter().with_clip_rect(area);
    let total: f32 = shown.parts.iter().map(|(_, part)| part).sum();
    let mut left = area.left();
    for ((_, part), color) in shown.parts.iter().zip(PARTS) {
        let width = area.width() * part / total.max(1e-6);
        painter.rect_filled(Rect::from_min_size(pos2(left, area.top()), vec2(width, BAR)), 0.0, color);
        left += width;
    }
    response.on_hover_text(
        "Parts of the light. Through: refracted once at each face. Bounced: transmitted after reflections inside. Straight: \
         passed without a change of direction. Reflected: back to the side of the light. The last part is absorbed; left out \
         if Bounces is off, with the light that is reflected inside; or not captured for a captured sheet.",
    );
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        for ((name, part), color) in shown.parts.iter().zip(PARTS).filter(|((_, part), _)| *part >= 5e-4) {
            let (square, _) = ui.allocate_exact_size(vec2(8.0, 8.0), Sense::hover());
            ui.painter().rect_filled(square, 2.0, color);
            ui.small(format!("{name} {:.1} %", 100.0 * part));
        }
    });
}

/// Describes the photons and the errors of the models.
fn truth_ui(ui: &mut Ui, shown: &SlabLobe) {
    let Some(truth) = &shown.truth else { return };
    let models: Vec<String> =
        truth.models.iter().map(|(name, error)| format!("{name} off by {:.1} %", 100.0 * error)).collect();
    let text = format!(
        "{}, {:.1} M photons, noise {:.1} %",
        models.join(", "),
        truth.photons as f64 / 1e6,
        100.0 * truth.noise
    );
    ui.small(text).on_hover_text(format!(
        "Relative L2 over solid angle up to 85° against photons. They transmit {:.2} ± {:.2} % of the light.",
        100.0 * truth.transmitted[0],
        100.0 * truth.transmitted[1]
    ));
}
