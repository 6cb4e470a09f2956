//! Weaknesses of colour maps: drivers far from Gaussian, single reads, and colours that are finer than facets.

use glam::{DVec3, Vec2};

use crate::color_map::layers::{LayeredMap, Source};
use crate::geometry::Facets;
use crate::geometry::facets::kd_tree::KdTree;
use crate::scene::Gaussianize;

/// Largest error of the mean colour of a driver whose values are not ranked.
const MAX_FAR_ERROR: f64 = 0.01;

/// Largest part of the colours' variance between neighbouring facets. It is 1 if neighbours know nothing of each other: the
/// facets are then random samples of the map.
const MAX_BETWEEN: f64 = 0.5;
/// Fewest facets with neighbours, and the most that are compared with theirs.
const FEWEST_FACETS: usize = 64;
const MOST_COMPARED: usize = 1024;

/// A warning if the colours of a map change from facet to facet. `size` is that of the tile.
pub fn finer_than_facets(facets: &Facets, size: Vec2) -> Option<String> {
    let between = variance_between(facets, size).filter(|between| *between > MAX_BETWEEN)?;
    Some(format!(
        "the colours of the map are finer than the facets: {:.0} % of their variance lies between neighbouring facets; set \
         quality.facets = {} or a finer preset",
        100.0 * between.min(1.0),
        4 * facets.len()
    ))
}

/// The part of the variance of colours that lies between a facet and its neighbour; `None` if the facets are no samples,
/// are few, or have one colour.
fn variance_between(facets: &Facets, size: Vec2) -> Option<f64> {
    if facets.len() < FEWEST_FACETS || facets.replicates.is_empty() {
        return None;
    }
    let stride = facets.len().div_ceil(MOST_COMPARED).max(4);
    let (compared, others): (Vec<usize>, Vec<usize>) = (0..facets.len()).partition(|k| k.is_multiple_of(stride));
    let color = |k: usize| facets.colors[k].as_dvec3();
    let mean = compared.iter().map(|k| color(*k)).sum::<DVec3>() / compared.len() as f64;
    let tree = KdTree::new(&others.iter().map(|k| facets.positions[*k]).collect::<Vec<_>>(), size);
    let (mut whole, mut between) = (0.0, 0.0);
    for k in compared {
        let neighbour = others[tree.nearest(facets.positions[k])? as usize];
        whole += (color(k) - mean).length_squared();
        between += 0.5 * (color(k) - color(neighbour)).length_squared();
    }
    (whole > 0.0).then(|| between / whole)
}

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
                    "the driver of layer {name} is far from Gaussian: its mean colour is wrong by {error:.3}; set \
                     gaussianize = \"auto\""
                ));
            }
        }
        if map.taps == 1 {
            warnings.push(format!(
                "one read of layer {name} is wrong by up to 0.06 where a pixel is as wide as the structure of the \
                 texture or noise; set taps = 4 or 16"
            ));
        }
    }
    warnings
}
