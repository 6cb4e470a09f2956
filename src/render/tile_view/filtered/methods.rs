//! Images of a tile under a colour map by the methods with which the filter is compared: the colour of the mean, and rays.

use glam::{DVec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::calibration::Calibration;
use super::object::{TilePixels, scale_of};
use super::radiance::PixelMaterials;
use super::surface::FilteredTile;
use crate::base::{Cancel, Result};
use crate::color_map::naive::NaiveMap;
use crate::render::image::shading_points::ShadingPoints;
use crate::render::tile_view::{ShadedMaterials, TileScene};
use crate::render::{CameraView, Image, RenderInput};

/// Lights that each ray tests.
const LIGHTS_PER_RAY: usize = 4;
/// Lowest elevation of a viewer above the plane of the tile, as a sine.
const LOWEST: f64 = 0.02;

impl TilePixels {
    fn of(input: &RenderInput, tile_size: DVec2) -> Result<Self> {
        let view = CameraView::new(input.camera, input.mesh, input.size)?;
        let points = ShadingPoints::new(input.mesh, &view, input.samples_per_side);
        Ok(Self { view, points, scale: scale_of(tile_size, input), far: f64::INFINITY })
    }
}

impl FilteredTile {
    /// Multiplies what a white tile reflects by the colour of the mean of every driver in each pixel, as mip-mapped drivers
    /// do. The tile, the image and the reflectance of `input` are those of the scene with a white map.
    ///
    /// # Errors
    /// An invalid camera, or [`crate::base::Error::Cancelled`].
    pub fn shade_naive_into(
        &self,
        image: &mut Image,
        input: &RenderInput,
        materials: ShadedMaterials<'_>,
        map: &NaiveMap,
        cancel: &Cancel,
    ) -> Result<()> {
        let (materials, none) = (PixelMaterials::new(materials), Calibration::none());
        TilePixels::of(input, self.size())?.replace(image, input, cancel, |_, pixel, lights, o, values| {
            self.eval_lights(pixel, lights, o, &materials, &none, values);
            let color = self.naive_color(pixel.centre, pixel.width, o, map);
            values.iter_mut().for_each(|value| *value *= color);
        })
    }

    /// The colour of the means of the drivers in a pixel.
    fn naive_color(&self, centre: DVec2, width: f64, o: Vec3, map: &NaiveMap) -> Vec3 {
        let width = width.min(self.width(self.levels() - 1));
        let o = o.as_dvec3();
        let at = self.seen_through(centre, o.with_z(o.z.max(LOWEST)).normalize_or(glam::DVec3::Z), width);
        let relief = self.relief_left(at, width);
        map.color(&self.footprint(at, width), relief.heights.mean, relief.slopes.mean).as_vec3()
    }
}

impl TileScene {
    /// Replaces `f̄` by the mean of a number of rays per point, through random places of its pixel. The mean over many seeds is
    /// the truth of what the pixels show.
    ///
    /// # Errors
    /// An invalid camera, or [`crate::base::Error::Cancelled`].
    pub fn cast_into(
        &self,
        image: &mut Image,
        input: &RenderInput,
        materials: ShadedMaterials<'_>,
        (rays, seed): (usize, u64),
        cancel: &Cancel,
    ) -> Result<()> {
        let pixels = TilePixels::of(input, self.mesh.size.as_dvec2())?;
        pixels.replace(image, input, cancel, |point, pixel, lights, o, values| {
            let mut random = ChaCha8Rng::seed_from_u64(seed << 32 | point as u64);
            input.reflectance.eval_bounced(lights, o, values);
            let along = o.truncate().as_dvec2().normalize_or(DVec2::X);
            let stride = lights.len().div_ceil(LIGHTS_PER_RAY);
            let weight = stride as f32 / rays.max(1) as f32;
            for _ in 0..rays {
                let (x, y) = (random.random::<f64>() - 0.5, random.random::<f64>() - 0.5);
                let offset = along * (x / f64::from(o.z).max(LOWEST)) + along.perp() * y;
                let place = pixel.centre + offset * pixel.width;
                // Small coordinates keep their digits in single precision.
                let place = place - (place / self.mesh.size.as_dvec2()).floor() * self.mesh.size.as_dvec2();
                let Some(hit) = self.visible_through(place.as_vec2(), o) else { continue };
                for k in (random.random_range(0..stride)..lights.len()).step_by(stride) {
                    values[k] += self.reflected(&hit, lights[k], o, materials) * weight;
                }
            }
        })
    }
}
