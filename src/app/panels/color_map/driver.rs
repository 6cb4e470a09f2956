//! The driver of a layer: its kind, its keys, and the terms of a sum.

use crate::app::panels::controls;
use crate::app::panels::fields::{self, PanelContext};
use crate::scene::{
    Driver, DriverSum, HeightDriver, Kind, LayerWeight, NoiseDriver, Scene, SlopeAlong, Steepness, TextureDriver,
    WeightedDriver,
};
use eframe::egui::{DragValue, Ui};
use std::path::PathBuf;
use toml::Table;

/// Largest number of terms of a sum.
const MAX_TERMS: usize = 8;

/// A driver in a scene's colour map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriverPlace {
    pub layer: usize,
    /// The driver of the layer's weight.
    pub of_weight: bool,
    /// The term of a sum.
    pub term: Option<usize>,
}

/// Draws the controls of a driver. `has_relief` is false if the surface has no heights and slopes. Returns true if the user
/// requests an image; for a term of a sum, with its index.
pub fn ui(
    ui: &mut Ui,
    caption: &str,
    driver: &mut Driver,
    has_relief: bool,
    context: &mut PanelContext,
) -> Option<Option<usize>> {
    let mut browse = one_ui(ui, caption, driver, &offered(Driver::kinds(), has_relief, driver), has_relief, context);
    let Driver::Sum(sum) = driver else { return browse };
    let mut removed = None;
    let count = sum.terms.len();
    for (at, term) in sum.terms.iter_mut().enumerate() {
        ui.push_id(("term", at), |ui| {
            let kinds = offered(Driver::linear_kinds(), has_relief, &term.driver);
            let caption = format!("Term {}", at + 1);
            if one_ui(ui, &caption, &mut term.driver, &kinds, has_relief, context).is_some() {
                browse = Some(Some(at));
            }
            fields::row(ui, "Term's weight", "Factor on the driver, which counts in its standard deviations.", |ui| {
                ui.add(DragValue::new(&mut term.weight).range(-1e3..=1e3).speed(0.01).max_decimals(3));
                let removes = ui.add_enabled_ui(count > 1, |ui| ui.small_button("×").on_hover_text("Remove this term"));
                if removes.inner.clicked() {
                    removed = Some(at);
                }
            });
        });
    }
    if let Some(at) = removed {
        sum.terms.remove(at);
    }
    if count < MAX_TERMS && ui.button("Add a term").on_hover_text("Add another driver to the sum").clicked() {
        let driver = Driver::Noise(NoiseDriver { seed: count as u64 + 1, ..NoiseDriver::default() });
        sum.terms.push(WeightedDriver { driver, weight: 0.5 });
    }
    browse
}

/// The kinds that a surface allows, and the present one.
fn offered(kinds: Vec<Kind>, has_relief: bool, now: &Driver) -> Vec<Kind> {
    let needs_relief = |kind: &Kind| matches!(kind.kind, "height" | "slope" | "steepness");
    kinds.into_iter().filter(|kind| has_relief || kind.kind == now.kind() || !needs_relief(kind)).collect()
}

/// Draws the kind of a driver and its keys, but no terms. Returns a request for an image.
fn one_ui(
    ui: &mut Ui,
    caption: &str,
    driver: &mut Driver,
    kinds: &[Kind],
    has_relief: bool,
    context: &mut PanelContext,
) -> Option<Option<usize>> {
    let now = driver.kind();
    let kind = kinds.iter().find(|kind| kind.kind == now)?;
    let chosen = fields::row(ui, caption, kind.doc, |ui| controls::kind_ui(ui, caption, now, kinds));
    match chosen {
        // A texture needs an image first.
        Some("texture") => return Some(None),
        Some(kind) => {
            *driver = initial(kind, has_relief);
            return None;
        }
        None => {}
    }
    let Ok(mut table) = Table::try_from(&*driver) else { return None };
    let before = table.clone();
    let mut inside = PanelContext { unit: context.unit.clone(), ..PanelContext::default() };
    fields::table_ui(ui, &mut table, &kind.fields, &["terms"], &mut inside);
    context.error = context.error.take().or(inside.error);
    if table != before
        && let Ok(changed) = table.try_into::<Driver>()
    {
        *driver = within_cells(changed);
    }
    inside.browse.map(|_| None)
}

/// A driver with initial keys.
pub fn initial(kind: &str, has_relief: bool) -> Driver {
    match kind {
        "height" => Driver::Height(HeightDriver::default()),
        "slope" => Driver::Slope(SlopeAlong::default()),
        "steepness" => Driver::Steepness(Steepness::default()),
        "sum" => {
            let first = if has_relief { initial("height", true) } else { initial("noise", false) };
            let second = Driver::Noise(NoiseDriver { seed: 2, ..NoiseDriver::default() });
            let term = |driver, weight| WeightedDriver { driver, weight };
            Driver::Sum(DriverSum { terms: vec![term(first, 1.0), term(second, 0.5)] })
        }
        _ => Driver::Noise(NoiseDriver::default()),
    }
}

/// Sets the image of a driver of a scene's colour map. A driver of another kind becomes a texture.
pub fn set_image(scene: &mut Scene, place: DriverPlace, path: PathBuf) {
    let Some(layer) = scene.color_map.as_mut().and_then(|map| map.layer.get_mut(place.layer)) else { return };
    let of_layer = match &mut layer.weight {
        LayerWeight::Blend(blend) if place.of_weight => &mut blend.driver,
        _ => &mut layer.driver,
    };
    let target = match (of_layer, place.term) {
        (Driver::Sum(sum), Some(term)) => sum.terms.get_mut(term).map(|term| &mut term.driver),
        (driver, _) => Some(driver),
    };
    match target {
        Some(Driver::Texture(texture)) => texture.path = path,
        Some(other) => *other = Driver::Texture(TextureDriver { path, ..TextureDriver::default() }),
        None => {}
    }
}

/// Limits the octaves to those whose cells the noise resolves.
fn within_cells(mut driver: Driver) -> Driver {
    if let Driver::Noise(noise) = &mut driver {
        let most = crate::scene::MAX_CELLS;
        noise.cells = noise.cells.clamp(1, most);
        noise.octaves = noise.octaves.clamp(1, (most / noise.cells).ilog2() + 1);
    }
    driver
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_octaves_of_a_noise_end_where_its_cells_are_finest() {
        let noise = |cells, octaves| {
            let driver = Driver::Noise(NoiseDriver { cells, octaves, ..NoiseDriver::default() });
            let Driver::Noise(limited) = within_cells(driver) else { panic!() };
            (limited.cells, limited.octaves)
        };
        assert_eq!(noise(8, 8), (8, 5));
        assert_eq!(noise(128, 2), (128, 1));
        assert_eq!(noise(100, 1), (100, 1));
    }

    #[test]
    fn every_kind_but_a_texture_starts_as_itself_and_a_flat_tile_offers_no_heights() {
        for kind in Driver::kinds().iter().filter(|kind| kind.kind != "texture") {
            assert_eq!(initial(kind.kind, true).kind(), kind.kind);
        }
        assert!(!initial("sum", false).is_of_surface());
        let names: Vec<&str> =
            offered(Driver::kinds(), false, &initial("noise", false)).iter().map(|kind| kind.kind).collect();
        assert_eq!(names, ["texture", "noise", "sum"]);
    }
}
