//! `biscale filter --side-by-side`: naive, truth and filtered beside each other, over ten times the differences.

use std::path::Path;
use std::time::Instant;

use glam::{DMat2, DVec2, DVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::filter_queries::true_colors;
use crate::base::{Error, Result};
use crate::color_map::layers::Source;
use crate::color_map::slopes::direction;
use crate::color_map::statistics::Footprint;
use crate::metrics::Pair;
use crate::pipeline::Pipeline;
use crate::pipeline::color_filter::{ColorFilter, is_place};
use crate::reference::color_map as truth;
use crate::render::image::tone_map::srgb_byte;
use crate::scene::LoadedScene;

/// Side of a panel [pixels], and of the disc of view directions, whose pixels are rays of the reference.
const SIDE: usize = 256;
const DISC: usize = 32;
/// Facets per pass of the disc's truth. They bound its time.
const DISC_FACETS: usize = 2048;
/// Width of the plane at its near edge, in tiles, and the ratio of the distances of its far and near edge.
const NEAR: f64 = 0.25;
const FAR: f64 = 64.0;
/// Directions of the disc stay this far from the horizon [rad].
const HIGHEST: f64 = 1.5;

/// One method of the comparison.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    pub method: &'static str,
    /// Root mean square difference from the truth over pixels and channels, linear RGB.
    pub rms: f64,
    pub mean: [f64; 3],
    pub ms: f64,
}

/// Three images of one size: naive, truth, filtered.
struct Panels {
    side: usize,
    images: [Vec<DVec3>; 3],
    ms: [f64; 3],
}

/// Writes the comparison. A scene with a layer of texture or noise shows a plane that runs to the horizon; any other
/// shows a disc of view directions under one light at 45 degrees.
///
/// # Errors
/// The image cannot be written, or the errors of the pipeline.
pub fn side_by_side(
    path: &Path,
    filter: &ColorFilter,
    pipeline: &Pipeline,
    loaded: &LoadedScene,
    layer: Option<&str>,
) -> Result<Vec<Comparison>> {
    let panels = match filter.layer(layer, "texture or noise", is_place) {
        Ok(layer) => plane(filter, layer),
        Err(_) => disc(filter, pipeline, loaded)?,
    };
    write(path, &panels)?;
    let names = ["naive", "truth", "filtered"];
    let [_, exact, _] = &panels.images;
    let of = |k: usize| {
        let image = &panels.images[k];
        let count = image.len() as f64;
        let square: f64 = image.iter().zip(exact).map(|(a, b)| (*a - *b).length_squared()).sum();
        let mean = image.iter().sum::<DVec3>() / count;
        Comparison { method: names[k], rms: (square / (3.0 * count)).sqrt(), mean: mean.to_array(), ms: panels.ms[k] }
    };
    Ok((0..3).map(of).collect())
}

fn timed(make: impl FnOnce() -> Vec<DVec3>) -> (Vec<DVec3>, f64) {
    let start = Instant::now();
    let image = make();
    (image, start.elapsed().as_secs_f64() * 1e3)
}

/// The plane, from near at the bottom to far at the top.
fn plane(filter: &ColorFilter, layer: usize) -> Panels {
    let footprint = |index: usize| {
        let (x, y) = ((index % SIDE) as f64 + 0.5, (SIDE - 1 - index / SIDE) as f64 + 0.5);
        let part = (1.0 - 1.0 / FAR) / SIDE as f64;
        let distance = 1.0 / (1.0 - part * y);
        let across = NEAR * distance / SIDE as f64;
        let along = NEAR * distance * distance * part;
        let centre = DVec2::new(NEAR * distance * (x / SIDE as f64 - 0.5), NEAR * distance);
        let covariance = DMat2::from_diagonal(DVec2::new(across * across, along * along) / 12.0);
        Footprint { centre, covariance }
    };
    let mapped = &filter.map.layers[layer].mapped;
    let image = |of: &(dyn Fn(&Footprint) -> DVec3 + Sync)| {
        timed(|| (0..SIDE * SIDE).into_par_iter().map(|index| of(&footprint(index))).collect())
    };
    // The first read computes the moments, which are not part of an image's time.
    let places = filter.place_map(layer);
    let naive = image(&|at| places.as_ref().map_or(DVec3::ZERO, |map| mapped.map.color(map.moments(at, 1).mean)));
    let histograms = std::sync::OnceLock::new();
    let exact = image(&|at| match &mapped.driver.source {
        Source::Place(place) => {
            truth::footprint(&place.grid, &histograms, &mapped.map, at, truth::IMAGE_STRATA, at.centre.x.to_bits())
                .color
        }
        _ => DVec3::ZERO,
    });
    let taps = filter.taps();
    let filtered = image(&|at| places.as_ref().map_or(DVec3::ZERO, |map| map.mean(at, taps)));
    Panels { side: SIDE, ms: [naive.1, exact.1, filtered.1], images: [naive.0, exact.0, filtered.0] }
}

/// View directions as a disc: the zenith in its middle, the horizon at its edge.
fn disc(filter: &ColorFilter, pipeline: &Pipeline, loaded: &LoadedScene) -> Result<Panels> {
    let light = direction(std::f64::consts::FRAC_PI_4, 0.0);
    let view = |index: usize| {
        let at = DVec2::new((index % DISC) as f64 + 0.5, (DISC - 1 - index / DISC) as f64 + 0.5);
        let at = at * (2.0 / DISC as f64) - 1.0;
        (at.length() <= 1.0).then(|| direction(at.length() * HIGHEST, at.y.atan2(at.x)))
    };
    let inside: Vec<(usize, DVec3)> = (0..DISC * DISC).filter_map(|index| Some((index, view(index)?))).collect();
    let pairs: Vec<Pair> = inside.iter().map(|(_, o)| Pair { i: light.as_vec3(), o: o.as_vec3() }).collect();
    let spread = |colors: Vec<DVec3>| {
        let mut image = vec![DVec3::ZERO; DISC * DISC];
        inside.iter().zip(colors).for_each(|((index, _), color)| image[*index] = color);
        image
    };
    let naive = timed(|| spread(vec![filter.naive(); inside.len()]));
    let start = Instant::now();
    let exact =
        spread(true_colors(pipeline, loaded, &pairs, DISC_FACETS)?.into_iter().map(|(color, _)| color).collect());
    let exact_ms = start.elapsed().as_secs_f64() * 1e3;
    let filtered = timed(|| spread(inside.par_iter().map(|(_, o)| filter.pair(light, *o).color).collect()));
    Ok(Panels { side: DISC, ms: [naive.1, exact_ms, filtered.1], images: [naive.0, exact, filtered.0] })
}

fn write(path: &Path, panels: &Panels) -> Result<()> {
    let scale = SIDE / panels.side;
    let [_, exact, _] = &panels.images;
    let pixel = |x: usize, y: usize| {
        let (panel, row) = (x / SIDE, y / SIDE);
        let index = y % SIDE / scale * panels.side + x % SIDE / scale;
        let color = panels.images[panel][index];
        let shown = if row == 0 { color } else { (color - exact[index]).abs() * 10.0 };
        shown.as_vec3().clamp(Vec3::ZERO, Vec3::ONE).to_array().map(srgb_byte)
    };
    let image =
        image::RgbImage::from_fn(3 * SIDE as u32, 2 * SIDE as u32, |x, y| image::Rgb(pixel(x as usize, y as usize)));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|error| Error::failed(format!("cannot encode {}: {error}", path.display())))?;
    crate::base::replace_file(path, bytes.get_ref())
}
