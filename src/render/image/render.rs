//! From plain data to a picture: all stages in order, each timed.

use std::time::Instant;

use super::shading;
use super::shading::Background;
use super::shading_points::ShadingPoints;
use crate::base::{InputError, Result};
use crate::effective::Reflectance;
use crate::render::shadow::Occluder;
use crate::render::shadow::shadow_cache::ShadowCache;
use crate::render::{CameraView, DirectionalLight, GBuffer, Image, ObjectMesh};
use crate::scene;

/// Most samples (pixels times samples a pixel) of one picture; the G-buffer takes 56 bytes for each at its peak.
pub const MAX_SAMPLES: usize = 1 << 25;

/// All that a picture depends on.
pub struct RenderInput<'a> {
    pub mesh: &'a ObjectMesh,
    /// Made once per mesh by [`Occluder::of`]; `None` leaves self-shadowing out.
    pub occluder: Option<&'a Occluder>,
    /// From [`Occluder::cache`], where the camera moves about a scene that stays: most shadow rays are saved.
    pub shadow_cache: Option<&'a ShadowCache>,
    pub lights: &'a [DirectionalLight],
    pub camera: &'a scene::Camera,
    pub reflectance: &'a dyn Reflectance,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Samples a pixel side; 1 leaves edges jagged.
    pub samples_per_side: usize,
    pub background: &'a Background,
}

/// Milliseconds a stage took.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RenderTimes {
    /// Of visibility and product, where a device makes them with the picture.
    pub product_ms: f64,
    pub gbuffer_ms: f64,
    pub shadows_ms: f64,
    pub shading_ms: f64,
}

#[derive(Debug, Clone, Default)]
pub struct Rendered {
    pub image: Image,
    pub times: RenderTimes,
    /// Points at which the material was evaluated.
    pub points: usize,
}

/// Renders on the CPU; the same input gives the same bits with any number of threads.
pub fn render(input: &RenderInput) -> Result<Rendered> {
    check_size(input.size, input.samples_per_side)?;
    let view = CameraView::new(input.camera, input.mesh, input.size)?;
    let start = Instant::now();
    let buffer = GBuffer::new(input.mesh, &view, input.samples_per_side);
    let points = ShadingPoints::new(&buffer, &view, input.samples_per_side);
    drop(buffer);
    let after_gbuffer = Instant::now();
    let visible = input
        .occluder
        .map(|occluder| occluder.visible(input.mesh, &points, input.lights, view.eye, input.shadow_cache));
    let after_shadows = Instant::now();
    let radiance = shading::radiance(&points, input.lights, visible.as_ref(), view.eye, input.reflectance);
    let image = shading::gather(&points, &radiance, &view, input.background);
    let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
    let times = RenderTimes {
        product_ms: 0.0,
        gbuffer_ms: ms(start, after_gbuffer),
        shadows_ms: ms(after_gbuffer, after_shadows),
        shading_ms: ms(after_shadows, Instant::now()),
    };
    Ok(Rendered { image, times, points: points.len() })
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
