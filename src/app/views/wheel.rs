//! Something is being computed: a wheel that turns in steps. A frame a step is what software Vulkan can draw while the processor
//! is at work; egui's own turns with every frame there can be.

use eframe::egui::{self, Color32, Ui, vec2};

/// Seconds a step, steps a turn.
const STEP: f64 = 0.25;
const STEPS: f64 = 8.0;

/// A wheel of this many points.
pub fn wheel(ui: &mut Ui, size: f32, color: Color32) {
    let (area, response) = ui.allocate_exact_size(vec2(size, size), egui::Sense::hover());
    response.widget_info(|| egui::WidgetInfo::new(egui::Role::ProgressIndicator));
    let now = ui.input(|input| input.time);
    let step = (now / STEP).floor();
    ui.ctx().request_repaint_after_secs(((step + 1.0) * STEP - now) as f32 + 0.005);
    let turned = (step / STEPS).fract() as f32 * std::f32::consts::TAU;
    let radius = 0.5 * size - 2.0;
    let points = (0..=20).map(|k| area.center() + radius * egui::Vec2::angled(turned + 0.2 * k as f32)).collect();
    ui.painter().line(points, egui::Stroke::new(0.12 * size.min(24.0), color));
}
