//! GPU buffers of one image: its samples, and the points of bands of its rows.
//!
//! Bands use the same buffers in turn, so that memory is bounded. If the points and the light visibility of all bands
//! fit, each band has its own buffers for them. The parameters of each band are in small uniform blocks of its own, which
//! are written before the submission.

use std::ops::Range;

use glam::Vec3;

use super::gbuffer::{GpuCamera, GpuGBuffer, GpuObject, GpuPoint, GpuSamples};
use super::image;
use super::image::GpuImages;
use super::light_rays::{GpuLightRays, GpuOccluder};
use crate::gpu::shading::{GpuLight, GpuShading, MAX_POINTS};
use crate::gpu::{Gpu, GpuError, Tier, shading};
use crate::render::shadow::LightVisibility;
use crate::render::{CameraView, DirectionalLight};

/// Largest size of the buffers that bands share, in bytes; also of the points and the light visibility of all bands.
const BAND_BYTES: usize = 256 << 20;
/// Number of threads that keeps a GPU busy. Images with that many points need no slices of the lights.
const BUSY_THREADS: usize = 1 << 20;
/// Smallest number of lights per slice; on a software adapter also the largest (see `SOFTWARE_FACETS`).
const MIN_SLICE: usize = 8;

/// The properties of an image that determine its buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BufferSizes {
    /// Width and height in pixels.
    pub size: [usize; 2],
    pub samples_per_side: usize,
    pub lights: usize,
    /// Largest number of points of a band, to bound its work.
    pub points: usize,
}

/// The parts of a renderer that bands are bound to.
pub(super) struct RendererParts<'a> {
    pub gbuffer: &'a GpuGBuffer,
    pub object: &'a GpuObject,
    pub rays: Option<&'a (GpuLightRays, GpuOccluder)>,
    pub shading: &'a GpuShading,
    pub images: &'a GpuImages,
}

#[derive(Debug)]
pub(super) struct RenderBuffers {
    pub sizes: BufferSizes,
    pub samples: GpuSamples,
    /// Lights per thread, and rows of radiance.
    pub slice: u32,
    pub slices: u32,
    pub words: u32,
    pub lights: wgpu::Buffer,
    pub radiance: wgpu::Buffer,
    /// Points of the last band, and the starts of their shadow rays.
    #[cfg(test)]
    pub points_and_origins: [wgpu::Buffer; 2],
    /// True if each band has buffers for its points and for their light visibility.
    keeps_points: bool,
    /// View and directions of the lights for which the bands hold points and light visibility.
    found_for: Option<(CameraView, Vec<Vec3>)>,
    pub bands: Vec<Band>,
}

/// Points and their light visibility.
#[derive(Clone)]
struct PointBuffers {
    points: wgpu::Buffer,
    bits: wgpu::Buffer,
}

/// A band of rows of pixels.
#[derive(Debug)]
pub(super) struct Band {
    pub rows: Range<usize>,
    camera: wgpu::Buffer,
    params: wgpu::Buffer,
    image: wgpu::Buffer,
    pub scene: wgpu::BindGroup,
    /// Bindings of the samples, the points and the starts of shadow rays.
    pub to_points: wgpu::BindGroup,
    pub rays: Option<wgpu::BindGroup>,
    pub to_bits: Option<wgpu::BindGroup>,
    pub shading: wgpu::BindGroup,
    pub pixels: wgpu::BindGroup,
}

impl RenderBuffers {
    pub fn new(gpu: &Gpu, sizes: BufferSizes, parts: &RendererParts) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let [width, height] = sizes.size;
        let slots = sizes.samples_per_side * sizes.samples_per_side;
        let shadowed = parts.rays.is_some();
        let words = if shadowed { LightVisibility::words_of(sizes.lights) } else { 0 };
        let max_slices = sizes.lights.div_ceil(MIN_SLICE).max(1);
        let slices = match gpu.tier {
            Tier::Hardware => {
                (BUSY_THREADS / (width * height * slots).min(sizes.points.max(width * slots))).clamp(1, max_slices)
            }
            _ => max_slices,
        };
        let slice = sizes.lights.div_ceil(slices).max(1);
        let slices = sizes.lights.div_ceil(slice).max(1);
        let bytes = size_of::<GpuPoint>() + 16 + 16 * slices + 4 * words + 4;
        let points_per_row = width * slots;
        if points_per_row > MAX_POINTS || slices > 65_535 {
            let what = format!("{} lights on {width} pixels per row", sizes.lights);
            return Err(GpuError::Unsupported(what));
        }
        let rows = sizes.points.min(BAND_BYTES / bytes).min(MAX_POINTS) / points_per_row;
        let rows = rows.clamp(1, height);
        let max_points = (rows * points_per_row) as u64;

        let samples = GpuSamples::new(gpu, sizes.size.map(|side| side * sizes.samples_per_side))?;
        let buffer = |label, bytes| gpu.buffer(label, bytes, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC);
        let lights = buffer("lights", (size_of::<GpuLight>() * sizes.lights) as u64)?;
        let origins = buffer("origins of rays", if shadowed { 16 * max_points } else { 0 })?;
        let point_buffers = |count: u64| -> Result<PointBuffers, GpuError> {
            Ok(PointBuffers {
                points: buffer("shading points", size_of::<GpuPoint>() as u64 * count)?,
                bits: buffer("light visibility", 4 * words as u64 * count)?,
            })
        };
        let keeps_points = height * points_per_row * (size_of::<GpuPoint>() + 4 * words) <= BAND_BYTES;
        let of_last_band = point_buffers(max_points)?;
        let radiance = buffer("radiance", 16 * slices as u64 * max_points)?;
        let scales = buffer("scales", 4 * max_points)?;
        let bands = (0..height).step_by(rows).map(|first| {
            let PointBuffers { points, bits } =
                if keeps_points && first + rows < height { point_buffers(max_points)? } else { of_last_band.clone() };
            let uniform = |label, bytes: usize| gpu.buffer(label, bytes as u64, Usage::UNIFORM | Usage::COPY_DST);
            let camera = uniform("camera", size_of::<GpuCamera>())?;
            let params = uniform("parameters", size_of::<shading::ShadingParams>())?;
            let image = uniform("image", size_of::<image::ImageParams>())?;
            let rays = parts.rays.map(|(rays, _)| rays.points(gpu, [&params, &points, &lights]));
            let to_bits = parts.rays.map(|(rays, occluder)| rays.rays(gpu, occluder, &origins, &bits));
            let shading = [&params, &points, &lights, &bits, &radiance, &scales];
            Ok(Band {
                rows: first..(first + rows).min(height),
                scene: parts.gbuffer.scene(gpu, parts.object, &camera)?,
                to_points: parts.gbuffer.samples(gpu, &samples, &points, &origins)?,
                rays: rays.transpose()?,
                to_bits: to_bits.transpose()?,
                shading: parts.shading.points(gpu, shading)?,
                pixels: parts.images.points(gpu, [&image, &points, &radiance])?,
                camera,
                params,
                image,
            })
        });
        let bands = bands.collect::<Result<_, GpuError>>()?;
        let [slice, slices, words] = [slice, slices, words].map(|n| n as u32);
        Ok(Self {
            sizes,
            samples,
            slice,
            slices,
            words,
            lights,
            radiance,
            #[cfg(test)]
            points_and_origins: [of_last_band.points, origins],
            keeps_points,
            found_for: None,
            bands,
        })
    }

    /// Returns true if the buffers hold the points and the light visibility of this view under these lights.
    pub fn holds(&self, view: &CameraView, lights: &[DirectionalLight]) -> bool {
        self.found_for.as_ref().is_some_and(|(of, directions)| {
            of == view && directions.iter().eq(lights.iter().map(|light| &light.direction))
        })
    }

    /// Records that points and light visibility of this view were computed.
    pub fn set_found(&mut self, view: CameraView, lights: &[DirectionalLight]) {
        self.found_for = self.keeps_points.then(|| (view, lights.iter().map(|light| light.direction).collect()));
    }

    /// Returns the number of point slots per pixel.
    pub fn slots(&self) -> u32 {
        (self.sizes.samples_per_side * self.sizes.samples_per_side) as u32
    }

    /// Returns the number of point slots of a band.
    pub fn point_slots(&self, band: &Band) -> u32 {
        (band.rows.len() * self.sizes.size[0]) as u32 * self.slots()
    }
}

impl Band {
    pub fn write(
        &self,
        gpu: &Gpu,
        camera: GpuCamera,
        params: shading::ShadingParams,
        image: image::ImageParams,
    ) -> Result<(), GpuError> {
        gpu.write(&self.camera, &[camera])?;
        gpu.write(&self.params, &[params])?;
        gpu.write(&self.image, &[image])
    }
}
