//! Accuracy against time: a slider over quality levels, targets, a chart of the open scene, and a comparison with a reference.

use crate::plan::{Effect, Settings};
use crate::scene::Scene;
use crate::tuning::quality_scale;
use eframe::egui::{self, Label, Slider, Ui, vec2};

use super::accuracy::{AccuracyState, describe_point, take, take_level};
use super::{TargetState, accuracy_chart, fields, targets};
use crate::app::views::spinner::spinner;
use crate::app::worker::AccuracyPoint;

/// Rows of text that stay free for errors and time of the scene's settings.
const CURRENT_ROWS: f32 = 2.0;
/// Side of the difference image [points].
const DIFFERENCE_SIDE: f32 = 220.0;

/// Draws the panel. The slider, a point of the chart and a found target change the scene's settings. `file` is the path or
/// the name by which the command line opens the scene. Rows that depend on measurements keep their place.
pub fn ui(
    ui: &mut Ui,
    scene: &mut Scene,
    (state, targets): (&mut AccuracyState, &mut TargetState),
    effects: &[Effect],
    (version, file): (u64, &str),
) {
    state.open = true;
    let settings = Settings::of(scene);
    let mut level = quality_scale::level_of_facets(settings.facets);
    let tip = "Quality levels: each balances the numbers of facets and of directions. Finer takes longer.";
    let changed = fields::row(ui, "Faster - finer", tip, |ui| {
        ui.spacing_mut().slider_width = (ui.available_width() - 12.0).max(60.0);
        ui.add(Slider::new(&mut level, 0.0..=quality_scale::FINEST).show_value(false)).changed()
    });
    if changed {
        take_level(scene, level, effects);
    }
    targets::ui(ui, scene, targets, file);
    ui.add_space(4.0);
    let current = state.now(version);
    let text = current.map_or_else(|| format!("{} facets", settings.facets), |point| describe_point(&point));
    fields::reserved(ui, CURRENT_ROWS, |ui| ui.label(text));
    let is_stale = !state.levels.is_empty() && !state.is_fresh(version);
    fields::reserved(ui, 1.0, |ui| advice_ui(ui, scene, state, effects, (version, is_stale)));
    // A level with the settings of the scene would be a second point for them, which another time moved.
    let is_other = |level: &&AccuracyPoint| current.is_none_or(|current| !current.is_same(level));
    let levels: Vec<AccuracyPoint> = state.levels.iter().filter(is_other).copied().collect();
    if let Some(point) = accuracy_chart::ui(ui, &levels, current.as_ref(), is_stale) {
        take(scene, point.facets, effects);
    }
    ui.horizontal(|ui| {
        ui.toggle_value(&mut state.comparing, "Compare with reference").on_hover_text(
            "Refines a reference in the background. The error bars narrow, and an image shows the difference",
        );
        if let Some(activity) = state.activity.as_ref().filter(|_| !state.measuring) {
            spinner(ui, 13.0, ui.visuals().strong_text_color());
            ui.add(Label::new(egui::RichText::new(activity).weak()).truncate());
        }
    });
    if state.comparing {
        comparison_ui(ui, state, version);
    }
    if let Some(error) = &state.error {
        ui.colored_label(ui.visuals().error_fg_color, error);
    }
}

/// Offers settings that are finer and faster, or notes that the chart is from before an edit.
fn advice_ui(
    ui: &mut Ui,
    scene: &mut Scene,
    state: &AccuracyState,
    effects: &[Effect],
    (version, is_stale): (u64, bool),
) {
    if is_stale {
        ui.weak("The grey curve is from before the edit.");
    }
    let Some(better) = state.better(version) else { return };
    ui.horizontal_wrapped(|ui| {
        let (psnr, ms) = (better.compared.psnr_db, accuracy_chart::milliseconds(better.ms));
        ui.label(format!("Finer and faster exists: {psnr:.0} dB in {ms}."));
        if ui.button("Use").on_hover_text(describe_point(&better)).clicked() {
            take(scene, better.facets, effects);
        }
    });
}

/// Draws the difference from the reference, in a place that is free until it arrives.
fn comparison_ui(ui: &mut Ui, state: &mut AccuracyState, version: u64) {
    let measured = state.now(version).filter(|point| !point.compared.is_stated());
    let text = measured.map_or_else(String::new, |point| {
        let (error, passes) = (point.compared.std_error * 100.0, 4 * point.compared.batches);
        format!("Standard error of the reference: {error:.2} % after {passes} passes")
    });
    fields::reserved(ui, CURRENT_ROWS, |ui| ui.weak(text));
    let side = ui.available_width().min(DIFFERENCE_SIDE);
    let mut large = state.large;
    let height = side + ui.spacing().item_spacing.y;
    ui.scope(|ui| {
        ui.set_min_size(vec2(ui.available_width(), height));
        match state.shown_difference(version) {
            Some(shown) => {
                let image = egui::Image::new(&shown.texture).fit_to_exact_size(vec2(side, side));
                ui.add(image.alt_text("Difference image"));
            }
            None => {
                ui.weak("The difference appears once the reference has two samples.");
            }
        }
    });
    let Some(shown) = state.shown_difference(version) else { return };
    ui.weak(format!("{}. White is ΔE 10. ΔE 2 is just visible.", shown.caption));
    ui.toggle_value(&mut large, "Show large")
        .on_hover_text("Show the difference in the object's view, with its colours");
    state.large = large;
}
