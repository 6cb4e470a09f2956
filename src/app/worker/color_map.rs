//! Values of the drivers of a colour map: over the whole tile, and where a picked viewer sees them.

use std::sync::Arc;

use crate::base::{Cancel, Error, Result};
use crate::color_map::layers::{LayeredMap, ResolvedDriver, Source};
use crate::color_map::slopes::SlopeDriver;
use crate::color_map::{Distribution, Normal, normal};
use crate::geometry::relief::surface_point;
use crate::geometry::{ColorField, Facets, TileMesh};
use crate::pipeline::Pipeline;
use crate::plan::Preset;
use crate::scene::{Driver, GaussianSurface, LoadedScene};
use glam::{DVec3, Vec3};

use super::gpu_drafts::as_preset;
use super::runner::JobContext;

/// Bins of a histogram over [`REACH`] deviations on both sides of the mean.
pub const BINS: usize = 48;
pub const REACH: f64 = 4.0;
/// Facets from which the histograms of heights and slopes are taken, and most samples of a texture or noise.
const FACETS: usize = 8192;
const SAMPLES: usize = 1 << 16;

/// A colour map whose drivers are measured.
#[derive(Debug, Clone)]
pub struct ColorMapJob {
    pub loaded: Arc<LoadedScene>,
    /// Directions to the light and to the viewer at the picked point, in the tile frame.
    pub picked: Option<(Vec3, Vec3)>,
}

/// The values of one driver.
#[derive(Debug, Clone, PartialEq)]
pub struct DriverValues {
    pub driver: Driver,
    /// Mean and deviation in the driver's own unit.
    pub unit: Normal,
    /// Parts of the values in each bin, on the whole tile.
    pub whole: Vec<f32>,
    /// Parts of the values that are visible and lit at the picked directions. Absent for drivers of the place, of which a
    /// distant viewer sees all values.
    pub seen: Option<Vec<f32>>,
}

/// A report of the worker.
#[derive(Debug, Clone)]
pub enum ColorMapResult {
    Values(Vec<DriverValues>),
    Failed(String),
}

pub fn work(
    pipeline: &mut Pipeline,
    job: &ColorMapJob,
    context: &JobContext<ColorMapJob>,
    report: &dyn Fn(ColorMapResult),
) {
    pipeline.set_cancel(context.cancel.clone());
    match measure(pipeline, job, context.cancel, report) {
        Ok(()) | Err(Error::Cancelled) => {}
        Err(error) => report(ColorMapResult::Failed(error.to_string())),
    }
}

fn measure(pipeline: &Pipeline, job: &ColorMapJob, cancel: &Cancel, report: &dyn Fn(ColorMapResult)) -> Result<()> {
    let loaded = as_preset(&job.loaded, Preset::Draft);
    let Some(spec) = &loaded.scene.color_map else { return Ok(()) };
    let mesh = pipeline.mesh(&loaded)?;
    let ColorField::Mapped { map, .. } = &mesh.color else { return Ok(()) };
    let facets = Facets::sample(&mesh, FACETS, loaded.scene.quality.seed);
    let surface = spec.surface.as_ref();
    let mut values: Vec<DriverValues> = Vec::new();
    for driver in resolved_drivers(map) {
        let whole = on_tile(driver, map, (&mesh, &facets), surface);
        values.push(DriverValues { driver: driver.spec.clone(), unit: driver.unit, whole, seen: None });
    }
    report(ColorMapResult::Values(values.clone()));
    let Some((light, viewer)) = job.picked.filter(|_| map.is_of_surface()) else { return Ok(()) };
    cancel.check()?;
    let filter = pipeline.color_filter(&loaded)?;
    let edges: Vec<f64> = (0..=BINS).map(edge).collect();
    for (driver, values) in resolved_drivers(&filter.map).into_iter().zip(&mut values) {
        if driver.spec.is_of_surface() {
            let tails = filter.tails(driver, light.as_dvec3(), viewer.as_dvec3(), &edges, cancel);
            cancel.check()?;
            values.seen = Some(tails.windows(2).map(|pair| (pair[0] - pair[1]).max(0.0) as f32).collect());
        }
    }
    report(ColorMapResult::Values(values));
    Ok(())
}

/// The drivers of layers and of their weights, each once.
fn resolved_drivers(map: &LayeredMap) -> Vec<&ResolvedDriver> {
    let mut found: Vec<&ResolvedDriver> = Vec::new();
    for mapped in map.layers.iter().flat_map(|layer| std::iter::once(&layer.mapped).chain(&layer.blend)) {
        if found.iter().all(|driver| driver.spec != mapped.driver.spec) {
            found.push(&mapped.driver);
        }
    }
    found
}

/// The lower end of a bin [deviations].
fn edge(bin: usize) -> f64 {
    REACH * (2.0 * bin as f64 / BINS as f64 - 1.0)
}

/// Parts of the values of a driver on the whole tile.
fn on_tile(
    driver: &ResolvedDriver,
    map: &LayeredMap,
    (mesh, facets): (&TileMesh, &Facets),
    surface: Option<&GaussianSurface>,
) -> Vec<f32> {
    match (&driver.source, surface) {
        (Source::Place(place), _) => {
            let values = &place.grid.values;
            let step = values.len().div_ceil(SAMPLES).max(1);
            histogram(values.iter().step_by(step).map(|value| (f64::from(*value), 1.0)))
        }
        (Source::Slope(SlopeDriver::Steepness), Some(_)) => {
            let [lengths, ..] = map.relief.slopes.weighted(&SlopeDriver::Steepness, None, &|_| DVec3::ONE);
            let Normal { mean, deviation } = driver.unit;
            let tail = |bin: usize| lengths.as_ref().map_or(0.0, |of| of.tail(mean + deviation * edge(bin)));
            (0..BINS).map(|bin| (tail(bin) - tail(bin + 1)) as f32).collect()
        }
        // Heights, slopes and their sums are normal on the stated surface.
        (_, Some(_)) => (0..BINS).map(|bin| (normal::cdf(edge(bin + 1)) - normal::cdf(edge(bin))) as f32).collect(),
        (source, None) => histogram((0..facets.len()).map(|k| {
            let point = surface_point(mesh.size, facets.positions[k], facets.normals[k]);
            let weight = f64::from(facets.areas[k] * facets.geometric_normals[k].z.abs());
            (source.value(&point, &map.relief) + offset(source, k), weight)
        })),
    }
}

/// The offset of noisy heights at a facet: quantiles of its distribution, spread evenly over the facets.
fn offset(source: &Source, facet: usize) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    match source {
        Source::Height { noise } if *noise > 0.0 => noise * normal::quantile((0.5 + facet as f64 * GOLDEN).fract()),
        _ => 0.0,
    }
}

/// Parts of weighted values in each bin.
fn histogram(values: impl Iterator<Item = (f64, f64)>) -> Vec<f32> {
    let mut bins = vec![0.0; BINS];
    let mut total = 0.0;
    for (value, weight) in values {
        total += weight;
        let bin = (value + REACH) / (2.0 * REACH) * BINS as f64;
        if (0.0..BINS as f64).contains(&bin) {
            bins[bin as usize] += weight;
        }
    }
    bins.into_iter().map(|sum| if total > 0.0 { (sum / total) as f32 } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;

    fn measured(text: &str, picked: Option<(Vec3, Vec3)>) -> Vec<DriverValues> {
        let scene = scene::parse(text).unwrap();
        let loaded = LoadedScene { scene, base_dir: "".into(), name: "map".into(), painted: Default::default() };
        let job = ColorMapJob { loaded: Arc::new(loaded), picked };
        let last = std::cell::RefCell::new(Vec::new());
        measure(&Pipeline::new(), &job, &Cancel::default(), &|result| {
            if let ColorMapResult::Values(values) = result {
                *last.borrow_mut() = values;
            }
        })
        .unwrap();
        last.into_inner()
    }

    fn mean(bins: &[f32]) -> f64 {
        let middle = |bin: usize| 0.5 * (edge(bin) + edge(bin + 1));
        bins.iter().enumerate().map(|(bin, part)| middle(bin) * f64::from(*part)).sum()
    }

    #[test]
    fn histograms_hold_all_values_and_are_centred_on_the_mean() {
        let layers = "[[color_map.layer]]\ndriver = { kind = \"height\", noise = 0.3 }\nstops = [[0, 1]]\n\
            [[color_map.layer]]\ndriver = { kind = \"slope\" }\nstops = [[0, 1]]\n\
            [[color_map.layer]]\ndriver = { kind = \"slope\" }\nstops = [[0, 1]]\n\
            [[color_map.layer]]\ndriver = { kind = \"noise\" }\nstops = [[0, 1]]\n\
            [[color_map.layer]]\ndriver = { kind = \"steepness\" }\nstops = [[0, 1]]\n";
        let tile = "[tile]\ngeometry = { kind = \"heightfield\", path = \"asset:hammered.png\" }\n[color_map]\n";
        let surface = "[tile]\ngeometry = { kind = \"flat\" }\n[color_map]\nsurface = { height = 0.2 }\n";
        for scene in [tile, surface] {
            let values = measured(&format!("{scene}{layers}"), None);
            assert_eq!(values.len(), 4, "equal drivers are measured once");
            for DriverValues { driver, whole, seen, .. } in &values {
                let total: f32 = whole.iter().sum();
                assert!((0.97..1.001).contains(&total), "{}: {total}", driver.kind());
                assert!(mean(whole).abs() < 0.12 && seen.is_none(), "{}: {}", driver.kind(), mean(whole));
            }
        }
    }

    #[test]
    fn a_grazing_viewer_sees_higher_places_and_slopes_that_face_it() {
        let text = "[tile]\ngeometry = { kind = \"heightfield\", path = \"asset:hammered.png\", height_scale = 0.3 }\n\
            [[color_map.layer]]\ndriver = { kind = \"height\" }\nstops = [[0, 1]]\n\
            [[color_map.layer]]\ndriver = { kind = \"slope\" }\nstops = [[0, 1]]\n\
            [[color_map.layer]]\ndriver = { kind = \"noise\" }\nstops = [[0, 1]]\n";
        let grazing = Vec3::new(1.3, 0.0, 0.25).normalize_or_zero();
        let values = measured(text, Some((Vec3::Z, grazing)));
        let [height, slope, noise] = &values[..] else { panic!("{values:?}") };
        let shift = |of: &DriverValues| mean(of.seen.as_ref().unwrap()) - mean(&of.whole);
        assert!(shift(height) > 0.05, "{}", shift(height));
        assert!(shift(slope) > 0.2, "{}", shift(slope));
        assert!(noise.seen.is_none());
    }
}
