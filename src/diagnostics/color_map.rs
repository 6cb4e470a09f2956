//! Weaknesses of colour maps on places of the tile: drivers far from normal, and single reads.

use crate::color_map::layers::{LayeredMap, Source};
use crate::scene::Gaussianize;

/// Largest error of the mean colour of a driver whose values are not ranked.
const MAX_FAR_ERROR: f64 = 0.01;

/// Warnings about the layers of a map whose drivers are textures or noise, each with a remedy.
pub fn warnings(map: &LayeredMap) -> Vec<String> {
    let mut warnings = Vec::new();
    for (index, layer) in map.layers.iter().enumerate() {
        let Source::Place(place) = &layer.mapped.driver.source else { continue };
        let name = if layer.name.is_empty() { (index + 1).to_string() } else { format!("`{}`", layer.name) };
        let stops = &layer.mapped.map;
        if map.gaussianize == Gaussianize::Off {
            let error = (stops.mean(&place.mips().whole()) - place.plain_mean(stops)).abs().max_element();
            if error > MAX_FAR_ERROR {
                warnings.push(format!(
                    "the driver of layer {name} is far from normal: its mean colour is wrong by {error:.3}; set \
                     gaussianize = \"auto\""
                ));
            }
        }
        if map.taps == 1 {
            warnings.push(format!(
                "one read of layer {name} is wrong by up to 0.06 where a pixel is as wide as its structure; set taps = 4 \
                 or 16"
            ));
        }
    }
    warnings
}
