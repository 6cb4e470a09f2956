//! Rendering of one image on the CPU: all stages in order, each timed.

use std::time::Instant;

use super::shading;
use super::shading::ImageBackground;
use super::shading_points::ShadingPoints;
use crate::base::{InputError, Result};
use crate::effective::Reflectance;
use crate::render::shadow::shadow_cache::ShadowCache;
use crate::render::shadow::{LightVisibility, Occluder};
use crate::render::{CameraView, DirectionalLight, Image, ObjectMesh};
use crate::scene;

/// Bounds the samples (pixels times samples per pixel) of one image; a shading point takes 48 bytes, up to 64 more
/// while it is shaded, and most pixels need one.
pub const MAX_SAMPLES: usize = 1 << 25;

/// Everything that an image depends on.
pub struct RenderInput<'a> {
    pub mesh: &'a ObjectMesh,
    /// Built once per mesh by [`Occluder::if_needed`]; `None` switches self-shadowing off.
    pub occluder: Option<&'a Occluder>,
    /// Optional cache from [`Occluder::cache`]; it replaces most shadow rays if only the camera changes between images.
    pub shadow_cache: Option<&'a ShadowCache>,
    pub lights: &'a [DirectionalLight],
    pub camera: &'a scene::Camera,
    pub reflectance: &'a dyn Reflectance,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Samples per pixel side; 1 leaves edges aliased.
    pub samples_per_side: usize,
    /// The relative error of points at which the material is interpolated; 0 evaluates it at every point, as a GPU always does.
    pub tolerance: f32,
    pub background: &'a ImageBackground,
}

/// Time of each stage in milliseconds.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RenderTimes {
    /// Time of visibility and facet sum, if the GPU computes them together with the image; otherwise 0.
    pub product_ms: f64,
    pub gbuffer_ms: f64,
    pub shadows_ms: f64,
    pub shading_ms: f64,
}

impl RenderTimes {
    /// The times of an image without shadows that is finished now.
    pub(crate) fn without_shadows(start: Instant, after_gbuffer: Instant) -> Self {
        let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
        let (gbuffer_ms, shading_ms) = (ms(start, after_gbuffer), ms(after_gbuffer, Instant::now()));
        Self { gbuffer_ms, shading_ms, ..Self::default() }
    }
}

/// A rendered image and its statistics.
#[derive(Debug, Clone, Default)]
pub struct Rendered {
    pub image: Image,
    pub times: RenderTimes,
    /// Number of shading points.
    pub points: usize,
}

/// Renders on the CPU. The same input gives the same bits with any number of threads.
///
/// # Errors
/// The size is not allowed, or the camera is invalid.
pub fn render(input: &RenderInput) -> Result<Rendered> {
    let (visible, times) = VisiblePoints::new(input)?;
    let rendered = visible.shade(input)?;
    Ok(Rendered { times: RenderTimes { shading_ms: rendered.times.shading_ms, ..times }, ..rendered })
}

/// The points that the camera sees, and the lights that reach them. Images of several materials can share them.
#[derive(Debug)]
pub struct VisiblePoints {
    points: ShadingPoints,
    /// Without it, every light is visible.
    visibility: Option<LightVisibility>,
}

impl VisiblePoints {
    /// Finds the points, and the times of both steps. The reflectance is not read.
    ///
    /// # Errors
    /// The size is not allowed, or the camera is invalid.
    pub fn new(input: &RenderInput) -> Result<(Self, RenderTimes)> {
        check_size(input.size, input.samples_per_side)?;
        let view = CameraView::new(input.camera, input.mesh, input.size)?;
        let start = Instant::now();
        let points = ShadingPoints::new(input.mesh, &view, input.samples_per_side);
        let after_gbuffer = Instant::now();
        let visibility = input
            .occluder
            .map(|occluder| occluder.visible_lights(input.mesh, &points, input.lights, view.eye, input.shadow_cache));
        let gbuffer_ms = (after_gbuffer - start).as_secs_f64() * 1e3;
        let shadows_ms = after_gbuffer.elapsed().as_secs_f64() * 1e3;
        Ok((Self { points, visibility }, RenderTimes { gbuffer_ms, shadows_ms, ..RenderTimes::default() }))
    }

    /// Shades the points of the same object, lights and camera in the same size.
    ///
    /// # Errors
    /// The camera is invalid.
    pub fn shade(&self, input: &RenderInput) -> Result<Rendered> {
        let view = CameraView::new(input.camera, input.mesh, input.size)?;
        let start = Instant::now();
        let radiance = shading::radiance(
            &self.points,
            input.lights,
            self.visibility.as_ref(),
            &view,
            input.reflectance,
            input.tolerance,
        );
        let image = shading::gather(&self.points, &radiance, &view, input.background);
        let times = RenderTimes { shading_ms: start.elapsed().as_secs_f64() * 1e3, ..RenderTimes::default() };
        Ok(Rendered { image, times, points: self.points.len() })
    }
}

pub(crate) fn check_size([width, height]: [usize; 2], samples_per_side: usize) -> Result<()> {
    let samples = [width, height, samples_per_side, samples_per_side].into_iter().try_fold(1usize, usize::checked_mul);
    match samples {
        Some(samples) if (1..=MAX_SAMPLES).contains(&samples) => Ok(()),
        _ => {
            let found = format!("{width} x {height} pixels with {samples_per_side} x {samples_per_side} samples each");
            Err(InputError::new("size", found, format!("1 to {MAX_SAMPLES} samples in all")).into())
        }
    }
}

#[cfg(test)]
#[path = "render_tests.rs"]
mod tests;
