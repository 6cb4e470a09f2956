//! A filtered tile on an object: every pixel shows what is left of the relief at its distance.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::calibration::{Calibration, Corrections};
use super::radiance::{PixelMaterials, PixelReflectance};
use super::surface::FilteredTile;
use crate::base::{Cancel, Result};
use crate::render::image::shading_points::ShadingPoints;
use crate::render::tile_view::ShadedMaterials;
use crate::render::tile_view::on_object::{TILE_RADII, anchor};
use crate::render::{CameraView, Image, RenderInput};

/// Lowest elevation of a viewer above the plane of the tile, as a sine.
const LOWEST: f64 = 0.02;
/// Largest number of parts along the line of sight into which a pixel is split, so that each is as long as wide. Two parts
/// per width soften the jumps from crest to crest: with one, pixels of 1.3 correlation lengths at 75° flicker by a third
/// more than the truth (`cargo bench --bench measure -- color-zoom`).
const MAX_PARTS: f64 = 8.0;
/// Bound of the factor by which the model of the relief is brought to `f̄`.
const MOST_CORRECTION: f64 = 16.0;
/// Pixels that filter away less than this part of the slopes' variance are not corrected.
const LEAST_LEFT: f64 = 1e-3;

/// A pixel's part of the plane of the tile.
#[derive(Debug, Clone, Copy)]
pub struct PixelOnTile {
    /// Its centre [tile units].
    pub centre: DVec2,
    /// Its extent across the line of sight [tile units].
    pub width: f64,
}

/// The parts along the line of sight into which a pixel is split.
struct Parts {
    count: f64,
    /// Width of a part, and distance between two [tile units]. The variance of all is that of the pixel's footprint.
    width: f64,
    step: f64,
}

/// The parts of a pixel of this width at this cosine of the viewer.
fn parts(width: f64, cosine: f64) -> Parts {
    let stretch = 1.0 / cosine.max(LOWEST);
    // A pixel that is seen from above is one part, whatever rounding adds to its length.
    let count = (2.0 * stretch - 1.01).ceil().clamp(1.0, MAX_PARTS);
    let widened = (2.0 * stretch / (count + 1.0)).max(1.0);
    let left = (stretch * stretch - widened * widened).max(0.0);
    let step = if count > 1.0 { width * (left / (count * count - 1.0)).sqrt() } else { 0.0 };
    Parts { count, width: width * widened, step }
}

/// A direction to a viewer, kept above the plane of the tile.
pub(super) fn above(o: Vec3) -> DVec3 {
    let o = o.as_dvec3();
    DVec3::new(o.x, o.y, o.z.max(LOWEST)).normalize_or(DVec3::Z)
}

/// The width of a part of a pixel at this cosine of the viewer.
pub(super) fn part_width(width: f64, cosine: f64) -> f64 {
    parts(width, cosine).width
}

impl FilteredTile {
    /// Replaces `f̄` of lights by the reflectance of a pixel [1/sr], the lights' cosines included. `far` holds `f̄` and
    /// is not changed if the tile is far away. Directions are unit vectors in the tile frame, above the horizon.
    pub fn eval_lights(
        &self,
        pixel: &PixelOnTile,
        lights: &[Vec3],
        o: Vec3,
        materials: &PixelMaterials<'_>,
        calibration: &Calibration,
        far: &mut [Vec3],
    ) {
        let o = above(o);
        let Parts { count, width, step } = parts(pixel.width, o.z);
        if width >= self.far() || !width.is_finite() {
            return;
        }
        let along = o.truncate().normalize_or(DVec2::X);
        let mut values = vec![DVec3::ZERO; lights.len()];
        for part in 0..count as usize {
            let offset = (part as f64 - 0.5 * (count - 1.0)) * step;
            self.add_part(
                &PixelOnTile { centre: pixel.centre + along * offset, width },
                lights,
                o,
                materials,
                &mut values,
            );
        }
        self.times_far(lights, o, width, materials, far, &mut values);
        for ((far, value), light) in far.iter_mut().zip(&values).zip(lights) {
            *far = (*value / count).as_vec3() * calibration.at(self, width, light.as_dvec3(), o);
        }
    }

    /// Adds the reflectance of a part of a pixel that is as long as wide, by the model of the relief alone.
    pub(super) fn add_part(
        &self,
        part: &PixelOnTile,
        lights: &[Vec3],
        o: DVec3,
        materials: &PixelMaterials<'_>,
        values: &mut [DVec3],
    ) {
        let at = self.seen_through(part.centre, o, part.width);
        let content = self.content(at, part.width);
        let reflectance = PixelReflectance::new(&content, materials, self.map().slope_axes(), self.map().count(), o);
        for (value, light) in values.iter_mut().zip(lights) {
            let i = light.as_dvec3();
            let lit = self.lit(at, i, part.width);
            if lit > 0.0 {
                *value += reflectance.towards(i) * lit;
            }
        }
    }

    /// Brings values of pixels of this width to `f̄` as far as they filter slopes away: where all slopes are, the model
    /// must agree with `f̄`, of which it is an approximation. An analytic surface is the model itself.
    pub(super) fn times_far(
        &self,
        lights: &[Vec3],
        o: DVec3,
        width: f64,
        materials: &PixelMaterials<'_>,
        far: &[Vec3],
        values: &mut [DVec3],
    ) {
        let left = self.left(width);
        if left < LEAST_LEFT || self.is_analytic {
            return;
        }
        let whole = self.whole();
        let model = PixelReflectance::new(&whole, materials, self.map().slope_axes(), self.map().count(), o);
        for ((far, value), light) in far.iter().zip(values).zip(lights) {
            let (exact, model) = (far.as_dvec3(), model.towards(light.as_dvec3()));
            let least = DVec3::splat(1e-9 + 1e-4 * exact.max_element());
            let ratio = ((exact + least) / (model + least))
                .clamp(DVec3::splat(1.0 / MOST_CORRECTION), DVec3::splat(MOST_CORRECTION));
            *value *= ratio.powf(left);
        }
    }

    /// Replaces `f̄` by what each pixel of an image holds. Edges keep the samples of the image.
    ///
    /// # Errors
    /// An invalid camera, or [`crate::base::Error::Cancelled`].
    pub fn shade_into(
        &self,
        image: &mut Image,
        input: &RenderInput,
        materials: ShadedMaterials<'_>,
        corrections: Corrections,
        cancel: &Cancel,
    ) -> Result<()> {
        let view = CameraView::new(input.camera, input.mesh, input.size)?;
        let scale = scale_of(self.size(), input);
        let nearest = ((view.eye - input.mesh.bounds.center).length() - input.mesh.bounds.radius).max(view.near);
        let width_at = |depth: f32| scale * f64::from(view.pixel_extent() * depth);
        if width_at(nearest) >= self.far() {
            return Ok(());
        }
        let points = ShadingPoints::new(input.mesh, &view, input.samples_per_side);
        let materials = PixelMaterials::new(materials);
        let Some(widths) = widths(&points, view.eye, &width_at) else { return Ok(()) };
        let calibration = &match corrections {
            Corrections::Measured => self.calibrated(&materials, input.reflectance, widths, cancel)?,
            Corrections::Known => self.known_calibration(),
        };
        let tile_pixels = TilePixels { view, points, scale, far: self.far() };
        tile_pixels.replace(image, input, cancel, |_, pixel, lights, o, values| {
            self.eval_lights(pixel, lights, o, &materials, calibration, values);
        })
    }
}

/// Tile units per world unit on the object.
pub(super) fn scale_of(tile_size: DVec2, input: &RenderInput) -> f64 {
    tile_size.min_element() / f64::from(TILE_RADII * input.mesh.bounds.radius)
}

/// The points of an object in an image, and the pixels that they are on its tiles.
pub(super) struct TilePixels {
    pub view: CameraView,
    pub points: ShadingPoints,
    /// Tile units per world unit.
    pub scale: f64,
    /// Width of a pixel [tile units] from which it keeps `f̄`.
    pub far: f64,
}

impl TilePixels {
    /// Replaces `f̄` in an image. `shade` receives the number of a point, its pixel, the directions to the lights that it
    /// sees and to the viewer, and their `f̄`, which it replaces.
    pub fn replace(
        &self,
        image: &mut Image,
        input: &RenderInput,
        cancel: &Cancel,
        shade: impl Fn(usize, &PixelOnTile, &[Vec3], Vec3, &mut [Vec3]) + Sync,
    ) -> Result<()> {
        let Self { view, points, scale, far } = self;
        let Some(anchor) = anchor(input, view, points) else { return Ok(()) };
        let visibility = input
            .occluder
            .map(|occluder| occluder.visible_lights(input.mesh, points, input.lights, view.eye, input.shadow_cache));
        let changes: Vec<Vec3> = (0..points.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|point| {
                let (position, z, x) = (points.positions[point], points.normals[point], points.tangents[point]);
                let depth = (view.eye - position).length();
                let width = scale * f64::from(view.pixel_extent() * depth);
                if width >= *far || cancel.is_set() {
                    return Vec3::ZERO;
                }
                let y = z.cross(x);
                let local = |d: Vec3| Vec3::new(d.dot(x), d.dot(y), d.dot(z));
                let lights = input.lights.iter().enumerate().filter(|(k, light)| {
                    light.direction.dot(z) > 0.0
                        && visibility.as_ref().is_none_or(|visibility| visibility.is_lit(point, *k))
                });
                let (directions, irradiances): (Vec<Vec3>, Vec<Vec3>) =
                    lights.map(|(_, light)| (local(light.direction), light.irradiance)).unzip();
                if directions.is_empty() {
                    return Vec3::ZERO;
                }
                let o = local((view.eye - position) / depth);
                let mut far = vec![Vec3::ZERO; directions.len()];
                input.reflectance.eval_lights(&directions, o, &mut far);
                let mut near = far.clone();
                let centre = anchor.along_surface(position).as_dvec2() * *scale;
                shade(point, &PixelOnTile { centre, width }, &directions, o, &mut near);
                near.iter().zip(&far).zip(&irradiances).map(|((near, far), e)| (*near - *far) * *e).sum()
            })
            .collect();
        cancel.check()?;
        for ((&pixel, &weight), change) in points.pixels.iter().zip(&points.weights).zip(changes) {
            let pixel = &mut image.pixels[pixel as usize];
            *pixel = (*pixel + change * weight).max(Vec3::ZERO);
        }
        Ok(())
    }
}

/// Smallest and largest width of a part of the pixels [tile units]; `None` without pixels.
fn widths(points: &ShadingPoints, eye: Vec3, width_at: &dyn Fn(f32) -> f64) -> Option<(f64, f64)> {
    let of = |k: usize| {
        let away = eye - points.positions[k];
        let cosine = points.normals[k].dot(away.normalize_or(points.normals[k]));
        part_width(width_at(away.length()), f64::from(cosine))
    };
    (0..points.len()).map(of).fold(None, |range, width| {
        let (low, high) = range.unwrap_or((width, width));
        Some((width.min(low), width.max(high)))
    })
}
