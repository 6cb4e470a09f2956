//! The effects of the plan: state, reason, cost, and a switch that forces each one.

use crate::plan::{Effect, effect_names, switch_mut};
use crate::scene::{Scene, Switch};
use eframe::egui::{self, ComboBox, DragValue, Ui};

use super::{AccuracyState, fields};

/// Draws the panel from the plan of the displayed image.
pub fn ui(ui: &mut Ui, scene: &mut Scene, effects: &[Effect], state: &mut AccuracyState, version: u64) {
    ui.weak("Effects that the plan chose. Each tooltip gives the reason.");
    for name in effect_names() {
        let Some(switch) = switch_mut(&mut scene.effects, name) else { continue };
        let planned = effects.iter().find(|effect| effect.name == name);
        let tip = planned.map_or(String::new(), |effect| effect.reason.clone());
        fields::row(ui, &caption(name), &tip, |ui| {
            ComboBox::from_id_salt(name).selected_text(switch_label(*switch)).width(64.0).show_ui(ui, |ui| {
                for one in Switch::ALL {
                    ui.selectable_value(switch, *one, switch_label(*one));
                }
            });
            if let Some(effect) = planned {
                ui.weak(effect_state(effect)).on_hover_text(tip.as_str());
            }
            let cost = state.costs.as_ref().filter(|(measured, _)| *measured == version);
            if let Some(cost) = cost.and_then(|(_, costs)| costs.iter().find(|cost| cost.name == name)) {
                ui.weak(format!("{:+.0} ms, ΔE {:.1}", cost.on_ms - cost.off_ms, cost.mean_delta_e)).on_hover_text(
                    format!(
                        "On {:.1} ms, off {:.1} ms, from an edit to a small image. It changes f̄ by {:.2} %",
                        cost.on_ms,
                        cost.off_ms,
                        cost.rel_l2 * 100.0
                    ),
                );
            }
        });
    }
    ui.horizontal(|ui| {
        let measure = ui.add_enabled(!state.measuring, egui::Button::new("Measure each"));
        if measure
            .on_hover_text("Forces each effect on and off. Shows milliseconds and the mean colour difference")
            .clicked()
        {
            state.measuring = true;
        }
        if state.measuring {
            ui.spinner();
        }
    });
    if scene.effects.interreflection == Switch::On {
        fields::row(ui, "Bounces", "Maximum number of reflections between facets", |ui| {
            ui.add(DragValue::new(&mut scene.effects.bounces).range(1..=64));
        });
    }
    egui::CollapsingHeader::new("All decisions").show(ui, |ui| {
        for effect in effects {
            ui.label(format!("{}: {}", caption(effect.name), effect_state(effect)));
            ui.weak(&effect.reason);
        }
    });
    if !scene.effects.is_default() && ui.button("As planned").on_hover_text("Forces no effect").clicked() {
        scene.effects = Default::default();
    }
}

fn effect_state(effect: &Effect) -> String {
    let ms = effect.measured_ms.or((effect.predicted_ms > 0.0 && effect.on).then_some(effect.predicted_ms));
    let on = if effect.on { "on" } else { "off" };
    match ms.filter(|_| effect.on) {
        Some(ms) => format!("{on}, {ms:.1} ms"),
        None => on.to_owned(),
    }
}

fn caption(name: &str) -> String {
    let mut letters = name.replace('_', " ").replace("color", "colour").chars().collect::<Vec<_>>();
    if let Some(first) = letters.first_mut() {
        *first = first.to_ascii_uppercase();
    }
    letters.into_iter().collect()
}

fn switch_label(switch: Switch) -> &'static str {
    match switch {
        Switch::Auto => "Auto",
        Switch::On => "On",
        Switch::Off => "Off",
    }
}
