//! Plots of f̄ for one light: all viewers on a disc, and a polar plot in the plane of light and normal.

use std::sync::Arc;

use crate::effective::EffectiveBrdf;
use crate::math::directions::{from_angles, to_angles};
use eframe::egui::{self, Align2, Color32, FontId, Pos2, Rect, Sense, Stroke, TextureHandle, Ui, pos2, vec2};
use glam::Vec3;

use crate::app::worker::{LobeJob, LobePlot, logarithmic};

/// State of the view between frames.
pub struct LobeState {
    /// Direction to the light, in the tile frame.
    pub light: Vec3,
    pub viewer: Option<Vec3>,
    pub log: bool,
    texture: Option<TextureHandle>,
    plot: Option<Box<LobePlot>>,
    /// BRDF, light, viewer and scale of the last request.
    requested: Option<(*const EffectiveBrdf, Vec3, Option<Vec3>, bool)>,
    /// The plot of the last request is complete.
    is_complete: bool,
}

impl Default for LobeState {
    fn default() -> Self {
        Self {
            light: from_angles(40f32.to_radians(), std::f32::consts::PI),
            viewer: None,
            log: false,
            texture: None,
            plot: None,
            requested: None,
            is_complete: false,
        }
    }
}

impl LobeState {
    /// Returns the job for the plot to display, unless it is the last request.
    pub fn job(&mut self, brdf: &Arc<EffectiveBrdf>) -> Option<LobeJob> {
        let wanted = (Arc::as_ptr(brdf), self.light, self.viewer, self.log);
        if self.requested == Some(wanted) {
            return None;
        }
        (self.requested, self.is_complete) = (Some(wanted), false);
        Some(LobeJob { brdf: brdf.clone(), light: self.light, viewer: self.viewer, log: self.log })
    }

    /// Forgets a plot that is not complete, so that it is requested again. Returns true if there is one.
    pub fn interrupt(&mut self) -> bool {
        let is_running = self.requested.is_some() && !self.is_complete;
        if is_running {
            self.requested = None;
        }
        is_running
    }

    pub fn receive(&mut self, ctx: &egui::Context, plot: Box<LobePlot>) {
        self.is_complete = plot.is_complete;
        let options = egui::TextureOptions::LINEAR;
        match &mut self.texture {
            Some(texture) => texture.set(plot.image.clone(), options),
            None => self.texture = Some(ctx.load_texture("lobe", plot.image.clone(), options)),
        }
        self.plot = Some(plot);
    }

    /// Drops what belongs to the old window, so that the new window loads it again.
    pub fn move_to(&mut self) {
        (self.texture, self.requested) = (None, None);
    }

    pub fn ui(&mut self, ui: &mut Ui) {
        let (theta, phi) = to_angles(self.light);
        ui.horizontal(|ui| {
            ui.strong("Reflection");
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.toggle_value(&mut self.log, "Log").on_hover_text("Logarithmic scale over three decades");
                ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                    let text = format!("light {:.0}° / {:.0}°", theta.to_degrees(), phi.to_degrees());
                    let label = egui::Label::new(egui::RichText::new(text).weak()).truncate();
                    ui.add(label).on_hover_text("Polar angle and azimuth");
                });
            });
        });
        let width = ui.available_width();
        let side = (0.5 * (width - 8.0)).min(ui.available_height() - 24.0).max(60.0);
        ui.horizontal(|ui| {
            let tip = "All view directions above the surface, projected onto the disc. Drag the light.";
            let named = ("Lobe view", tip);
            disc_ui(ui, side, self.texture.as_ref(), &mut self.light, self.viewer, named);
            self.polar_ui(ui, vec2(width - side - 8.0, side));
        });
        if let Some(plot) = &self.plot {
            let caption = match (plot.value, self.viewer) {
                (Some(value), Some(viewer)) => {
                    let (theta, phi) = to_angles(viewer);
                    format!(
                        "{:.3} {:.3} {:.3} /sr towards {:.0}° / {:.0}°",
                        value.x,
                        value.y,
                        value.z,
                        theta.to_degrees(),
                        phi.to_degrees()
                    )
                }
                _ => format!("peak {:.3} /sr. Drag the light on the disc", plot.max),
            };
            ui.small(caption);
        }
    }

    fn polar_ui(&self, ui: &mut Ui, size: egui::Vec2) {
        let (area, response) = ui.allocate_exact_size(size, Sense::hover());
        let painter = ui.painter().with_clip_rect(area);
        let radius = (0.5 * area.width() - 6.0).min(area.height() - 22.0).max(10.0);
        // The caption below the plot stays inside of a low area.
        let origin = pos2(area.center().x, (area.center().y + 0.5 * radius).min(area.bottom() - 18.0));
        let grid = Stroke::new(1.0, ui.visuals().widgets.noninteractive.bg_stroke.color);
        for part in [0.5, 1.0] {
            let arc: Vec<Pos2> = (0..=48).map(|k| on_arc(origin, radius * part, k as f32 * 3.75 - 90.0)).collect();
            painter.add(egui::Shape::line(arc, grid));
        }
        for angle in [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0] {
            painter.line_segment([origin, on_arc(origin, radius, angle)], grid);
        }
        let Some(plot) = &self.plot else { return };
        let scaled = |value: Vec3| if self.log { logarithmic(value / plot.max) } else { value / plot.max };
        let dark = ui.visuals().dark_mode;
        let colors = if dark {
            [Color32::from_rgb(255, 96, 88), Color32::from_rgb(96, 214, 112), Color32::from_rgb(104, 152, 255)]
        } else {
            [Color32::from_rgb(200, 40, 32), Color32::from_rgb(24, 140, 48), Color32::from_rgb(40, 80, 220)]
        };
        for (channel, color) in colors.into_iter().enumerate() {
            let at = |(k, value): (usize, &Vec3)| on_arc(origin, radius * scaled(*value)[channel], k as f32 - 90.0);
            let line: Vec<Pos2> = plot.cut.iter().enumerate().map(at).collect();
            painter.add(egui::Shape::line(line, Stroke::new(1.6, color)));
        }
        let light = to_angles(plot.light).0.to_degrees();
        let tip = on_arc(origin, radius, -light);
        painter.line_segment([origin, tip], Stroke::new(1.0, Color32::from_rgb(255, 205, 90)));
        sun(ui, tip);
        let text = ui.visuals().weak_text_color();
        painter.text(
            origin + vec2(0.0, 11.0),
            Align2::CENTER_CENTER,
            "plane of light and normal",
            FontId::proportional(9.0),
            text,
        );
        response
            .on_hover_text("Reflection by the viewer's angle in the plane of light and normal, in red, green and blue");
    }
}

/// Draws a plot over the directions of a hemisphere, on which the user drags the light. `named` is its name and tooltip.
pub(super) fn disc_ui(
    ui: &mut Ui,
    side: f32,
    texture: Option<&TextureHandle>,
    light: &mut Vec3,
    viewer: Option<Vec3>,
    named: (&str, &str),
) {
    let (area, response) = ui.allocate_exact_size(vec2(side, side), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, named.0));
    let (center, radius) = (area.center(), 0.5 * side - 1.0);
    ui.painter().circle_filled(center, radius, Color32::from_gray(12));
    if let Some(texture) = texture {
        let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().image(texture.id(), Rect::from_center_size(center, vec2(2.0, 2.0) * radius), uv, Color32::WHITE);
    }
    ui.painter().circle_stroke(center, radius, Stroke::new(1.0, Color32::from_gray(110)));
    let on_disc = |direction: Vec3| center + vec2(direction.x, -direction.y) * radius;
    if let Some(viewer) = viewer {
        ui.painter().circle_stroke(on_disc(viewer), 5.0, Stroke::new(1.5, Color32::from_rgb(110, 190, 255)));
    }
    sun(ui, on_disc(*light));
    if let Some(at) = response.interact_pointer_pos() {
        let offset = glam::Vec2::new(at.x - center.x, center.y - at.y) / radius;
        let inside = offset.clamp_length_max(0.995);
        *light = inside.extend((1.0 - inside.length_squared()).max(0.0).sqrt());
    }
    response.on_hover_text(named.1);
}

/// Returns a point on an arc about `origin`. 0° is up, and positive angles are to the right.
pub(super) fn on_arc(origin: Pos2, radius: f32, degrees: f32) -> Pos2 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    origin + vec2(sin, -cos) * radius
}

/// Draws the mark of the light.
pub(super) fn sun(ui: &Ui, at: Pos2) {
    ui.painter().circle_filled(at, 4.5, Color32::from_rgb(255, 205, 90));
    ui.painter().circle_stroke(at, 4.5, Stroke::new(1.0, Color32::from_black_alpha(160)));
}
