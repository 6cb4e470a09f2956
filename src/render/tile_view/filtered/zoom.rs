//! A zoom towards the middle of an image, from far away to the tile itself.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::object::{PixelOnTile, part_width};
use super::radiance::PixelMaterials;
use super::surface::FilteredTile;
use crate::base::{Cancel, InputError, Result};
use crate::effective::Reflectance;
use crate::render::image::gbuffer::GBuffer;
use crate::render::image::raster::NO_TRIANGLE;
use crate::render::image::shading_points::ShadingPoints;
use crate::render::tile_view::ShadedMaterials;
use crate::render::tile_view::on_object::TILE_RADII;
use crate::render::{CameraView, RenderScene};
use crate::scene::Camera;

/// Pixels along a side of the tile over which the mean is taken: twice as many as lie beside each other, within bounds.
const FEWEST: f64 = 40.0;
const MOST: f64 = 96.0;

/// The middle of an image, towards which a zoom goes: its frame and the lights that it sees.
#[derive(Debug)]
pub struct ZoomTarget {
    camera: Camera,
    /// Distance of the middle from the centre of the object along the line of sight [radii].
    depth: f32,
    /// Extent of a pixel at unit depth.
    pixel_extent: f32,
    near: f32,
    o: Vec3,
    lights: Vec<Vec3>,
    irradiances: Vec<Vec3>,
}

impl ZoomTarget {
    /// Finds the surface in the middle of an image of this size.
    ///
    /// # Errors
    /// An invalid camera, or an image whose middle is background.
    pub fn new(scene: &RenderScene, size: [usize; 2]) -> Result<Self> {
        let mesh = scene.mesh();
        let view = CameraView::new(&scene.camera, mesh, size)?;
        // The middle pixel of an odd image looks along the axis.
        let middle = CameraView::new(&scene.camera, mesh, [129, 129])?;
        let buffer = GBuffer::new(mesh, &middle, 1);
        let k = 64 * 129 + 64;
        if buffer.triangles[k] == NO_TRIANGLE {
            let expected = "an object in the middle of the image, towards which the zoom goes";
            return Err(InputError::new("camera", "an image whose middle is background", expected).into());
        }
        let (position, z, x) = (buffer.positions[k], buffer.normals[k], buffer.tangents[k]);
        let points = ShadingPoints {
            pixels: vec![0],
            weights: vec![1.0],
            positions: vec![position],
            normals: vec![z],
            tangents: vec![x],
            triangles: vec![buffer.triangles[k]],
        };
        let all = &scene.lights().directional;
        let visibility = scene.occluder().map(|occluder| occluder.visible_lights(mesh, &points, all, view.eye, None));
        let y = z.cross(x);
        let local = |d: Vec3| Vec3::new(d.dot(x), d.dot(y), d.dot(z));
        let is_lit = |k: usize| visibility.as_ref().is_none_or(|visibility| visibility.is_lit(0, k));
        let lit = all.iter().enumerate().filter(|(k, light)| light.direction.dot(z) > 0.0 && is_lit(*k));
        let (lights, irradiances) = lit.map(|(_, light)| (local(light.direction), light.irradiance)).unzip();
        let (center, radius) = (mesh.bounds.center, mesh.bounds.radius);
        Ok(Self {
            camera: scene.camera.clone(),
            depth: (position - center).dot(view.back) / radius,
            pixel_extent: view.pixel_extent(),
            near: view.near / radius,
            o: local(view.back),
            lights,
            irradiances,
        })
    }

    /// The camera that shows this many pixels per tile in the middle.
    ///
    /// # Errors
    /// A camera that would be too near or too far.
    pub fn camera(&self, pixels_per_tile: f64) -> Result<Camera> {
        let away = TILE_RADII / (self.pixel_extent * pixels_per_tile as f32);
        let distance = self.depth + away;
        // Surfaces before the near plane are cut off.
        let largest = TILE_RADII / (self.pixel_extent * self.near * 1.2);
        if away < 1.2 * self.near || !(0.01..=1e4).contains(&distance) {
            let smallest = TILE_RADII / (self.pixel_extent * 9e3);
            let expected = format!("{smallest:.2} to {largest:.0} pixels per tile at this size and field of view");
            return Err(InputError::new("--zoom", format!("{pixels_per_tile} pixels per tile"), expected).into());
        }
        Ok(Camera { distance, ..self.camera.clone() })
    }

    /// The mean radiance over a whole tile at the middle.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn mean(
        &self,
        tile: &FilteredTile,
        materials: ShadedMaterials<'_>,
        reflectance: &dyn Reflectance,
        pixels_per_tile: f64,
        cancel: &Cancel,
    ) -> Result<DVec3> {
        let mut far = vec![Vec3::ZERO; self.lights.len()];
        reflectance.eval_lights(&self.lights, self.o, &mut far);
        let materials = PixelMaterials::new(materials);
        let width = tile.size().min_element() / pixels_per_tile;
        let widest = part_width(width, f64::from(self.o.z));
        let calibration = tile.calibrated(&materials, reflectance, (widest, widest), cancel)?;
        let counts = (tile.size() * 2.0 / width).ceil().clamp(DVec2::splat(FEWEST), DVec2::splat(MOST));
        let [columns, rows] = [counts.x as usize, counts.y as usize];
        let radiance = |k: usize| -> DVec3 {
            if cancel.is_set() {
                return DVec3::ZERO;
            }
            let place = (DVec2::new((k % columns) as f64, (k / columns) as f64) + 0.5) / counts;
            let mut values = far.clone();
            let pixel = PixelOnTile { centre: place * tile.size(), width };
            tile.eval_lights(&pixel, &self.lights, self.o, &materials, &calibration, &mut values);
            values.iter().zip(&self.irradiances).map(|(value, e)| (*value * *e).as_dvec3()).sum()
        };
        // The order of the sum does not depend on the number of threads.
        let values: Vec<DVec3> = (0..columns * rows).into_par_iter().with_min_len(16).map(radiance).collect();
        cancel.check()?;
        Ok(values.iter().sum::<DVec3>() / values.len() as f64)
    }
}
