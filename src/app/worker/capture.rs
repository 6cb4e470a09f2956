//! A folder of photographs of a sheet: what its dots, pixels and distributions of slopes look like.

use std::path::PathBuf;
use std::sync::Arc;

use crate::base::{Cancel, Error, Result};
use crate::render::image::tone_map::srgb_byte;
use crate::slab::capture::inspection::Inspection;
use eframe::egui::{Color32, ColorImage};
use glam::{DVec2, Vec3};

use super::runner::JobContext;

/// Bytes of photographs in memory.
const MEMORY: usize = 512 << 20;
/// Cells per side of the image of a distribution.
const SIDE: usize = 96;
/// Part of the brightest pixel above which values of a photograph are shown white.
const WHITE: f32 = 0.98;

/// The parts of a folder to show.
#[derive(Debug, Clone, PartialEq)]
pub struct CaptureJob {
    pub folder: PathBuf,
    pub camera: usize,
    /// The pixel whose measurements are shown, in fractions of the photograph.
    pub place: [f32; 2],
    /// The dot whose photograph is shown; `None` for the mean over all dots.
    pub dot: Option<usize>,
}

pub enum CaptureResult {
    Shown(Box<ShownCapture>),
    /// The folder, unless the program has a fault, and the reason.
    Failed(Option<PathBuf>, String),
}

/// A folder, one of its pixels and one photograph.
#[derive(Debug, Clone)]
pub struct ShownCapture {
    pub job: CaptureJob,
    pub cameras: usize,
    pub photographed: [u32; 2],
    pub size: [u32; 2],
    /// Places of the dots on the monitor [m].
    pub dots: Vec<DVec2>,
    /// Radiance of the pixel by dot, a channel mean; NaN if broken.
    pub radiances: Vec<f32>,
    /// BTDF of the pixel by dot without its diffuse part [1/sr], and that of its model.
    pub measured: Vec<f64>,
    pub model: Option<Vec<f64>>,
    pub photograph: Arc<ColorImage>,
    pub lobe: Option<ShownLobe>,
    /// Diffuse BTDF [1/sr].
    pub diffuse: f64,
}

/// The fitted distribution of slopes of a pixel.
#[derive(Debug, Clone)]
pub struct ShownLobe {
    /// Density over slopes, from black to its maximum: x to the right, y up.
    pub image: Arc<ColorImage>,
    /// Largest slope of the image.
    pub span: f64,
    pub alpha: f64,
    /// Roughness of the Beckmann face with the same variance.
    pub roughness: f64,
    /// Relative L2 of the model against the photographs.
    pub residual: f64,
}

/// The folder that was read last.
#[derive(Default)]
pub struct CaptureWorker {
    opened: Option<(PathBuf, Inspection)>,
}

impl CaptureWorker {
    pub fn work(&mut self, job: CaptureJob, context: &JobContext<CaptureJob>, report: &dyn Fn(CaptureResult)) {
        let folder = job.folder.clone();
        match self.show(job, context.cancel) {
            Ok(shown) => report(CaptureResult::Shown(Box::new(shown))),
            Err(Error::Cancelled) => {}
            Err(error) => report(CaptureResult::Failed(Some(folder), error.to_string())),
        }
    }

    fn show(&mut self, job: CaptureJob, cancel: &Cancel) -> Result<ShownCapture> {
        if self.opened.as_ref().is_none_or(|(folder, _)| *folder != job.folder) {
            self.opened = None;
            self.opened = Some((job.folder.clone(), Inspection::open(&job.folder, MEMORY, cancel)?));
        }
        let Some((_, inspection)) = &self.opened else { return Err(Error::Cancelled) };
        let camera = job.camera.min(inspection.rig.cameras.len() - 1);
        let dot = job.dot.filter(|dot| *dot < inspection.dots.len());
        let [columns, rows] = inspection.size.to_array();
        let at = |part: f32, count: u32| ((part * count as f32) as u32).min(count - 1);
        let pixel = (at(job.place[1], rows) * columns + at(job.place[0], columns)) as usize;
        let found = inspection.pixel(camera, pixel);
        let lobe = found.fitted.as_ref().map(|fitted| {
            let (model, span) = (&fitted.model, inspection.span());
            ShownLobe {
                image: Arc::new(density_image(span, |slope| model.density(slope))),
                span,
                alpha: model.alpha,
                roughness: model.roughness(),
                residual: fitted.residual,
            }
        });
        Ok(ShownCapture {
            cameras: inspection.rig.cameras.len(),
            photographed: inspection.photographed.to_array(),
            size: [columns, rows],
            dots: inspection.dots.clone(),
            radiances: inspection.by_dot(camera, pixel).iter().map(|value| value.element_sum() / 3.0).collect(),
            measured: found.measured,
            model: found.model,
            photograph: Arc::new(photograph_image([columns, rows], &inspection.photograph(camera, dot))),
            lobe,
            diffuse: found.diffuse,
            job,
        })
    }
}

/// A photograph with the exposure that its brightest pixels allow. Rows run along +y, which is up. Broken values are magenta.
fn photograph_image([columns, rows]: [u32; 2], values: &[Vec3]) -> ColorImage {
    let mut brightness: Vec<f32> = values.iter().map(|value| value.max_element()).filter(|v| v.is_finite()).collect();
    brightness.sort_by(f32::total_cmp);
    let white = brightness.get((WHITE * brightness.len() as f32) as usize).or(brightness.last()).copied();
    let scale = white.filter(|white| *white > 0.0).map_or(1.0, f32::recip);
    let pixel = |value: Vec3| match value.is_finite() {
        true => {
            let [r, g, b] = (value * scale).to_array().map(srgb_byte);
            Color32::from_rgb(r, g, b)
        }
        false => Color32::from_rgb(255, 0, 255),
    };
    let lines = values.chunks(columns as usize).rev();
    ColorImage::new([columns as usize, rows as usize], lines.flatten().map(|value| pixel(*value)).collect())
}

/// An image of a density over the square of slopes.
fn density_image(span: f64, density: impl Fn(DVec2) -> f64) -> ColorImage {
    let at = |k: usize| {
        let cell = DVec2::new((k % SIDE) as f64, (SIDE - 1 - k / SIDE) as f64) + 0.5;
        density((cell / SIDE as f64 * 2.0 - 1.0) * span)
    };
    let values: Vec<f64> = (0..SIDE * SIDE).map(at).collect();
    let most = values.iter().copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let pixel = |value: &f64| Color32::from_gray(srgb_byte((value / most) as f32));
    ColorImage::new([SIDE, SIDE], values.iter().map(pixel).collect())
}
