//! A look into a folder of photographs before it is captured: the radiances of its pixels by dot, and the model of one pixel.

use std::path::Path;

use glam::{DVec2, UVec2, Vec3};

use super::alpha::{FitSettings, Fitted, fit_point};
use super::photographs::Photographs;
use super::points::Point;
use super::rig::Rig;
use super::sheet::{CaptureSettings, Sheet};
use crate::base::{Cancel, Result};

/// The photographs of a folder, thinned out to what the memory holds.
#[derive(Debug, Clone)]
pub struct Inspection {
    pub rig: Rig,
    /// Columns and rows of the photographs, and of the pixels that were read.
    pub photographed: UVec2,
    pub size: UVec2,
    step: u32,
    /// Places of the dots on the monitor [m].
    pub dots: Vec<DVec2>,
    /// Radiances per camera, by pixel and then by dot. Broken values are NaN.
    radiances: Vec<Vec<Vec3>>,
    fit: FitSettings,
}

/// The measurements of one pixel by one camera, and its model.
#[derive(Debug, Clone)]
pub struct InspectedPixel {
    /// BTDF without its diffuse part by dot [1/sr], a channel mean; NaN if broken.
    pub measured: Vec<f64>,
    /// The same of the model; absent if no lobe was found.
    pub model: Option<Vec<f64>>,
    pub fitted: Option<Fitted>,
    /// Diffuse BTDF [1/sr], a channel mean.
    pub diffuse: f64,
}

impl Inspection {
    /// Reads a folder. Of large photographs, `memory` bytes of pixels are read, in equal steps.
    ///
    /// # Errors
    /// As [`super::sheet::capture`].
    pub fn open(folder: &Path, memory: usize, cancel: &Cancel) -> Result<Self> {
        let rig = Rig::read(folder)?;
        let photographs = Photographs::open(&rig, folder)?;
        let settings = CaptureSettings::default();
        let fit = Sheet::new(&photographs, &settings, cancel)?.fit;
        let (dots, photographed) = (rig.dots(), photographs.size);
        let bytes = dots.len() * rig.cameras.len() * size_of::<Vec3>();
        let step = (1..).find(|step| thinned(photographed, *step).element_product() as usize * bytes <= memory);
        let step = step.unwrap_or(1).min(photographed.max_element());
        let size = thinned(photographed, step);
        let pixels: Vec<usize> = (0..size.element_product()).map(|k| full_pixel(k, size, step, photographed)).collect();
        let cameras = 0..rig.cameras.len();
        let radiances = cameras.map(|camera| photographs.gather(camera, &pixels, cancel)).collect::<Result<_>>()?;
        drop(photographs);
        Ok(Self { rig, photographed, size, step, dots, radiances, fit })
    }

    /// The photograph of a dot, or the mean over all dots. Broken values are NaN, and count as 0 in means.
    pub fn photograph(&self, camera: usize, dot: Option<usize>) -> Vec<Vec3> {
        let of_pixel = |values: &[Vec3]| match dot {
            Some(dot) => values[dot],
            None => values.iter().filter(|value| value.is_finite()).sum::<Vec3>() / values.len() as f32,
        };
        self.radiances[camera].chunks(self.dots.len()).map(of_pixel).collect()
    }

    /// Radiances of a pixel by dot.
    pub fn by_dot(&self, camera: usize, pixel: usize) -> &[Vec3] {
        &self.radiances[camera][pixel * self.dots.len()..][..self.dots.len()]
    }

    /// Half width of the square of slopes over which distributions are fitted.
    pub fn span(&self) -> f64 {
        self.fit.grid.span
    }

    /// Fits the model of one pixel to the photographs of all cameras, and compares it with those of one.
    pub fn pixel(&self, camera: usize, pixel: usize) -> InspectedPixel {
        let full = full_pixel(pixel as u32, self.size, self.step, self.photographed);
        let place = self.rig.place(full, self.photographed);
        let values: Vec<&[Vec3]> = (0..self.radiances.len()).map(|camera| self.by_dot(camera, pixel)).collect();
        let point = Point::new(&self.rig, &self.dots, place, &values);
        let view = &point.views[camera];
        let fitted = fit_point(&point.views, &self.fit);
        let model = fitted.as_ref().map(|fitted| {
            let value = |i| self.fit.optics.terms(i, view.o).map_or(0.0, |terms| fitted.model.btdf(&terms));
            view.samples.iter().map(|sample| fitted.scale * value(sample.i)).collect()
        });
        let diffuse = point.diffuse.element_sum() / 3.0;
        InspectedPixel { measured: view.samples.iter().map(|sample| sample.btdf).collect(), model, fitted, diffuse }
    }
}

/// Columns and rows of every `step`-th pixel.
fn thinned(size: UVec2, step: u32) -> UVec2 {
    size.map(|side| side.div_ceil(step))
}

/// The pixel of the photographs in the middle of a cell of `step` pixels per side.
fn full_pixel(pixel: u32, size: UVec2, step: u32, photographed: UVec2) -> usize {
    let cell = UVec2::new(pixel % size.x, pixel / size.x);
    let at = (cell * step + step / 2).min(photographed - 1);
    (at.y * photographed.x + at.x) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    use super::super::hard_cases_tests::{Case, GRID, write_folder};

    #[test]
    fn a_pixel_of_a_folder_shows_its_radiances_and_a_model_that_follows_them() {
        let folder = tempfile::tempdir().unwrap();
        let radiance =
            |dot: usize, pixel: usize, value: f64| if (dot, pixel) == (3, 2) { f32::NAN } else { value as f32 };
        write_folder(folder.path(), &Case { dots: GRID, pixels: [3, 2], radiance: &radiance });
        let inspection = Inspection::open(folder.path(), 1 << 20, &Cancel::default()).unwrap();
        assert_eq!((inspection.size, inspection.dots.len()), (UVec2::new(3, 2), 144));
        let by_dot = inspection.by_dot(0, 2);
        assert!(by_dot[3].is_nan() && by_dot.iter().filter(|value| value.is_finite()).count() == 143);
        assert_eq!(inspection.photograph(0, Some(7))[2], by_dot[7]);
        let mean = by_dot.iter().filter(|value| value.is_finite()).sum::<Vec3>() / 144.0;
        assert!((inspection.photograph(0, None)[2] - mean).length() < 1e-6);
        let pixel = inspection.pixel(0, 2);
        let (model, fitted) = (pixel.model.unwrap(), pixel.fitted.unwrap());
        let (mut error, mut power) = (0.0, 0.0);
        for (measured, model) in pixel.measured.iter().zip(model).filter(|(measured, _)| measured.is_finite()) {
            (error, power) = (error + (measured - model).powi(2), power + measured * measured);
        }
        assert!((error / power).sqrt() < 0.15, "{} of {}", (error / power).sqrt(), fitted.residual);
        assert!((pixel.diffuse / (0.02 * 2.5 / 3.0) - 1.0).abs() < 0.3, "{}", pixel.diffuse);
        // A small memory holds every second pixel.
        let thin = Inspection::open(folder.path(), 2 * 144 * 12, &Cancel::default()).unwrap();
        assert_eq!(thin.size, UVec2::new(2, 1));
        assert_eq!(thin.by_dot(0, 0)[5], inspection.by_dot(0, 4)[5]);
    }

    #[test]
    fn thinned_pixels_lie_inside_of_the_photographs_and_step_1_takes_all() {
        let photographed = UVec2::new(7, 5);
        assert_eq!(thinned(photographed, 1), photographed);
        assert!((0..35).all(|k| full_pixel(k, photographed, 1, photographed) == k as usize));
        let size = thinned(photographed, 3);
        assert_eq!(size, UVec2::new(3, 2));
        let pixels: Vec<usize> = (0..6).map(|k| full_pixel(k, size, 3, photographed)).collect();
        assert_eq!(pixels, [8, 11, 13, 29, 32, 34]);
    }
}
