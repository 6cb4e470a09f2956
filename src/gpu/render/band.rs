//! Room on the device for one picture: its samples, and the points of a band of its rows.
//!
//! Bands go through the same buffers one after the other, so that memory is bounded; what tells them apart is in small
//! uniform blocks, all written before the submission.

use std::ops::Range;

use super::gbuffer::{Camera, GpuGBuffer, GpuObject, GpuSamples, Point};
use super::image;
use super::image::GpuImages;
use super::light_rays::{GpuLightRays, GpuOccluder};
use crate::gpu::shading::{GpuShading, Light, MAX_POINTS};
use crate::gpu::{Gpu, GpuError, Tier, shading};
use crate::render::shadow::Visible;

/// Bytes of the buffers that bands share.
const BAND_BYTES: usize = 256 << 20;
/// Threads that keep a graphics processor busy: so many points need no further slices of the lights.
const BUSY: usize = 1 << 20;
/// Lights of a slice. On software Vulkan never more: see `SOFTWARE_FACETS` in gpu_shading/direct.rs.
const MIN_SLICE: usize = 8;

/// What the room is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Need {
    /// Pixels.
    pub size: [usize; 2],
    pub samples_per_side: usize,
    pub lights: usize,
    /// The most points of a band, as far as work goes.
    pub points: usize,
}

/// The parts of a renderer that bands are bound to.
pub(super) struct Parts<'a> {
    pub gbuffer: &'a GpuGBuffer,
    pub object: &'a GpuObject,
    pub rays: Option<&'a (GpuLightRays, GpuOccluder)>,
    pub shading: &'a GpuShading,
    pub images: &'a GpuImages,
}

#[derive(Debug)]
pub(super) struct Room {
    pub need: Need,
    pub samples: GpuSamples,
    /// Lights that one thread adds up, and rows of radiance.
    pub slice: u32,
    pub slices: u32,
    pub words: u32,
    pub lights: wgpu::Buffer,
    pub radiance: wgpu::Buffer,
    /// Points of the last band, and where their rays start.
    #[cfg(test)]
    pub found: [wgpu::Buffer; 2],
    /// Of the samples, the points and where their rays start.
    pub to_points: wgpu::BindGroup,
    pub to_bits: Option<wgpu::BindGroup>,
    pub bands: Vec<Band>,
}

/// Rows of pixels.
#[derive(Debug)]
pub(super) struct Band {
    pub rows: Range<usize>,
    camera: wgpu::Buffer,
    params: wgpu::Buffer,
    image: wgpu::Buffer,
    pub scene: wgpu::BindGroup,
    pub rays: Option<wgpu::BindGroup>,
    pub shading: wgpu::BindGroup,
    pub pixels: wgpu::BindGroup,
}

impl Room {
    pub fn new(gpu: &Gpu, need: Need, parts: &Parts) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let [width, height] = need.size;
        let slots = need.samples_per_side * need.samples_per_side;
        let shadowed = parts.rays.is_some();
        let words = if shadowed { Visible::words_of(need.lights) } else { 0 };
        let most_slices = need.lights.div_ceil(MIN_SLICE).max(1);
        let slices = match gpu.tier {
            Tier::Hardware => {
                (BUSY / (width * height * slots).min(need.points.max(width * slots))).clamp(1, most_slices)
            }
            _ => most_slices,
        };
        let slice = need.lights.div_ceil(slices).max(1);
        let slices = need.lights.div_ceil(slice).max(1);
        let bytes = size_of::<Point>() + 16 + 16 * slices + 4 * words + 4;
        let a_row = width * slots;
        if a_row > MAX_POINTS || slices > 65_535 {
            let what = format!("{} lights on {width} pixels a row", need.lights);
            return Err(GpuError::Unsupported(what));
        }
        let rows = need.points.min(BAND_BYTES / bytes).min(MAX_POINTS) / a_row;
        let rows = rows.clamp(1, height);
        let most = (rows * a_row) as u64;

        let samples = GpuSamples::new(gpu, need.size.map(|side| side * need.samples_per_side))?;
        let room = |label, bytes| gpu.buffer(label, bytes, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC);
        let lights = room("lights", (size_of::<Light>() * need.lights) as u64)?;
        let points = room("shading points", size_of::<Point>() as u64 * most)?;
        let origins = room("origins of rays", if shadowed { 16 * most } else { 0 })?;
        let bits = room("light visibility", 4 * words as u64 * most)?;
        let radiance = room("radiance", 16 * slices as u64 * most)?;
        let scales = room("scales", 4 * most)?;
        let to_bits = parts.rays.map(|(rays, occluder)| rays.rays(gpu, occluder, &origins, &bits)).transpose()?;
        let bands = (0..height).step_by(rows).map(|first| {
            let uniform = |label, bytes: usize| gpu.buffer(label, bytes as u64, Usage::UNIFORM | Usage::COPY_DST);
            let camera = uniform("camera", size_of::<Camera>())?;
            let params = uniform("parameters", size_of::<shading::Params>())?;
            let image = uniform("picture", size_of::<image::Params>())?;
            let rays = parts.rays.map(|(rays, _)| rays.points(gpu, [&params, &points, &lights]));
            let shading = [&params, &points, &lights, &bits, &radiance, &scales];
            Ok(Band {
                rows: first..(first + rows).min(height),
                scene: parts.gbuffer.scene(gpu, parts.object, &camera)?,
                rays: rays.transpose()?,
                shading: parts.shading.points(gpu, shading)?,
                pixels: parts.images.points(gpu, [&image, &points, &radiance])?,
                camera,
                params,
                image,
            })
        });
        let bands = bands.collect::<Result<_, GpuError>>()?;
        let to_points = parts.gbuffer.samples(gpu, &samples, &points, &origins)?;
        let [slice, slices, words] = [slice, slices, words].map(|n| n as u32);
        Ok(Self {
            need,
            samples,
            slice,
            slices,
            words,
            lights,
            radiance,
            #[cfg(test)]
            found: [points, origins],
            to_points,
            to_bits,
            bands,
        })
    }

    /// Points a pixel.
    pub fn slots(&self) -> u32 {
        (self.need.samples_per_side * self.need.samples_per_side) as u32
    }

    /// GridCoordinates for points in a band.
    pub fn places(&self, band: &Band) -> u32 {
        (band.rows.len() * self.need.size[0]) as u32 * self.slots()
    }
}

impl Band {
    pub fn write(
        &self,
        gpu: &Gpu,
        camera: Camera,
        params: shading::Params,
        image: image::Params,
    ) -> Result<(), GpuError> {
        gpu.write(&self.camera, &[camera])?;
        gpu.write(&self.params, &[params])?;
        gpu.write(&self.image, &[image])
    }
}
