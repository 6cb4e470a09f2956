//! The effects of the plan: state, reason, cost, and a switch that forces each one.

use crate::app::theme;
use crate::base::capitalized;
use crate::plan::{Effect, EffectKind, effect_names, switch_mut};
use crate::report::EffectCost;
use crate::scene::{Scene, Switch};
use eframe::egui::{self, Color32, ComboBox, DragValue, Label, RichText, Ui};

use super::accuracy_chart::milliseconds;
use super::{AccuracyState, fields};
use crate::app::views::spinner::spinner;

/// Rows of text that stay free for what shortcuts save; the text is small.
const SAVINGS_ROWS: f32 = 1.8;

/// Draws the panel from the plan of the displayed image: light transport, and shortcuts that leave the light as it is.
pub fn ui(ui: &mut Ui, scene: &mut Scene, effects: &[Effect], state: &mut AccuracyState, version: u64) {
    let kind = |name: &str| effects.iter().find(|effect| effect.name == name).map(|effect| effect.kind);
    let is_physics = |name: &&str| kind(name).is_none_or(|kind| kind == EffectKind::Physics);
    let mut physics: Vec<&'static str> = effect_names().filter(is_physics).collect();
    // Effects that are left out come first.
    physics.sort_by_key(|name| !effects.iter().any(|effect| effect.name == *name && effect.left_out.is_some()));
    for name in physics {
        let is_left_out = effects.iter().any(|effect| effect.name == name && effect.left_out.is_some());
        let fill = if is_left_out { theme::warning(ui.visuals()).gamma_multiply(0.18) } else { Color32::TRANSPARENT };
        egui::Frame::new().fill(fill).corner_radius(4.0).show(ui, |ui| {
            effect_ui(ui, scene, name, effects, state, version);
        });
    }
    let shortcuts: Vec<&'static str> = effect_names().filter(|name| !is_physics(name)).collect();
    let on = effects.iter().filter(|effect| effect.on && shortcuts.contains(&effect.name)).count();
    let header = egui::CollapsingHeader::new(format!("Shortcuts: {on} on")).id_salt("shortcuts");
    header.show(ui, |ui| {
        for name in &shortcuts {
            effect_ui(ui, scene, name, effects, state, version);
        }
    });
    if state.measuring || state.costs_of(version).is_some() {
        let text = state.costs_of(version).map_or_else(String::new, |costs| savings(effects, &shortcuts, costs));
        fields::reserved(ui, SAVINGS_ROWS, |ui| ui.add(Label::new(RichText::new(text).weak().small()).wrap()));
    }
    measure_ui(ui, state);
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

/// Draws the button that measures each effect, or what is being measured.
fn measure_ui(ui: &mut Ui, state: &mut AccuracyState) {
    ui.horizontal(|ui| {
        if !state.measuring {
            let tip = "Forces each effect on and off in three runs. Shows the milliseconds with their standard error, and the \
                       mean colour difference";
            state.measuring = ui.button("Measure each").on_hover_text(tip).clicked();
            return;
        }
        if ui.button("Cancel").on_hover_text("Stop measuring the effects").clicked() {
            state.measuring = false;
        }
        spinner(ui, 13.0, ui.visuals().strong_text_color());
        ui.add(Label::new(RichText::new(state.activity.as_deref().unwrap_or("Waiting for the image")).weak()).truncate());
    });
}

/// Describes what the shortcuts that are on save, and the largest change of the effective BRDF by one of them.
fn savings(effects: &[Effect], shortcuts: &[&'static str], costs: &[EffectCost]) -> String {
    let is_on = |cost: &&EffectCost| {
        shortcuts.contains(&cost.name) && effects.iter().any(|effect| effect.on && effect.name == cost.name)
    };
    let (saved, change) = costs
        .iter()
        .filter(is_on)
        .fold((0.0, 0.0), |(saved, change), cost| (saved + cost.off_ms - cost.on_ms, f64::max(change, cost.rel_l2)));
    format!("They save {}, and change the effective BRDF by at most {:.1} %", milliseconds(saved), 100.0 * change)
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
    let costs = state.costs_of(version);
    if let Some(cost) = costs.and_then(|costs| costs.iter().find(|cost| cost.name == name)) {
        let tip = format!(
            "On {:.1} ms, off {:.1} ms, from an edit to a small image. It changes the effective BRDF by {:.2} % (relative \
             L2), and the image by a mean ΔE of {:.1}",
            cost.on_ms,
            cost.off_ms,
            100.0 * cost.rel_l2,
            cost.mean_delta_e
        );
        ui.add(Label::new(RichText::new(describe_cost(cost)).small()).wrap()).on_hover_text(tip);
    } else if state.measuring {
        // The row of the result is there from the beginning, so that nothing moves when it arrives.
        ui.add(Label::new(RichText::new("not measured yet").weak().small()));
    }
    ui.add_space(3.0);
}

/// Describes the cost of an effect and the change that it makes.
fn describe_cost(cost: &EffectCost) -> String {
    let (ms, error) = (cost.on_ms - cost.off_ms, cost.std_error_ms);
    let time = match error {
        Some(error) if ms.abs() < error => format!("within noise (± {error:.1} ms)"),
        Some(error) => format!("{ms:+.1} ± {error:.1} ms"),
        None => format!("{ms:+.1} ms"),
    };
    format!("{time}, ΔE {:.1}", cost.mean_delta_e)
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
    capitalized(&name.replace('_', " ").replace("color", "colour"))
}

fn switch_label(switch: Switch) -> &'static str {
    match switch {
        Switch::Auto => "Auto",
        Switch::On => "On",
        Switch::Off => "Off",
    }
}
