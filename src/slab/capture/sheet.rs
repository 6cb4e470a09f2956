//! Capture of a whole sheet: from a folder of photographs to an SVBTDF.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::alpha::{FitSettings, Fitted, Shadowing, choose_smoothness, fit_point, shadowing};
use super::bounced::{AboveFloor, Bounced, SheetBounces};
use super::clusters::{LobeSlices, nearest, representatives};
use super::lobe::{LobeOptics, PointModel, SlopeGrid};
use super::photographs::Photographs;
use super::points::{Mixture, Point};
use super::push_pull::DirectionGrid;
use super::rig::Rig;
use super::svbtdf::Svbtdf;
use crate::base::{Cancel, Progress, Result, progress};

/// Choices of a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct CaptureSettings {
    /// A known α for all points.
    pub alpha: Option<f64>,
    /// Fits every pixel for itself in place of representatives.
    pub every_pixel: bool,
    /// Part of the pixels that are representatives.
    pub share: f64,
    pub seed: u64,
    /// Bytes of photographs in memory at once.
    pub memory: usize,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        Self { alpha: None, every_pixel: false, share: 0.01, seed: 1, memory: 1 << 30 }
    }
}

/// A captured sheet.
#[derive(Debug, Clone)]
pub struct Captured {
    pub svbtdf: Svbtdf,
    /// Relative L2 of the model against the measured slice of each pixel.
    pub residual: Vec<f32>,
    pub figures: Figures,
}

/// Figures of a capture, from which its health is judged.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct Figures {
    pub pixels: [usize; 2],
    pub dots: usize,
    pub cameras: usize,
    pub representatives: usize,
    /// Weight of Eq. 17 that held-out dots chose.
    pub smoothness: f64,
    /// Largest slope of the distributions.
    pub span: f64,
    /// Means over representatives.
    pub alpha: f64,
    pub residual: f64,
    /// Median of [`super::lobe::PointModel::skewness`].
    pub skewness: f64,
    /// Part of the slopes in the outer fifth of the span, median.
    pub outside: f64,
    /// Roughness of masking (`α_b`), and whether the photographs determine it.
    pub shadowing: f64,
    pub shadowing_is_determined: bool,
    /// Part of the transmitted light that is diffuse.
    pub diffuse: f64,
    /// Number of dots across a lobe, median.
    pub dots_across: f64,
    /// Part of the values that are saturated or not a number.
    pub broken: f64,
    /// Part of the pixels without a lobe.
    pub dark: f64,
    /// Median over the pixels of the relative L2 of the model against the measured slice.
    pub median_residual: f64,
}

/// Roughness of masking at the start (Sec. 4.2).
const SHADOWING: f64 = 0.2;
/// Nodes per side of the distributions, as in Table 1.
const SIDE: usize = 32;
/// Most cells per side of a slice.
const SLICE_SIDE: usize = 16;
/// Points that decide the spans, the smoothness and the roughness of masking.
const PROBES: usize = 64;
const SMOOTHED_PROBES: usize = 8;
/// Part of the energy that the span of slopes, and the slices, hold; and the factors on their widths.
const SPAN_ENERGY: f64 = 0.98;
const SPAN_MARGIN: f64 = 1.6;
const SLICE_ENERGY: f64 = 0.98;
const SLICE_MARGIN: f64 = 1.2;
/// Representatives that a pixel is interpolated between.
const NEIGHBOURS: usize = 6;
/// Fewest representatives.
const LEAST_REPRESENTATIVES: usize = 8;

/// Captures the sheet of a folder.
///
/// # Errors
/// An image is missing or cannot be used, or [`crate::base::Error::Cancelled`].
pub fn capture(
    rig: &Rig,
    folder: &Path,
    settings: &CaptureSettings,
    cancel: &Cancel,
    progress: &Progress<'_>,
) -> Result<Captured> {
    let photographs = Photographs::open(rig, folder)?;
    Sheet::new(&photographs, settings, cancel)?.run(progress)
}

/// A sheet, and what all its points share.
pub(super) struct Sheet<'a> {
    photographs: &'a Photographs<'a>,
    dots: Vec<DVec2>,
    settings: &'a CaptureSettings,
    pub(super) fit: FitSettings,
    /// Squares of directions of the slices, per camera.
    directions: Vec<DirectionGrid>,
    figures: Figures,
    cancel: &'a Cancel,
}

/// Colours that are measured at each pixel beside its lobe.
#[derive(Default)]
struct Measured {
    tint: Vec<DVec3>,
    diffuse: Vec<DVec3>,
}

impl Measured {
    fn add(&mut self, points: &[Point]) {
        self.tint.extend(points.iter().map(Point::tint));
        self.diffuse.extend(points.iter().map(|point| point.diffuse));
    }
}

/// The weights of representatives for each pixel.
#[derive(Default)]
struct Interpolation {
    neighbours: usize,
    index: Vec<u32>,
    weight: Vec<f32>,
    /// `k_s` of the channel mean.
    scale: Vec<f64>,
    /// Part of the diffuse BTDF that is light reflected inside, per scale.
    floor: Vec<f64>,
    residual: Vec<f32>,
}

impl<'a> Sheet<'a> {
    /// Decides the spans and the smoothness from some points.
    pub(super) fn new(
        photographs: &'a Photographs<'a>,
        settings: &'a CaptureSettings,
        cancel: &'a Cancel,
    ) -> Result<Self> {
        let rig = photographs.rig;
        let dots = rig.dots();
        let count = photographs.size.element_product() as usize;
        let optics = LobeOptics::new(rig.eta, SHADOWING);
        let grid = SlopeGrid { side: SIDE, span: 1.0 };
        let bounced = if rig.bounces { Some(Arc::new(Bounced::new(rig.eta, cancel)?)) } else { None };
        let fit = FitSettings { optics, grid, smooth: 1.0, alpha: settings.alpha, bounced };
        let figures = Figures {
            pixels: [photographs.size.x as usize, photographs.size.y as usize],
            dots: dots.len(),
            cameras: rig.cameras.len(),
            ..Figures::default()
        };
        let mut sheet = Self { photographs, dots, settings, fit, directions: Vec::new(), figures, cancel };
        // Steps of the golden section do not follow the columns of the image.
        let place = |k: usize| ((0.5 + k as f64 * 0.618_033_988_749_894_9).fract() * count as f64) as usize;
        let mut probes: Vec<usize> = (0..PROBES.min(count)).map(place).map(|pixel| pixel.min(count - 1)).collect();
        probes.sort_unstable();
        probes.dedup();
        let points = sheet.points(&probes)?;
        let optics = &sheet.fit.optics;
        let quantile = |mut values: Vec<f64>, part: f64| -> Option<f64> {
            values.sort_by(f64::total_cmp);
            values.get((part * values.len().saturating_sub(1) as f64).round() as usize).copied()
        };
        let reaches = points.iter().filter_map(|point| point.slope_reach(optics, SPAN_ENERGY)).collect();
        let span = quantile(reaches, 0.9).map_or(1.0, |reach| (SPAN_MARGIN * reach).clamp(0.02, 1.5));
        let directions = rig.cameras.iter().enumerate().map(|(camera, described)| {
            let reaches = points.iter().filter_map(|point| point.direction_reach(camera, optics, SLICE_ENERGY));
            let half = quantile(reaches.collect(), 0.9).map_or(0.5, |reach| (SLICE_MARGIN * reach).clamp(0.01, 1.0));
            let center = -described.unit_direction().truncate();
            let mut grid = DirectionGrid { side: SLICE_SIDE, center, half };
            let samples =
                points.iter().map(|point| point.samples_in(camera, &grid)).sum::<usize>() / points.len().max(1);
            // Slices have at least one sample per cell in the mean.
            while grid.side > 2 && grid.side * grid.side > samples {
                grid.side /= 2;
            }
            grid
        });
        sheet.directions = directions.collect();
        sheet.figures.dots_across = quantile(points.iter().map(Point::dots_across).collect(), 0.5).unwrap_or(0.0);
        sheet.figures.broken = points.iter().map(|point| point.broken).sum::<f64>() / points.len().max(1) as f64;
        sheet.figures.span = span;
        sheet.fit.grid.span = span;
        let step = points.len().div_ceil(SMOOTHED_PROBES).max(1);
        let some: Vec<_> = points.iter().step_by(step).map(|point| point.views.clone()).collect();
        sheet.fit.smooth = choose_smoothness(&some, &sheet.fit);
        sheet.figures.smoothness = sheet.fit.smooth;
        Ok(sheet)
    }

    /// Reads the points of pixels.
    fn points(&self, pixels: &[usize]) -> Result<Vec<Point>> {
        Ok(self.points_of(pixels, &self.radiances(pixels)?, 0..pixels.len()))
    }

    /// Radiances of pixels per camera, by pixel and then by dot.
    fn radiances(&self, pixels: &[usize]) -> Result<Vec<Vec<Vec3>>> {
        let cameras = 0..self.photographs.rig.cameras.len();
        cameras.map(|camera| self.photographs.gather(camera, pixels, self.cancel)).collect()
    }

    /// The points of a range of pixels, from the radiances of all of them.
    fn points_of(&self, pixels: &[usize], radiances: &[Vec<Vec3>], range: Range<usize>) -> Vec<Point> {
        let count = self.dots.len();
        let point = |k: usize| {
            let radiances: Vec<&[Vec3]> = radiances.iter().map(|all| &all[k * count..(k + 1) * count]).collect();
            let place = self.photographs.rig.place(pixels[k], self.photographs.size);
            Point::new(self.photographs.rig, &self.dots, place, &radiances)
        };
        range.into_par_iter().map(point).collect()
    }

    /// Calls `work` with the points of all pixels, some at once. The photographs are read again for as many pixels as the
    /// memory holds radiances of; points are larger.
    fn for_all(&self, progress: &Progress<'_>, mut work: impl FnMut(&[usize], Vec<Point>)) -> Result<()> {
        const POINTS_AT_ONCE: usize = 1024;
        let all = self.photographs.size.element_product() as usize;
        let bytes = self.dots.len() * self.figures.cameras * size_of::<Vec3>();
        let at_once = (self.settings.memory / bytes.max(1)).clamp(1, all.max(1));
        for first in (0..all).step_by(at_once) {
            progress::report(progress, first as f32 / all as f32)?;
            let pixels: Vec<usize> = (first..(first + at_once).min(all)).collect();
            let radiances = self.radiances(&pixels)?;
            for start in (0..pixels.len()).step_by(POINTS_AT_ONCE) {
                self.cancel.check()?;
                let range = start..(start + POINTS_AT_ONCE).min(pixels.len());
                work(&pixels[range.clone()], self.points_of(&pixels, &radiances, range));
            }
        }
        Ok(())
    }

    fn run(mut self, progress: &Progress<'_>) -> Result<Captured> {
        if self.settings.every_pixel {
            return self.every_pixel(progress);
        }
        let (slices, lit) = self.slices(&progress::part(progress, 0.0, 0.35))?;
        self.figures.dark = 1.0 - lit.len() as f64 / slices.count().max(1) as f64;
        let wanted = ((self.settings.share * lit.len() as f64).round() as usize).max(LEAST_REPRESENTATIVES);
        let chosen = representatives(&slices, &lit, wanted, self.settings.seed, self.cancel)?;
        let points = self.points(&chosen)?;
        let fits = progress::in_parallel(chosen.len(), &progress::part(progress, 0.4, 0.6), |k| {
            fit_point(&points[k].views, &self.fit)
        })?;
        self.judge(&points, &fits);
        let fitted: Vec<(usize, PointModel)> =
            chosen.into_iter().zip(fits).filter_map(|(pixel, fit)| Some((pixel, fit?.model))).collect();
        self.interpolated(&slices, fitted, &progress::part(progress, 0.6, 1.0))
    }

    /// The slices of all pixels, scaled to the mean 1, and the pixels that have one.
    fn slices(&self, progress: &Progress<'_>) -> Result<(LobeSlices, Vec<usize>)> {
        let cells = self.directions.iter().map(|grid| grid.side * grid.side).sum();
        let mut slices = LobeSlices { cells, values: Vec::new() };
        let mut lit = Vec::new();
        self.for_all(progress, |pixels, points| {
            let found: Vec<Option<Vec<f32>>> = points.par_iter().map(|point| slice(point, &self.directions)).collect();
            for (pixel, slice) in pixels.iter().zip(found) {
                lit.extend(slice.is_some().then_some(*pixel));
                slices.values.extend(slice.unwrap_or_else(|| vec![0.0; cells]));
            }
        })?;
        Ok((slices, lit))
    }

    /// Notes figures of the fitted points.
    fn judge(&mut self, points: &[Point], fits: &[Option<Fitted>]) {
        let found: Vec<(&Point, &Fitted)> =
            points.iter().zip(fits).filter_map(|(point, fit)| Some((point, fit.as_ref()?))).collect();
        let count = found.len().max(1) as f64;
        let median = |value: &dyn Fn(&Fitted) -> f64| {
            let mut values: Vec<f64> = found.iter().map(|(_, fit)| value(fit)).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        };
        let step = found.len().div_ceil(SMOOTHED_PROBES).max(1);
        let of_masking: Vec<Shadowing> =
            found.iter().step_by(step).map(|(point, fit)| shadowing(&point.views, &self.fit, fit)).collect();
        let determined: Vec<f64> =
            of_masking.iter().filter(|found| found.is_determined).map(|found| found.roughness).collect();
        let is_determined = 2 * determined.len() > of_masking.len();
        let mean = determined.iter().sum::<f64>() / determined.len().max(1) as f64;
        self.figures = Figures {
            representatives: found.len(),
            alpha: found.iter().map(|(_, fit)| fit.model.alpha).sum::<f64>() / count,
            residual: found.iter().map(|(_, fit)| fit.residual).sum::<f64>() / count,
            skewness: median(&|fit| fit.model.skewness()),
            outside: median(&|fit| fit.model.outside(0.8)),
            shadowing: if is_determined { mean } else { self.fit.optics.shadowing },
            shadowing_is_determined: is_determined,
            ..self.figures.clone()
        };
    }

    fn every_pixel(mut self, progress: &Progress<'_>) -> Result<Captured> {
        let mut all: Vec<Option<Fitted>> = Vec::new();
        let mut measured = Measured::default();
        let (mut judged_points, mut judged_fits) = (Vec::new(), Vec::new());
        self.for_all(progress, |_, points| {
            let fits: Vec<_> = points.par_iter().map(|point| fit_point(&point.views, &self.fit)).collect();
            if judged_points.is_empty() {
                (judged_points, judged_fits) =
                    (points.iter().take(PROBES).cloned().collect(), fits[..fits.len().min(PROBES)].to_vec());
            }
            measured.add(&points);
            all.extend(fits);
        })?;
        self.judge(&judged_points, &judged_fits);
        self.figures.representatives = all.iter().flatten().count();
        self.figures.dark = 1.0 - self.figures.representatives as f64 / all.len().max(1) as f64;
        let residual = all.iter().map(|fit| fit.as_ref().map_or(0.0, |fit| fit.residual as f32)).collect();
        let scale: Vec<f64> = all.iter().map(|fit| fit.as_ref().map_or(0.0, |fit| fit.scale)).collect();
        let floor = all.iter().map(|fit| fit.as_ref().map_or(0.0, |fit| fit.floor)).collect();
        let models = all.into_iter().map(|fit| fit.map_or_else(|| self.level_model(), |fit| fit.model)).collect();
        let (index, weight) = ((0..scale.len() as u32).collect(), vec![1.0; scale.len()]);
        let parts = Interpolation { neighbours: 1, index, weight, scale, floor, residual };
        Ok(self.assembled(&measured, models, parts))
    }

    /// The model of a sheet without a lobe. Its scale is 0.
    fn level_model(&self) -> PointModel {
        let width = 0.3 * self.fit.grid.span;
        let ln = |k: usize| -(self.fit.grid.node(k) / width).length_squared();
        let ln_density = (0..SIDE * SIDE).map(ln).collect();
        let mut model = PointModel { grid: self.fit.grid, alpha: 0.5, ln_density };
        model.normalise();
        model
    }

    /// Interpolates all pixels between fitted representatives (Eqs. 20 to 22). The nearest ones are found by their slices, and
    /// the weights from the samples of the pixel itself, because slices are resampled.
    fn interpolated(
        self,
        slices: &LobeSlices,
        fitted: Vec<(usize, PointModel)>,
        progress: &Progress<'_>,
    ) -> Result<Captured> {
        let (pixels, mut models): (Vec<usize>, Vec<PointModel>) = fitted.into_iter().unzip();
        if models.is_empty() {
            models.push(self.level_model());
        }
        let near = NEIGHBOURS.min(models.len());
        let of_representatives = slices.gathered(&pixels);
        let index = match pixels.len() {
            0 => vec![0; slices.count()],
            _ => nearest(slices, &of_representatives, near),
        };
        let mut measured = Measured::default();
        let mut parts = Interpolation { neighbours: near, index, ..Interpolation::default() };
        self.for_all(progress, |pixels, points| {
            let mix = |(pixel, point): (&usize, &Point)| {
                let own = &parts.index[pixel * near..(pixel + 1) * near];
                let own: Vec<&PointModel> = own.iter().map(|k| &models[*k as usize]).collect();
                // The nearest representative stands for all: its light differs little from theirs.
                let bounced = self.fit.bounced.as_ref();
                let light = bounced.map(|bounced| AboveFloor::new(bounced.of_model(own[0]), &point.views));
                let mixture = point.mixed(&self.fit.optics, &self.directions, &own, light.as_ref());
                (mixture, light.map_or(0.0, |light| light.floor))
            };
            let found: Vec<_> = pixels.par_iter().zip(points.par_iter()).map(mix).collect();
            for (Mixture { weights, scale, residual }, floor) in found {
                parts.floor.push(floor);
                parts.weight.extend(weights);
                parts.scale.push(scale);
                parts.residual.push(residual);
            }
            measured.add(&points);
        })?;
        Ok(self.assembled(&measured, models, parts))
    }

    fn assembled(mut self, measured: &Measured, models: Vec<PointModel>, parts: Interpolation) -> Captured {
        let scale: Vec<Vec3> =
            parts.scale.iter().zip(&measured.tint).map(|(scale, tint)| (*scale * *tint).as_vec3()).collect();
        let even = |((diffuse, scale), floor): ((&DVec3, &Vec3), &f64)| {
            (diffuse.as_vec3() - *scale * *floor as f32).max(Vec3::ZERO)
        };
        let diffuse: Vec<Vec3> = measured.diffuse.iter().zip(&scale).zip(&parts.floor).map(even).collect();
        let lobes = scale.iter().map(|value| f64::from(value.element_sum())).sum::<f64>();
        let even = std::f64::consts::PI * diffuse.iter().map(|value| f64::from(value.element_sum())).sum::<f64>();
        self.figures.diffuse = if even > 0.0 { even / (even + lobes) } else { 0.0 };
        let optics = LobeOptics::new(self.photographs.rig.eta, self.fit.optics.shadowing);
        let Interpolation { neighbours, index, weight, residual, .. } = parts;
        let (size, grid) = (self.figures.pixels, self.fit.grid);
        let bounced = self.fit.bounced.clone().map(|light| SheetBounces::new(light, &models));
        let svbtdf = Svbtdf { size, optics, grid, models, neighbours, index, weight, scale, diffuse, bounced };
        let mut sorted = residual.clone();
        sorted.sort_by(f32::total_cmp);
        self.figures.median_residual = sorted.get(sorted.len() / 2).map_or(0.0, |median| f64::from(*median));
        Captured { svbtdf, residual, figures: self.figures }
    }
}

/// The slice of a point over all cameras, scaled to the mean 1; `None` without a lobe.
fn slice(point: &Point, directions: &[DirectionGrid]) -> Option<Vec<f32>> {
    let mut values = Vec::new();
    for (view, grid) in point.views.iter().zip(directions) {
        let finite = view.samples.iter().filter(|sample| sample.btdf.is_finite());
        values.extend(grid.push_pull(finite.map(|sample| (sample.i.truncate(), sample.btdf))).values);
    }
    let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|value| *value = (f64::from(*value) / mean) as f32);
    values.iter().all(|value| value.is_finite()).then_some(values)
}
