//! The effects of the plan: state, reason, cost, and a switch that forces each one.

use crate::app::theme;
use crate::plan::{Effect, EffectKind, effect_names, switch_mut};
use crate::scene::{Scene, Switch};
use eframe::egui::{self, ComboBox, DragValue, Label, RichText, Ui};

use super::{AccuracyState, fields};

/// Draws the panel from the plan of the displayed image: light transport, and shortcuts that leave the light as it is.
pub fn ui(ui: &mut Ui, scene: &mut Scene, effects: &[Effect], state: &mut AccuracyState, version: u64) {
    let kind = |name: &str| effects.iter().find(|effect| effect.name == name).map(|effect| effect.kind);
    let is_physics = |name: &&str| kind(name).is_none_or(|kind| kind == EffectKind::Physics);
    let mut physics: Vec<&'static str> = effect_names().filter(is_physics).collect();
    // Effects that are left out come first.
    physics.sort_by_key(|name| !effects.iter().any(|effect| effect.name == *name && effect.left_out.is_some()));
    for name in physics {
        effect_ui(ui, scene, name, effects, state, version);
    }
    let shortcuts: Vec<&'static str> = effect_names().filter(|name| !is_physics(name)).collect();
    let on = effects.iter().filter(|effect| effect.on && shortcuts.contains(&effect.name)).count();
    let header = egui::CollapsingHeader::new(format!("Shortcuts, {on} on")).id_salt("shortcuts");
    header.show(ui, |ui| {
        for name in &shortcuts {
            effect_ui(ui, scene, name, effects, state, version);
        }
    });
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

/// Draws the switch of an effect, its reason and its measured cost.
fn effect_ui(
    ui: &mut Ui,
    scene: &mut Scene,
    name: &'static str,
    effects: &[Effect],
    state: &AccuracyState,
    version: u64,
) {
    let Some(switch) = switch_mut(&mut scene.effects, name) else { return };
    let planned = effects.iter().find(|effect| effect.name == name);
    fields::row(ui, &caption(name), "", |ui| {
        ComboBox::from_id_salt(name).selected_text(switch_label(*switch)).width(64.0).show_ui(ui, |ui| {
            for one in Switch::ALL {
                ui.selectable_value(switch, *one, switch_label(*one));
            }
        });
        match planned {
            Some(effect) if effect.left_out.is_some() => {
                ui.label(RichText::new("left out").color(theme::warning(ui.visuals())).strong());
            }
            Some(effect) => {
                ui.weak(effect_state(effect));
            }
            None => {}
        }
    });
    if let Some(effect) = planned {
        // The interface's fonts have no macron.
        let reason = effect.reason.replace("f̄", "the effective BRDF");
        ui.add(Label::new(RichText::new(reason).weak().small()).wrap());
    }
    let costs = state.costs.as_ref().filter(|(measured, _)| *measured == version);
    if let Some(cost) = costs.and_then(|(_, costs)| costs.iter().find(|cost| cost.name == name)) {
        let text = describe_cost(cost.on_ms - cost.off_ms, cost.mean_delta_e, cost.rel_l2);
        let tip = format!("On {:.1} ms, off {:.1} ms, from an edit to a small image", cost.on_ms, cost.off_ms);
        ui.add(Label::new(RichText::new(text).small()).wrap()).on_hover_text(tip);
    }
    ui.add_space(3.0);
}

/// Describes the cost of an effect and the change that it makes.
fn describe_cost(ms: f64, delta_e: f64, rel_l2: f64) -> String {
    format!("Measured: {ms:+.1} ms, mean ΔE {delta_e:.1}, changes the effective BRDF by {:.2} %", 100.0 * rel_l2)
}

fn effect_state(effect: &Effect) -> String {
    let ms = effect.measured_ms.or((effect.predicted_ms > 0.0 && effect.on).then_some(effect.predicted_ms));
    let on = if effect.on { "on" } else { "off" };
    match ms.filter(|_| effect.on) {
        Some(ms) => format!("{on}, {ms:.1} ms"),
        None => on.to_owned(),
    }
}

/// Returns the displayed name of an effect.
pub fn caption(name: &str) -> String {
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
