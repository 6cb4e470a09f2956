//! Queries of `biscale filter`: the five headers, and their evaluation by each method.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::OnceLock;

use glam::{DMat2, DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::FilterMethod;
use super::eval::{POLAR_ANGLE, is_polar_angle};
use crate::base::csv::{CsvFile, CsvRow};
use crate::base::{Error, InputError, Result};
use crate::color_map::layers::Source;
use crate::color_map::slopes::direction;
use crate::color_map::statistics::{Footprint, HistogramMips};
use crate::color_map::{Normal, StopMap};
use crate::metrics::Pair;
use crate::pipeline::Pipeline;
use crate::pipeline::color_filter::{ColorFilter, is_place, is_slope};
use crate::reference::{Reference, ReferenceSettings, color_map as truth};
use crate::scene::LoadedScene;

/// Kind of the queries in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Normal,
    Exponent,
    View,
    Pair,
    Footprint,
}

/// Header of each kind, and the columns that results add.
const KINDS: [(Kind, &str, &str); 5] = [
    (Kind::Normal, "mean,deviation", "r,g,b"),
    (Kind::Exponent, "a", "mean,deviation,r,g,b"),
    (Kind::View, "theta_o,phi_o", "mean_x,mean_y,cov_xx,cov_xy,cov_yy,r,g,b"),
    (Kind::Pair, "theta_i,phi_i,theta_o,phi_o", "lambda_i,lambda_o,v_bar,r,g,b,f_r,f_g,f_b"),
    (Kind::Footprint, "u,v,width_u,width_v,angle", "mean,deviation,r,g,b"),
];

/// The queries of a file.
#[derive(Debug)]
pub struct Queries {
    kind: Kind,
    header: &'static str,
    results: &'static str,
    rows: Vec<Vec<f64>>,
}

/// Results of queries, in their order.
pub struct Results {
    pub rows: Vec<Vec<f64>>,
    with_error: bool,
}

impl Queries {
    /// Reads a CSV file; `-` is standard input.
    ///
    /// # Errors
    /// The file cannot be read, its header is none of the five, or a number is out of its range.
    pub fn read(path: &Path) -> Result<Self> {
        let headers = KINDS.map(|(_, header, _)| header).join("; ");
        let expected = format!("one of the headers {headers}");
        let file = CsvFile::read(path, &expected)?;
        let found = file.names().join(",");
        let &(kind, header, results) =
            KINDS.iter().find(|(_, header, _)| *header == found).ok_or_else(|| file.header_error(&expected))?;
        let row = |row: CsvRow<'_>| -> Result<Vec<f64>> {
            if row.len() != file.names().len() {
                return Err(row.length_error().into());
            }
            let number = |(column, name): (usize, &String)| {
                if matches!(name.as_str(), "deviation" | "a" | "width_u" | "width_v") {
                    row.number(column, "a number that is not negative", |value| value >= 0.0)
                } else if name.starts_with("theta") {
                    row.number(column, POLAR_ANGLE, is_polar_angle)
                } else {
                    row.number(column, "a number", |_| true)
                }
            };
            file.names().iter().enumerate().map(number).collect()
        };
        let rows = file.rows().map(row).collect::<Result<_>>()?;
        Ok(Self { kind, header, results, rows })
    }

    /// The file with its results.
    pub fn table(&self, results: &Results) -> String {
        let errors = if results.with_error { ",se_r,se_g,se_b" } else { "" };
        let mut text = format!("{},{}{errors}\n", self.header, self.results);
        for (query, result) in self.rows.iter().zip(&results.rows) {
            let cells: Vec<String> = query
                .iter()
                .map(f64::to_string)
                .chain(result.iter().map(|value| (*value as f32).to_string()))
                .collect();
            let _ = writeln!(text, "{}", cells.join(","));
        }
        text
    }

    fn pairs(&self) -> Vec<Pair> {
        let pair =
            |row: &Vec<f64>| Pair { i: direction(row[0], row[1]).as_vec3(), o: direction(row[2], row[3]).as_vec3() };
        self.rows.iter().map(pair).collect()
    }
}

/// A row of `before` and a colour.
fn row(before: &[f64], color: DVec3) -> Vec<f64> {
    before.iter().copied().chain(color.to_array()).collect()
}

/// The footprint of a query: widths of a box and its angle, in tile units, of a tile of this size.
fn footprint_of(query: &[f64], size: glam::Vec2) -> Footprint {
    let size = size.as_dvec2();
    let turn = DMat2::from_angle(query[4]);
    let widths = DMat2::from_diagonal(DVec2::new(query[2] * query[2], query[3] * query[3]) / 12.0);
    let scale = DMat2::from_diagonal(size.recip());
    Footprint {
        centre: DVec2::new(query[0], query[1]) / size,
        covariance: scale * turn * widths * turn.transpose() * scale,
    }
}

/// Evaluates queries.
///
/// # Errors
/// No layer fits the queries, or the errors of the pipeline.
pub fn evaluate(
    queries: &Queries,
    method: FilterMethod,
    layer: Option<&str>,
    filter: &ColorFilter,
    pipeline: &Pipeline,
    loaded: &LoadedScene,
) -> Result<Results> {
    let mut with_error = false;
    let layer_of = |wanted: &str, fits: &dyn Fn(&Source) -> bool| filter.layer(layer, wanted, fits);
    let rows = match queries.kind {
        Kind::Normal => {
            let index = layer_of("any driver", &|_| true)?;
            let stops = &filter.map.layers[index].mapped.stops;
            let mean = |query: &Vec<f64>| {
                let at = Normal { mean: query[0], deviation: query[1] };
                row(
                    &[],
                    match method {
                        FilterMethod::Filtered => filter.normal(index, &at),
                        FilterMethod::Naive => stops.color(at.mean),
                        FilterMethod::Truth => truth::normal_mean(stops, &at),
                    },
                )
            };
            queries.rows.par_iter().map(mean).collect()
        }
        Kind::Exponent => {
            let index = layer_of("any driver", &|_| true)?;
            let map = &filter.map.layers[index].mapped.map;
            let mean = |query: &Vec<f64>| {
                let (at, color) = match method {
                    FilterMethod::Filtered => filter.heights(index, query[0]),
                    FilterMethod::Naive => (Normal { mean: 0.0, deviation: 0.0 }, map.color(0.0)),
                    FilterMethod::Truth => truth::heights_mean(&noisy(filter, index), query[0]),
                };
                row(&[at.mean, at.deviation], color)
            };
            queries.rows.par_iter().map(mean).collect()
        }
        Kind::View => {
            let index = layer_of("slope or steepness", &is_slope)?;
            views(queries, method, index, filter, pipeline, loaded)?
        }
        Kind::Pair => pairs(queries, method, filter, pipeline, loaded)?,
        Kind::Footprint => {
            let index = layer_of("texture or noise", &is_place)?;
            with_error = method == FilterMethod::Truth;
            let size = loaded.scene.tile.size;
            let histograms = OnceLock::new();
            let of = |query: &Vec<f64>| footprint(filter, index, method, &histograms, &footprint_of(query, size));
            queries.rows.par_iter().map(of).collect()
        }
    };
    Ok(Results { rows, with_error })
}

/// The map of a layer with the noise on its heights.
fn noisy(filter: &ColorFilter, layer: usize) -> StopMap {
    let mapped = &filter.map.layers[layer].mapped;
    match mapped.driver.source {
        Source::Height { noise } if noise > 0.0 => mapped.map.blurred(noise),
        _ => mapped.map.clone(),
    }
}

fn footprint(
    filter: &ColorFilter,
    layer: usize,
    method: FilterMethod,
    histograms: &OnceLock<HistogramMips>,
    at: &Footprint,
) -> Vec<f64> {
    let mapped = &filter.map.layers[layer].mapped;
    let (Some((moments, color)), Source::Place(place)) = (filter.footprint(layer, at), &mapped.driver.source) else {
        return vec![0.0; 5];
    };
    match method {
        FilterMethod::Filtered => row(&[moments.mean, moments.deviation], color),
        FilterMethod::Naive => row(&[moments.mean, moments.deviation], mapped.stops.color(moments.mean)),
        FilterMethod::Truth => {
            let seed = at.centre.x.to_bits() ^ at.centre.y.to_bits().rotate_left(17);
            let exact = truth::footprint(&place.grid, histograms, &mapped.map, at, truth::QUERY_STRATA, seed);
            let moments = mapped.in_stop_unit(exact.moments);
            let mut cells = row(&[moments.mean, moments.deviation], exact.color);
            cells.extend(exact.standard_error.to_array());
            cells
        }
    }
}

fn views(
    queries: &Queries,
    method: FilterMethod,
    layer: usize,
    filter: &ColorFilter,
    pipeline: &Pipeline,
    loaded: &LoadedScene,
) -> Result<Vec<Vec<f64>>> {
    let mapped = &filter.map.layers[layer].mapped;
    let cells = |mean: DVec2, [xx, xy, yy]: [f64; 3], color: DVec3| row(&[mean.x, mean.y, xx, xy, yy], color);
    let relief = &filter.map.relief;
    if method == FilterMethod::Truth {
        if loaded.scene.color_map.as_ref().is_some_and(|map| map.surface.is_some()) {
            return Err(no_truth());
        }
        return pipeline.with_reference(loaded, |reference: &Reference<'_>| {
            let view = |query: &Vec<f64>| {
                let seen = reference.seen(None, direction(query[0], query[1]).as_vec3()).seen;
                let total: f64 = seen.iter().map(|facet| facet.2).sum::<f64>().max(f64::MIN_POSITIVE);
                let mean = seen.iter().map(|(s, _, w)| *s * *w).sum::<DVec2>() / total;
                let second =
                    |f: &dyn Fn(DVec2) -> f64| seen.iter().map(|(s, _, w)| f(*s - mean) * w).sum::<f64>() / total;
                let covariance = [second(&|d| d.x * d.x), second(&|d| d.x * d.y), second(&|d| d.y * d.y)];
                let color = |s: DVec2| {
                    let point = crate::color_map::layers::SurfacePoint { place: DVec2::ZERO, height: 0.0, slope: s };
                    mapped.map.color(mapped.driver.source.value(&point, relief))
                };
                let color = seen.iter().map(|(s, _, w)| color(*s) * *w).sum::<DVec3>() / total;
                cells(mean, covariance, color)
            };
            queries.rows.par_iter().map(view).collect()
        });
    }
    let view = |query: &Vec<f64>| {
        let (slopes, color) = filter.slopes(layer, direction(query[0], query[1]));
        match method {
            FilterMethod::Naive => cells(relief.slopes.mean, [0.0; 3], mapped.map.color(0.0)),
            _ => cells(slopes.mean, slopes.covariance, color),
        }
    };
    Ok(queries.rows.par_iter().map(view).collect())
}

/// The error of a truth that no surface gives.
fn no_truth() -> Error {
    let expected = "the heights of the tile: an analytic surface has no facets to cast rays at";
    InputError::new("color_map.surface", "an analytic surface with --method truth", expected).into()
}

/// The reference's colour of what is seen and lit, and `f̄` without interreflection, at pairs of directions: the ratio of
/// the reference with and without colours.
pub fn true_colors(
    pipeline: &Pipeline,
    loaded: &LoadedScene,
    pairs: &[Pair],
    facets: usize,
) -> Result<Vec<(DVec3, Vec3)>> {
    let settings = ReferenceSettings { facets, max_passes: 4, target: 0.0, seed: loaded.scene.quality.seed };
    let estimate = |reference: &Reference<'_>| reference.estimate(pairs, &settings, |_, _| true);
    let loaded = &loaded.without_interreflection();
    let colored = pipeline.with_reference(loaded, estimate)?;
    let mut white = loaded.clone();
    white.scene.color_map = None;
    let white = pipeline.with_reference(&white, estimate)?;
    let ratio = |(colored, white): (&crate::reference::Estimate, &crate::reference::Estimate)| {
        let divided = |a: f32, b: f32| if b > 0.0 { f64::from(a) / f64::from(b) } else { 0.0 };
        let (c, w) = (colored.f_bar, white.f_bar);
        (DVec3::new(divided(c.x, w.x), divided(c.y, w.y), divided(c.z, w.z)), c)
    };
    Ok(colored.iter().zip(&white).map(ratio).collect())
}

fn pairs(
    queries: &Queries,
    method: FilterMethod,
    filter: &ColorFilter,
    pipeline: &Pipeline,
    loaded: &LoadedScene,
) -> Result<Vec<Vec<f64>>> {
    let pairs = queries.pairs();
    let cells = |at: [f64; 3], color: DVec3, f: Vec3| {
        at.into_iter().chain(color.to_array()).chain(f.to_array().map(f64::from)).collect::<Vec<f64>>()
    };
    if method == FilterMethod::Truth {
        if loaded.scene.color_map.as_ref().is_some_and(|map| map.surface.is_some()) {
            return Err(no_truth());
        }
        let colors = true_colors(pipeline, loaded, &pairs, 24_576)?;
        return pipeline.with_reference(loaded, |reference| {
            let of = |(pair, (color, f)): (&Pair, &(DVec3, Vec3))| {
                let slopes = &filter.map.relief.slopes;
                let lit = reference.seen(Some(pair.i), pair.o).lit;
                cells([slopes.lambda(pair.i.as_dvec3()), slopes.lambda(pair.o.as_dvec3()), lit], *color, *f)
            };
            pairs.par_iter().zip(&colors).map(of).collect()
        });
    }
    let brdf = &filter.outcome.brdf;
    let of = |(query, pair): (&Vec<f64>, &Pair)| {
        let at = filter.pair(direction(query[0], query[1]), direction(query[2], query[3]));
        let numbers = [at.lambda_i, at.lambda_o, at.lit];
        let f = brdf.eval(pair.i, pair.o);
        match method {
            FilterMethod::Naive => cells(numbers, filter.naive(), f),
            _ => cells(numbers, at.color, f),
        }
    };
    Ok(queries.rows.par_iter().zip(&pairs).map(of).collect())
}

#[cfg(test)]
#[path = "filter_queries_tests.rs"]
mod tests;
