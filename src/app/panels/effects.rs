//! Every effect of the plan: on or off, why, what it takes; and a switch to force it.

use crate::plan::Effect;
use crate::report::switches;
use crate::scene::{Scene, Switch};
use eframe::egui::{self, ComboBox, DragValue, Ui};

use super::{AccuracyState, fields};

/// The panel, from the plan of the picture that is shown.
pub fn ui(ui: &mut Ui, scene: &mut Scene, effects: &[Effect], state: &mut AccuracyState, version: u64) {
    ui.weak("What this scene calls for. The reason is under the pointer.");
    for (name, switch) in switches(&mut scene.effects) {
        let planned = effects.iter().find(|effect| effect.name == name);
        let tip = planned.map_or(String::new(), |effect| effect.reason.clone());
        fields::row(ui, &caption(name), &tip, |ui| {
            ComboBox::from_id_salt(name).selected_text(words(*switch)).width(64.0).show_ui(ui, |ui| {
                for one in Switch::ALL {
                    ui.selectable_value(switch, *one, words(*one));
                }
            });
            if let Some(effect) = planned {
                ui.weak(words_of(effect)).on_hover_text(tip.as_str());
            }
            let cost = state.costs.as_ref().filter(|(measured, _)| *measured == version);
            if let Some(cost) = cost.and_then(|(_, costs)| costs.iter().find(|cost| cost.name == name)) {
                ui.weak(format!("{:+.0} ms, ΔE {:.1}", cost.on_ms - cost.off_ms, cost.mean_delta_e)).on_hover_text(
                    format!(
                        "On {:.1} ms, off {:.1} ms, from an edit to a small picture; it changes f̄ by {:.2} %",
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
        if measure.on_hover_text("Forces each effect on and off: milliseconds, and what it changes").clicked() {
            state.measuring = true;
        }
        if state.measuring {
            ui.spinner();
        }
    });
    if scene.effects.interreflection == Switch::On {
        fields::row(ui, "Bounces", "Reflections between facets that are followed", |ui| {
            ui.add(DragValue::new(&mut scene.effects.bounces).range(1..=64));
        });
    }
    egui::CollapsingHeader::new("All decisions").show(ui, |ui| {
        for effect in effects {
            ui.label(format!("{}: {}", caption(effect.name), words_of(effect)));
            ui.weak(&effect.reason);
        }
    });
    if !scene.effects.is_default() && ui.button("As planned").on_hover_text("Forces nothing").clicked() {
        scene.effects = Default::default();
    }
}

fn words_of(effect: &Effect) -> String {
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

fn words(switch: Switch) -> &'static str {
    match switch {
        Switch::Auto => "Auto",
        Switch::On => "On",
        Switch::Off => "Off",
    }
}
