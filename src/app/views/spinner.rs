//! A spinner that turns in steps. One frame per step leaves the CPU to the workers if software Vulkan draws the window.
//! The spinner of egui repaints at every frame.

use eframe::egui::{self, Color32, Ui, vec2};

/// Seconds per step.
const STEP: f64 = 0.25;
/// Steps per turn.
const STEPS: f64 = 8.0;

/// Draws a spinner of `size` points.
pub fn spinner(ui: &mut Ui, size: f32, color: Color32) {
    let (area, response) = ui.allocate_exact_size(vec2(size, size), egui::Sense::hover());
    response.widget_info(|| egui::WidgetInfo::new(egui::Role::ProgressIndicator));
    let now = ui.input(|input| input.time);
    let step = (now / STEP).floor();
    ui.ctx().request_repaint_after_secs(((step + 1.0) * STEP - now) as f32 + 0.005);
    let angle = (step / STEPS).fract() as f32 * std::f32::consts::TAU;
    let radius = 0.5 * size - 2.0;
    let points = (0..=20).map(|k| area.center() + radius * egui::Vec2::angled(angle + 0.2 * k as f32)).collect();
    ui.painter().line(points, egui::Stroke::new(0.12 * size.min(24.0), color));
}
