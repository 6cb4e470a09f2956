//! One layer of a colour map: name, driver, stops and weight.

use crate::app::panels::fields::{self, PanelContext};
use crate::color_map::Normal;
use crate::scene::{Blend, ColorLayer, GradientStop, LayerWeight, StopUnit};
use eframe::egui::{self, DragValue, Ui};
use glam::Vec3;
use toml::Table;

use super::driver::{self, DriverPlace};
use super::presets::PRESETS;
use super::state::ColorMapState;
use super::stops_bar::{self, BarInputs};

/// Part of a deviation to which converted values are rounded.
const DIGITS: f64 = 1e-4;

/// A layer with the first preset, on the height of the surface if it has one.
pub fn new(name: &str, has_relief: bool) -> ColorLayer {
    ColorLayer {
        name: name.to_owned(),
        driver: driver::initial(if has_relief { "height" } else { "noise" }, has_relief),
        unit: StopUnit::Deviation,
        stops: PRESETS[0].stops(),
        weight: LayerWeight::Number(1.0),
    }
}

/// Draws a layer. `has_weight` is true if layers are added. Returns a request for the image of a driver.
pub fn ui(
    ui: &mut Ui,
    layer: &mut ColorLayer,
    has_weight: bool,
    has_relief: bool,
    state: &ColorMapState,
    context: &mut PanelContext,
) -> Option<DriverPlace> {
    let place = |of_weight| move |term| DriverPlace { layer: 0, of_weight, term };
    let mut browse = driver::ui(ui, "Driver", &mut layer.driver, has_relief, context).map(place(false));
    let inputs = BarInputs { unit: layer.unit, values: state.values_of(&layer.driver), are_weights: false };
    stops_bar::ui(ui, &mut layer.stops, &inputs);
    preset_ui(ui, layer);
    let unit = layer.unit;
    keys_ui(ui, layer, context);
    if layer.unit != unit
        && let Some(values) = state.values_of(&layer.driver)
    {
        in_unit(&mut layer.stops, layer.unit, values.unit);
    }
    if has_weight {
        let found = ui.push_id("weight", |ui| weight_ui(ui, &mut layer.weight, has_relief, state, context)).inner;
        browse = browse.or(found.map(place(true)));
    }
    browse
}

/// Draws the list of preset maps, and applies the chosen one.
fn preset_ui(ui: &mut Ui, layer: &mut ColorLayer) {
    fields::row(ui, "Preset map", "Replaces the stops of this layer.", |ui| {
        let now = PRESETS.iter().find(|preset| layer.unit == StopUnit::Deviation && preset.stops() == layer.stops);
        let combo = egui::ComboBox::from_id_salt("preset").selected_text(now.map_or("Own stops", |preset| preset.name));
        combo.width((ui.available_width() - 30.0).min(200.0)).height(400.0).show_ui(ui, |ui| {
            for preset in &PRESETS {
                let is_now = now.is_some_and(|now| now.name == preset.name);
                if ui.selectable_label(is_now, preset.name).on_hover_text(preset.doc).clicked() {
                    (layer.stops, layer.unit) = (preset.stops(), StopUnit::Deviation);
                }
            }
        });
    });
}

/// Draws name and unit of the stops from the catalogue.
fn keys_ui(ui: &mut Ui, layer: &mut ColorLayer, context: &mut PanelContext) {
    let Ok(mut table) = Table::try_from(&*layer) else { return };
    table.entry("name").or_insert_with(|| toml::Value::String(String::new()));
    let before = table.clone();
    fields::table_ui(ui, &mut table, &ColorLayer::fields(), &["driver", "stops", "weight"], context);
    if table != before
        && let Ok(changed) = table.try_into::<ColorLayer>()
    {
        *layer = changed;
    }
}

/// Converts the values of stops to another unit, so that they colour the same points. `driver` is the driver's mean and
/// deviation.
fn in_unit(stops: &mut [GradientStop], unit: StopUnit, driver: Normal) {
    let Normal { mean, deviation } = driver;
    // A driver that does not vary has no deviations to count in.
    if deviation.is_nan() || deviation <= 0.0 {
        return;
    }
    for stop in stops {
        stop.value = match unit {
            StopUnit::Value => stops_bar::round(mean + deviation * stop.value, DIGITS * deviation),
            StopUnit::Deviation => stops_bar::round((stop.value - mean) / deviation, DIGITS),
        };
    }
}

/// Draws the weight: a number, or stops on a driver of its own.
fn weight_ui(
    ui: &mut Ui,
    weight: &mut LayerWeight,
    has_relief: bool,
    state: &ColorMapState,
    context: &mut PanelContext,
) -> Option<Option<usize>> {
    let doc = "Factor of this layer in the sum of layers.";
    let mut is_blend = matches!(weight, LayerWeight::Blend(_));
    fields::row(ui, "Weight", doc, |ui| {
        if let LayerWeight::Number(number) = weight {
            ui.add(DragValue::new(number).range(0.0..=crate::scene::MAX_COLOR).speed(0.01).max_decimals(3));
        }
        let tip = "The weight changes with a driver of its own: layers blend by height, slope or noise.";
        if ui.checkbox(&mut is_blend, "By a driver").on_hover_text(tip).changed() {
            *weight = if is_blend { LayerWeight::Blend(first_blend()) } else { LayerWeight::Number(1.0) };
        }
    });
    let LayerWeight::Blend(blend) = weight else { return None };
    let browse = driver::ui(ui, "Weight by", &mut blend.driver, has_relief, context);
    let inputs = BarInputs { unit: blend.unit, values: state.values_of(&blend.driver), are_weights: true };
    stops_bar::ui(ui, &mut blend.stops, &inputs);
    browse
}

/// A weight that rises with a noise, which no other driver depends on.
fn first_blend() -> Blend {
    let stop = |value, weight| GradientStop { value, color: Vec3::splat(weight) };
    let noise = crate::scene::NoiseDriver { seed: 3, ..Default::default() };
    let driver = crate::scene::Driver::Noise(noise);
    Blend { driver, unit: StopUnit::Deviation, stops: vec![stop(-0.5, 0.0), stop(0.5, 1.0)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_unit_keeps_the_points_that_stops_colour() {
        let driver = Normal { mean: 0.3, deviation: 0.2 };
        let mut stops = PRESETS[0].stops();
        let before = stops.clone();
        in_unit(&mut stops, StopUnit::Value, driver);
        assert!((stops[0].value - (0.3 - 1.2 * 0.2)).abs() < 1e-4, "{}", stops[0].value);
        in_unit(&mut stops, StopUnit::Deviation, driver);
        assert!(stops.iter().zip(&before).all(|(a, b)| (a.value - b.value).abs() < 2e-3));
        let kept = stops.clone();
        in_unit(&mut stops, StopUnit::Value, Normal { mean: 0.3, deviation: 0.0 });
        assert_eq!(stops, kept);
    }
}
