//! The photographs of a rig as values of pixels: dark frames, exposures and corners are taken into account.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec2, DVec3, UVec2, Vec3};
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use super::rig::Rig;
use crate::base::{Cancel, InputError, Result};
use crate::geometry::image_file;

/// Largest value of an integer image that is not saturated.
const INTEGER_SATURATION: f64 = 0.999;

/// Largest number of pixels. Their slices take 1 GiB per camera.
const MAX_PIXELS: u64 = 1 << 20;

/// The photographs of a folder.
pub struct Photographs<'a> {
    pub rig: &'a Rig,
    folder: &'a Path,
    /// Columns and rows, after rectification.
    pub size: UVec2,
    cameras: Vec<Prepared>,
}

/// Data that all images of a camera share.
struct Prepared {
    /// Size of the files.
    size: UVec2,
    dark: Option<Vec<Vec3>>,
    /// Maps places of the sample, 0 to 1, to places in the files [pixels].
    image_from_sample: Option<DMat3>,
}

impl<'a> Photographs<'a> {
    /// Checks that the folder holds an image for every dot, camera and exposure, and reads the first ones.
    ///
    /// # Errors
    /// An image is missing or cannot be read, or the corners span no area.
    pub fn open(rig: &'a Rig, folder: &'a Path) -> Result<Self> {
        let dots = rig.dots().len();
        let mut cameras = Vec::new();
        let mut size = None;
        for (k, camera) in rig.cameras.iter().enumerate() {
            let names = (0..dots).flat_map(|dot| (0..camera.times().len()).map(move |e| camera.image(dot, e)));
            let missing: Vec<PathBuf> = names.filter(|name| !folder.join(name).exists()).collect();
            if let Some(first) = missing.first() {
                let all = dots * camera.times().len();
                let found = format!("{} of {all} images, without `{}`", all - missing.len(), first.display());
                let expected = "an image for every dot and exposure";
                return Err(InputError::new(format!("camera.{k}.images"), found, expected).in_file(folder).into());
            }
            let file_size = image_file::read_linear(folder, &camera.image(0, 0))?.0.size;
            let image_from_sample = camera.corners.map(|corners| rectification(&corners, k)).transpose()?;
            let own = match (&camera.corners, rig.pixels) {
                (Some(_), Some([x, y])) => UVec2::new(x as u32, y as u32),
                (Some(corners), None) => size.unwrap_or_else(|| natural_size(corners)),
                (None, _) => file_size,
            };
            let expected = *size.get_or_insert(own);
            if own != expected {
                return Err(other_size(own, expected).in_file(folder.join(camera.image(0, 0))).into());
            }
            let dark = camera.dark.as_ref().map(|dark| read_sized(folder, dark, file_size).map(|image| image.0));
            cameras.push(Prepared { size: file_size, dark: dark.transpose()?, image_from_sample });
        }
        let size = size.unwrap_or(UVec2::ONE);
        let pixels = size.as_u64vec2().element_product();
        if pixels > MAX_PIXELS {
            let expected = format!("at most {MAX_PIXELS} pixels: scale or crop the images");
            let found = format!("{} x {} pixels", size.x, size.y);
            return Err(InputError::new("", found, expected).in_file(folder.join(rig.cameras[0].image(0, 0))).into());
        }
        Ok(Self { rig, folder, size, cameras })
    }

    /// Radiances of a camera at pixels, by pixel and then by dot. Saturated and broken values are NaN.
    ///
    /// # Errors
    /// An image cannot be read or has another size than the first one, or [`crate::base::Error::Cancelled`].
    pub fn gather(&self, camera: usize, pixels: &[usize], cancel: &Cancel) -> Result<Vec<Vec3>> {
        let dots = self.rig.dots().len();
        let mut values = vec![Vec3::ZERO; pixels.len() * dots];
        /// Images that are read at the same time.
        const AT_ONCE: usize = 16;
        for first in (0..dots).step_by(AT_ONCE) {
            cancel.check()?;
            let of_dots: Vec<Vec<Vec3>> = (first..(first + AT_ONCE).min(dots))
                .into_par_iter()
                .map(|dot| self.radiances(camera, dot, pixels))
                .collect::<Result<_>>()?;
            for (dot, found) in of_dots.into_iter().enumerate() {
                found.into_iter().enumerate().for_each(|(pixel, value)| values[pixel * dots + first + dot] = value);
            }
        }
        Ok(values)
    }

    /// Radiances of one dot at pixels.
    fn radiances(&self, camera: usize, dot: usize, pixels: &[usize]) -> Result<Vec<Vec3>> {
        let (described, prepared) = (&self.rig.cameras[camera], &self.cameras[camera]);
        let times = described.times();
        let mut merged = vec![Merged::default(); pixels.len()];
        for (exposure, time) in times.iter().enumerate() {
            let name = described.image(dot, exposure);
            let (values, is_integer) = read_sized(self.folder, &name, prepared.size)?;
            let limit = if is_integer { INTEGER_SATURATION } else { f64::INFINITY };
            let limit = self.rig.saturation.unwrap_or(limit) as f32;
            // The dark frame is that of the first exposure.
            let dark_scale = (time / times[0]) as f32;
            let value = |at: usize| {
                let value = values[at];
                let dark = prepared.dark.as_ref().map_or(Vec3::ZERO, |dark| dark[at] * dark_scale);
                let is_valid = value.is_finite() && value.max_element() < limit;
                if is_valid { value - dark } else { Vec3::NAN }
            };
            for (merged, pixel) in merged.iter_mut().zip(pixels) {
                merged.add(self.read(prepared, &value, *pixel), *time as f32);
            }
        }
        Ok(merged.into_iter().map(Merged::value).collect())
    }

    /// The value at a pixel of the rectified image: bilinear in the file.
    fn read(&self, prepared: &Prepared, value: &dyn Fn(usize) -> Vec3, pixel: usize) -> Vec3 {
        let Some(map) = prepared.image_from_sample else { return value(pixel) };
        let columns = self.size.x as usize;
        let at = DVec2::new((pixel % columns) as f64, (pixel / columns) as f64) + 0.5;
        let mapped = map * (at / self.size.as_dvec2()).extend(1.0);
        let last = prepared.size.as_dvec2() - 1.0;
        let place = mapped.truncate() / mapped.z - 0.5;
        let is_inside = place.cmpge(DVec2::splat(-0.5)).all() && place.cmple(last + 0.5).all();
        if !is_inside {
            return Vec3::NAN;
        }
        let place = place.clamp(DVec2::ZERO, last);
        let (base, t) = (place.floor(), (place - place.floor()).as_vec2());
        let read = |x: f64, y: f64| {
            let (x, y) = (x.min(last.x) as usize, y.min(last.y) as usize);
            value(y * prepared.size.x as usize + x)
        };
        let row = |y: f64| read(base.x, y).lerp(read(base.x + 1.0, y), t.x);
        row(base.y).lerp(row(base.y + 1.0), t.y)
    }
}

/// A sum of exposures, each weighted by its time: long exposures have less noise.
#[derive(Clone, Copy, Default)]
struct Merged {
    sum: Vec3,
    time: f32,
}

impl Merged {
    fn add(&mut self, value: Vec3, time: f32) {
        if value.is_finite() {
            self.sum += value;
            self.time += time;
        }
    }

    fn value(self) -> Vec3 {
        if self.time > 0.0 { self.sum / self.time } else { Vec3::NAN }
    }
}

fn other_size(found: UVec2, expected: UVec2) -> InputError {
    let text = |size: UVec2| format!("{} x {} pixels", size.x, size.y);
    InputError::new("", text(found), format!("{}, as the first image", text(expected)))
}

/// Reads an image of a known size.
fn read_sized(folder: &Path, name: &Path, size: UVec2) -> Result<(Vec<Vec3>, bool)> {
    let (image, is_integer) = image_file::read_linear(folder, name)?;
    if image.size != size {
        return Err(other_size(image.size, size).in_file(folder.join(name)).into());
    }
    Ok((image.values, is_integer))
}

/// Columns and rows of a rectified image: the mean lengths of opposite sides.
fn natural_size(corners: &[[f64; 2]; 4]) -> UVec2 {
    let side = |a: usize, b: usize| DVec2::from_array(corners[a]).distance(DVec2::from_array(corners[b]));
    let length = |a: f64, b: f64| (0.5 * (a + b)).round().clamp(1.0, 4096.0) as u32;
    UVec2::new(length(side(0, 1), side(3, 2)), length(side(0, 3), side(1, 2)))
}

/// The homography that maps the unit square to four corners (Hartley and Zisserman 2004, Sec. 4.1).
fn rectification(corners: &[[f64; 2]; 4], camera: usize) -> Result<DMat3> {
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut matrix = SMatrix::<f64, 8, 8>::zeros();
    let mut right = SVector::<f64, 8>::zeros();
    for (k, ([x, y], [u, v])) in unit.into_iter().zip(*corners).enumerate() {
        let rows = [[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y]];
        for (row, values) in rows.into_iter().enumerate() {
            values.into_iter().enumerate().for_each(|(column, value)| matrix[(2 * k + row, column)] = value);
            right[2 * k + row] = if row == 0 { u } else { v };
        }
    }
    let solved = matrix.lu().solve(&right).filter(|h| h.iter().all(|value| value.is_finite()));
    let map = solved.map(|h| {
        DMat3::from_cols(DVec3::new(h[0], h[3], h[6]), DVec3::new(h[1], h[4], h[7]), DVec3::new(h[2], h[5], 1.0))
    });
    // Corners on a line, or in an order that folds the square, change the sign of the last coordinate or of the area.
    let is_sound = map.is_some_and(|map| {
        unit.iter().all(|[x, y]| (map * DVec3::new(*x, *y, 1.0)).z > 1e-6) && map.determinant().abs() > 1e-9
    });
    map.filter(|_| is_sound).ok_or_else(|| {
        let expected = "four corners of a convex quadrilateral, in order";
        InputError::new(format!("camera.{camera}.corners"), format!("{corners:?}"), expected).into()
    })
}

#[cfg(test)]
#[path = "photographs_tests.rs"]
mod tests;
