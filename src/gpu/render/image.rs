//! Gathering of points into pixels on the GPU: the twin of [`gather`](crate::render::image::shading::gather) and of
//! [`ToneMap`]. The output is linear radiance that is read back, or an image for a screen (`image.wgsl`).

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::gpu::device::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};
use crate::render::image::shading::ImageBackground;
use crate::render::image::tone_map::{ToneCurve, ToneMap};

/// Format of an image for a screen: sRGB bytes, written by a shader.
const IMAGE: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Creates a texture for a screen, which shaders can write and sample, and which can be read back.
///
/// # Errors
/// Errors of the GPU.
pub fn image(gpu: &Gpu, [width, height]: [usize; 2]) -> Result<wgpu::Texture, GpuError> {
    use wgpu::TextureUsages as Usage;
    let description = wgpu::TextureDescriptor {
        label: Some("image"),
        size: wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: IMAGE,
        usage: Usage::STORAGE_BINDING | Usage::TEXTURE_BINDING | Usage::COPY_SRC,
        view_formats: &[],
    };
    gpu.checked("allocating an image", || Ok(gpu.device.create_texture(&description)))
}

/// The compiled pipelines of `image.wgsl`.
#[derive(Debug)]
pub(super) struct GpuImages {
    points: wgpu::BindGroupLayout,
    /// Layouts of the outputs: linear radiance, and images.
    outputs: [wgpu::BindGroupLayout; 2],
    write: [wgpu::ComputePipeline; 2],
}

/// The output of rendering.
#[derive(Debug, Clone, Copy)]
pub(super) enum Output<'a> {
    /// Linear radiance, 16 bytes per pixel.
    Radiance(&'a wgpu::Buffer),
    /// An image of [`IMAGE`] with the usage `STORAGE_BINDING`.
    Image(&'a wgpu::TextureView),
}

/// Parameters of one band of rows.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct ImageParams {
    background: Vec3,
    is_wall: u32,
    size: [u32; 2],
    first_row: u32,
    rows: u32,
    slots: u32,
    slices: u32,
    gain: f32,
    is_filmic: u32,
}

impl ImageParams {
    /// `slots`: point slots per pixel; `slices`: rows of radiance.
    pub fn new(
        size: [usize; 2],
        rows: Range<usize>,
        [slots, slices]: [u32; 2],
        background: &ImageBackground,
        tone_map: &ToneMap,
    ) -> Self {
        let (background, is_wall) = match background {
            ImageBackground::Wall => (Vec3::ZERO, 1),
            ImageBackground::Uniform(radiance) => (*radiance, 0),
        };
        Self {
            background,
            is_wall,
            size: size.map(|side| side as u32),
            first_row: rows.start as u32,
            rows: rows.len() as u32,
            slots,
            slices,
            gain: tone_map.gain,
            is_filmic: u32::from(tone_map.curve == ToneCurve::Filmic),
        }
    }
}

impl GpuImages {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("image")?;
        let layout = |label, bindings: &[wgpu::BindingType]| gpu.layout(label, wgpu::ShaderStages::COMPUTE, bindings);
        let image = wgpu::BindingType::StorageTexture {
            access: wgpu::StorageTextureAccess::WriteOnly,
            format: IMAGE,
            view_dimension: wgpu::TextureViewDimension::D2,
        };
        let points = layout("points of pixels", &[UNIFORM, READ, READ])?;
        let outputs = [layout("pixels", &[WRITE])?, layout("image", &[image])?];
        let [radiance, shown] = [("write_radiance", &outputs[0]), ("write_image", &outputs[1])]
            .map(|(entry_point, output)| gpu.compute_pipeline(&module, entry_point, &[&points, output]));
        let write = [radiance?, shown?];
        Ok(Self { points, outputs, write })
    }

    /// Binds [`ImageParams`], points and their radiance.
    pub fn points(&self, gpu: &Gpu, bound: [&wgpu::Buffer; 3]) -> Result<wgpu::BindGroup, GpuError> {
        gpu.group("points of pixels", &self.points, &bound.map(wgpu::Buffer::as_entire_binding))
    }

    pub fn output(&self, gpu: &Gpu, output: Output) -> Result<wgpu::BindGroup, GpuError> {
        match output {
            Output::Radiance(pixels) => gpu.group("pixels", &self.outputs[0], &[pixels.as_entire_binding()]),
            Output::Image(view) => gpu.group("image", &self.outputs[1], &[wgpu::BindingResource::TextureView(view)]),
        }
    }

    /// Records writing a band of pixels to an output.
    pub fn write(
        &self,
        pass: &mut wgpu::ComputePass,
        points: &wgpu::BindGroup,
        (output, group): (Output, &wgpu::BindGroup),
        pixels: [u32; 2],
    ) {
        pass.set_pipeline(&self.write[usize::from(matches!(output, Output::Image(_)))]);
        pass.set_bind_group(0, points, &[]);
        pass.set_bind_group(1, group, &[]);
        pass.dispatch_workgroups(pixels[0].div_ceil(8), pixels[1].div_ceil(8), 1);
    }
}
