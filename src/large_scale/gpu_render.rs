//! The picture on wgpu: the twin of [`render`](super::render::render).
//!
//! G-buffer, light rays and shading run on the device; the CPU merges samples into shading points and gathers the picture.
//! Which lights a point sees never leaves the device.

use std::time::Instant;

use super::CameraView;
use super::gpu_gbuffer::GpuGBuffer;
use super::gpu_light_rays::{GpuLightRays, GpuOccluder};
use super::gpu_shading::{GpuMaterial, GpuShading};
use super::render::{RenderInput, Rendered, StageTimes, check_size};
use super::shading;
use super::shading_points::ShadingPoints;
use super::shadow::Occluder;
use crate::cancel::Cancel;
use crate::error::Result;
use crate::filtering::EffectiveBrdf;
use crate::gpu::{Gpu, GpuError};

/// All that stays on the device while the camera turns. Made for one object; the BRDF may be exchanged.
#[derive(Debug)]
pub struct GpuRenderer {
    gbuffer: GpuGBuffer,
    /// Absent where the object cannot shadow itself: then no pass knows of shadows.
    rays: Option<(GpuLightRays, GpuOccluder)>,
    shading: GpuShading,
    material: GpuMaterial,
}

impl GpuRenderer {
    /// # Errors
    /// [`GpuError::Unsupported`] for a BRDF that only the CPU shades, and what the device refuses.
    pub fn new(gpu: &Gpu, occluder: Option<&Occluder>, brdf: &EffectiveBrdf) -> std::result::Result<Self, GpuError> {
        let mut shading = GpuShading::new(gpu)?;
        let material = shading.material(gpu, brdf, occluder.is_some())?;
        let rays = match occluder {
            Some(occluder) => Some((GpuLightRays::new(gpu)?, GpuOccluder::new(gpu, occluder)?)),
            None => None,
        };
        Ok(Self { gbuffer: GpuGBuffer::new(gpu)?, rays, shading, material })
    }

    /// Shades with another BRDF from now on; pipelines that were compiled before are kept.
    ///
    /// # Errors
    /// As [`GpuRenderer::new`]; the BRDF before stays.
    pub fn set_brdf(&mut self, gpu: &Gpu, brdf: &EffectiveBrdf) -> std::result::Result<(), GpuError> {
        self.material = self.shading.material(gpu, brdf, self.rays.is_some())?;
        Ok(())
    }

    /// Renders the object that the renderer was made for; `input.reflectance` and `input.shadow_cache` are not asked.
    ///
    /// # Errors
    /// A size or camera that cannot be, what the device refuses, or [`crate::Error::Cancelled`].
    pub fn render(&self, gpu: &Gpu, input: &RenderInput, cancel: &Cancel) -> Result<Rendered> {
        check_size(input.size, input.samples_per_side)?;
        let view = CameraView::new(input.camera, input.mesh, input.size)?;
        let start = Instant::now();
        let buffer = self.gbuffer.draw(gpu, input.mesh, &view, input.samples_per_side)?;
        let points = ShadingPoints::new(&buffer, &view, input.samples_per_side);
        drop(buffer);
        let after_gbuffer = Instant::now();
        let visible = match &self.rays {
            Some((rays, occluder)) => {
                Some(rays.trace(gpu, occluder, input.mesh, &points, input.lights, view.eye, cancel)?)
            }
            None => None,
        };
        let after_shadows = Instant::now();
        let radiance =
            self.shading.radiance(gpu, &self.material, &points, input.lights, visible.as_ref(), view.eye, cancel)?;
        let picture = shading::gather(&points, &radiance, &view, input.background);
        let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
        let times = StageTimes {
            gbuffer_ms: ms(start, after_gbuffer),
            shadows_ms: ms(after_gbuffer, after_shadows),
            shading_ms: ms(after_shadows, Instant::now()),
        };
        Ok(Rendered { picture, times, points: points.len() })
    }
}

/// One picture on the device; for more than one, keep a [`GpuRenderer`].
///
/// # Errors
/// As [`GpuRenderer::new`] and [`GpuRenderer::render`].
pub fn render_gpu(gpu: &Gpu, input: &RenderInput, brdf: &EffectiveBrdf) -> Result<Rendered> {
    GpuRenderer::new(gpu, input.occluder, brdf)?.render(gpu, input, &Cancel::default())
}
