//! The panel of colour maps: layers of stops on drivers.

mod driver;
mod knots;
mod layer;
mod presets;
mod state;
mod stop_row;
mod stops_bar;

use crate::scene::{ColorLayer, ColorMap, Combine, GaussianSurface, Geometry, Scene};
use eframe::egui::{self, RichText, Slider, SliderClamping, Ui};

use super::fields::PanelContext;
use super::large_scale::edit;
use crate::app::views::zoom::TileScale;

#[cfg(test)]
pub use driver::initial;
pub use driver::{DriverPlace, set_image};
pub use state::ColorMapState;

/// Largest number of layers.
const MAX_LAYERS: usize = 16;

/// Draws the controls of the colour map, which a scene may have or not. Returns a request for the image of a driver.
pub fn ui(
    ui: &mut Ui,
    scene: &mut Scene,
    state: &mut ColorMapState,
    context: &mut PanelContext,
) -> Option<DriverPlace> {
    state.open = true;
    let mut has_map = scene.color_map.is_some();
    let tip = "Colours by a value: the height or slope of the surface, a noise or an image. They multiply the materials, and \
               are filtered, so that they are right at every distance.";
    if ui.checkbox(&mut has_map, "Colours by height, slope or noise").on_hover_text(tip).changed() {
        scene.color_map =
            has_map.then(|| ColorMap { layer: vec![layer::new("layer 1", has_relief(scene))], ..ColorMap::default() });
    }
    if scene.color_map.is_some() {
        zoom_ui(ui, scene, state.scale);
    }
    let relief = has_relief(scene);
    let map = scene.color_map.as_mut()?;
    if let Some(error) = &state.error {
        ui.colored_label(ui.visuals().error_fg_color, error);
    }
    let mut browse = None;
    let mut removed = None;
    let count = map.layer.len();
    for (at, layer) in map.layer.iter_mut().enumerate() {
        let title = if layer.name.is_empty() { format!("Layer {}", at + 1) } else { layer.name.clone() };
        let header =
            egui::CollapsingHeader::new(RichText::new(title).strong()).id_salt(("layer", at)).default_open(true);
        header.show(ui, |ui| {
            let place = layer::ui(ui, layer, map.combine == Combine::Sum, relief, state, context);
            browse = browse.or(place.map(|place| DriverPlace { layer: at, ..place }));
            let tip = "Remove this layer and its stops";
            if count > 1 && ui.button("Remove layer").on_hover_text(tip).clicked() {
                removed = Some(at);
            }
        });
    }
    if let Some(at) = removed {
        map.layer.remove(at);
    }
    if count < MAX_LAYERS && ui.button("Add a layer").on_hover_text("Add stops on another driver").clicked() {
        let name = (count + 1..).map(|k| format!("layer {k}")).find(|name| is_free(map, name));
        let mut added = layer::new(name.as_deref().unwrap_or_default(), relief);
        if count > 0 {
            // The same driver twice would only double the first layer.
            added.driver = driver::initial("noise", relief);
        }
        map.layer.push(added);
    }
    whole_map_ui(ui, map, context);
    browse
}

/// Draws the slider of the zoom, from a distance at which the colours are averaged to single creases.
fn zoom_ui(ui: &mut Ui, scene: &mut Scene, scale: Option<TileScale>) {
    let Some(scale) = scale else { return };
    let mut camera = scene.camera.clone().unwrap_or_default();
    let mut pixels = scale.pixels(&camera);
    let (least, most) = scale.range();
    let tip = "Zooms the view: size of a tile in pixels where the object is nearest. Every distance shows the mean of the \
               colours that a pixel holds.";
    let changed = super::fields::row(ui, "Pixels per tile", tip, |ui| {
        let slider = Slider::new(&mut pixels, least..=most).logarithmic(true).max_decimals(1);
        ui.add(slider.clamping(SliderClamping::Never)).changed()
    });
    if changed {
        scale.set(&mut camera, pixels);
        scene.camera = Some(camera);
    }
}

fn is_free(map: &ColorMap, name: &str) -> bool {
    map.layer.iter().all(|layer: &ColorLayer| layer.name != name)
}

/// Returns true if the surface has heights and slopes.
fn has_relief(scene: &Scene) -> bool {
    let stated = scene.color_map.as_ref().is_some_and(|map| map.surface.is_some());
    stated || !matches!(scene.tile.geometry, Geometry::Flat(_))
}

/// Draws the keys of the whole map.
fn whole_map_ui(ui: &mut Ui, map: &mut ColorMap, context: &mut PanelContext) {
    if map.layer.len() > 1 {
        let combine: Vec<_> = ColorMap::fields().into_iter().filter(|field| field.key == "combine").collect();
        edit(ui, map, &combine, &[], context);
    }
    egui::CollapsingHeader::new("Filtering").show(ui, |ui| {
        edit(ui, map, &ColorMap::fields(), &["layer", "surface", "combine"], context);
        let mut is_stated = map.surface.is_some();
        let tip = "Heights and slopes of a Gaussian surface in place of those of the tile.";
        if ui.checkbox(&mut is_stated, "Gaussian surface").on_hover_text(tip).changed() {
            map.surface = is_stated.then(Default::default);
        }
        if let Some(surface) = &mut map.surface {
            edit(ui, surface, &GaussianSurface::fields(), &[], context);
        }
    });
}
