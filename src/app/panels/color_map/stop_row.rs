//! The selected stop of a colour bar: value, colours, jump, removal.

use crate::app::panels::fields;
use crate::scene::{GradientStop, MAX_COLOR, StopUnit};
use eframe::egui::{DragValue, Ui};
use glam::Vec3;

use super::knots;
use super::stops_bar::BarInputs;

/// Suffix of values in a unit of stops.
pub fn suffix(unit: StopUnit) -> &'static str {
    match unit {
        StopUnit::Deviation => " σ",
        StopUnit::Value => "",
    }
}

/// Draws the controls of the selected knot. Values keep the distance `gap` from those of other knots.
pub fn ui(ui: &mut Ui, stops: &mut Vec<GradientStop>, selected: &mut usize, inputs: &BarInputs<'_>, gap: f64) {
    let all = knots::knots(stops);
    let Some(range) = all.get(*selected).cloned() else { return };
    let tip = match inputs.unit {
        StopUnit::Deviation => "The selected stop: its value in deviations σ from the driver's mean, and its colour.",
        StopUnit::Value => "The selected stop: its value in the driver's own unit, and its colour.",
    };
    fields::row(ui, "Selected stop", tip, |ui| {
        // All controls of a jump fit into the narrowest panel.
        ui.spacing_mut().item_spacing.x = 3.0;
        ui.spacing_mut().interact_size.x = 24.0;
        let mut value = stops[range.start].value;
        let drag = DragValue::new(&mut value).speed(2.0 * gap).max_decimals(4).suffix(suffix(inputs.unit));
        if ui.add(drag).changed() {
            knots::move_knot(stops, *selected, value, gap);
        }
        color_ui(ui, &mut stops[range.start].color, inputs.are_weights);
        if range.len() > 1 {
            color_ui(ui, &mut stops[range.end - 1].color, inputs.are_weights);
        }
        let mut jump = range.len() > 1;
        let tip = "Two colours meet at this value without a transition: the left one below it, the right one above it.";
        if ui.checkbox(&mut jump, "Jump").on_hover_text(tip).changed() {
            knots::set_jump(stops, *selected, jump);
        }
        let removable = ui.add_enabled_ui(all.len() > 1, |ui| ui.small_button("×").on_hover_text("Remove this stop"));
        if removable.inner.clicked() && knots::remove_knot(stops, *selected) {
            *selected = selected.saturating_sub(1);
        }
    });
}

/// Draws a colour, or a weight as a number. A colour brighter than 1 keeps its brightness as a factor.
fn color_ui(ui: &mut Ui, color: &mut Vec3, is_weight: bool) {
    if is_weight {
        let mut weight = color.x;
        let drag = DragValue::new(&mut weight).range(0.0..=MAX_COLOR).speed(0.005).max_decimals(3);
        if ui.add(drag).on_hover_text("Weight").changed() && weight.is_finite() {
            *color = Vec3::splat(weight);
        }
        return;
    }
    let gain = color.max_element().max(1.0);
    let mut shown = (*color / gain).to_array();
    if ui.color_edit_button_rgb(&mut shown).on_hover_text("Linear RGB").changed() {
        *color = Vec3::from_array(shown) * gain;
    }
}
