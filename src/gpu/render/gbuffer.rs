//! The G-buffer and its shading points on the GPU: the twin of [`GBuffer`](crate::render::GBuffer) and
//! [`ShadingPoints`](crate::render::image::shading_points::ShadingPoints), by the same rules.
//!
//! A raster pass writes only the triangle of each sample. A compute pass intersects each sample's ray with that
//! triangle, interpolates, and lets samples share a point (`gbuffer.wgsl`). GPU and CPU agree except at edges, where
//! the triangle may be the neighbour, because GPUs snap vertices to their own subpixels.
//!
//! A pixel has one slot per sample, so points need not be counted before shading. An empty slot costs only a test of
//! its weight.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::gpu::device::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};
use crate::render::image::gbuffer::MIN_COSINE;
use crate::render::shadow::LIFT;
use crate::render::{CameraView, ObjectMesh};

const IDS: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The compiled pipelines of `gbuffer.wgsl`, for any object and camera.
#[derive(Debug)]
pub(crate) struct GpuGBuffer {
    scene: wgpu::BindGroupLayout,
    samples: wgpu::BindGroupLayout,
    /// Pipelines without and with back faces (two-sided surfaces).
    draw: [wgpu::RenderPipeline; 2],
    find_points: wgpu::ComputePipeline,
}

/// The mesh of an object on the GPU.
#[derive(Debug)]
pub(crate) struct GpuObject {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    triangles: u32,
    two_sided: bool,
    /// Distance of the starts of shadow rays above the surface.
    lift: f32,
}

/// The triangle and the depth of each sample of an image.
#[derive(Debug)]
pub(crate) struct GpuSamples {
    triangle_ids: wgpu::TextureView,
    depth: wgpu::TextureView,
}

/// `Point` in `point.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct GpuPoint {
    pub position: Vec3,
    /// Share of its pixel; 0 if the slot is empty.
    pub weight: f32,
    pub normal: Vec3,
    pub triangle: u32,
    pub tangent: Vec3,
    pub pad: u32,
}

/// `Camera` in `gbuffer.wgsl`, for one band of rows.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct GpuCamera {
    eye: Vec3,
    near: f32,
    right: Vec3,
    tan_half_fov_x: f32,
    up: Vec3,
    tan_half_fov_y: f32,
    back: Vec3,
    min_cosine: f32,
    size: [u32; 2],
    first_row: u32,
    rows: u32,
    samples: u32,
    pixel_extent: f32,
    lift: f32,
    two_sided: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Vertex {
    position: Vec3,
    pad_p: u32,
    normal: Vec3,
    pad_n: u32,
    tangent: Vec3,
    pad_t: u32,
}

impl GpuObject {
    pub fn new(gpu: &Gpu, mesh: &ObjectMesh) -> Result<Self, GpuError> {
        let vertices = mesh.positions.iter().zip(&mesh.normals).zip(&mesh.tangents);
        let vertices: Vec<Vertex> = vertices.map(|((&p, &n), &t)| Vertex::new(p, n, t)).collect();
        Ok(Self {
            vertices: gpu.upload("object vertices", &vertices, wgpu::BufferUsages::STORAGE)?,
            indices: gpu.upload("object triangles", &mesh.triangles, wgpu::BufferUsages::STORAGE)?,
            triangles: mesh.triangles.len() as u32,
            two_sided: mesh.two_sided,
            lift: LIFT * mesh.bounds.radius,
        })
    }
}

impl GpuSamples {
    /// Creates textures for a number of samples across and down.
    pub fn new(gpu: &Gpu, [width, height]: [usize; 2]) -> Result<Self, GpuError> {
        let (side, max_side) = (width.max(height) as u64, u64::from(gpu.limits.max_texture_dimension_2d));
        if side > max_side {
            return Err(GpuError::TooLarge { what: "a side of the image".to_owned(), needed: side, allowed: max_side });
        }
        let target = |format, usage| {
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("G-buffer"),
                size: wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        gpu.checked("allocating the G-buffer", || {
            let triangle_ids = target(IDS, wgpu::TextureUsages::TEXTURE_BINDING);
            Ok(Self { triangle_ids, depth: target(DEPTH, wgpu::TextureUsages::empty()) })
        })
    }
}

impl GpuGBuffer {
    /// `shadowed`: whether the starts of shadow rays are computed for points.
    pub fn new(gpu: &Gpu, shadowed: bool) -> Result<Self, GpuError> {
        let module = gpu.module("gbuffer")?;
        let stages = wgpu::ShaderStages::VERTEX | wgpu::ShaderStages::COMPUTE;
        let scene = gpu.layout("object", stages, &[UNIFORM, READ, READ])?;
        let triangle_ids = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Uint,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let samples = gpu.layout("G-buffer", wgpu::ShaderStages::COMPUTE, &[triangle_ids, WRITE, WRITE])?;
        let draw = [Some(wgpu::Face::Back), None];
        let [culled, both] = draw.map(|cull| draw_pipeline(gpu, &module, &scene, cull));
        let constants = [("SHADOWED", f64::from(u8::from(shadowed)))];
        let find_points = gpu.compute_pipeline_with(&module, "find_points", &[&scene, &samples], &constants)?;
        Ok(Self { scene, samples, draw: [culled?, both?], find_points })
    }

    pub fn scene(&self, gpu: &Gpu, object: &GpuObject, camera: &wgpu::Buffer) -> Result<wgpu::BindGroup, GpuError> {
        let bound = [camera, &object.vertices, &object.indices];
        gpu.group("object", &self.scene, &bound.map(wgpu::Buffer::as_entire_binding))
    }

    pub fn samples(
        &self,
        gpu: &Gpu,
        samples: &GpuSamples,
        points: &wgpu::Buffer,
        origins: &wgpu::Buffer,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let triangle_ids = wgpu::BindingResource::TextureView(&samples.triangle_ids);
        gpu.group("G-buffer", &self.samples, &[triangle_ids, points.as_entire_binding(), origins.as_entire_binding()])
    }

    /// Records drawing the object with the camera of `scene`.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        samples: &GpuSamples,
        scene: &wgpu::BindGroup,
        object: &GpuObject,
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites>,
    ) {
        let color = wgpu::RenderPassColorAttachment {
            view: &samples.triangle_ids,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store },
        };
        let depth = wgpu::RenderPassDepthStencilAttachment {
            view: &samples.depth,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
            stencil_ops: None,
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("G-buffer"),
            color_attachments: &[Some(color)],
            depth_stencil_attachment: Some(depth),
            timestamp_writes,
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_pipeline(&self.draw[usize::from(object.two_sided)]);
        pass.set_bind_group(0, scene, &[]);
        pass.draw(0..3 * object.triangles, 0..1);
    }

    /// Records finding the points of a band of pixels.
    pub fn find_points(
        &self,
        pass: &mut wgpu::ComputePass,
        scene: &wgpu::BindGroup,
        samples: &wgpu::BindGroup,
        pixels: [u32; 2],
    ) {
        pass.set_pipeline(&self.find_points);
        pass.set_bind_group(0, scene, &[]);
        pass.set_bind_group(1, samples, &[]);
        pass.dispatch_workgroups(pixels[0].div_ceil(8), pixels[1].div_ceil(8), 1);
    }
}

/// Creates the pipeline that draws the numbers of triangles, with reversed depth.
fn draw_pipeline(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    scene: &wgpu::BindGroupLayout,
    cull_mode: Option<wgpu::Face>,
) -> Result<wgpu::RenderPipeline, GpuError> {
    let layout = gpu.pipeline_layout(&[scene])?;
    let description = wgpu::RenderPipelineDescriptor {
        label: Some("G-buffer"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("project"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState { cull_mode, ..wgpu::PrimitiveState::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("write_triangle_id"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(IDS.into())],
        }),
        multiview_mask: None,
        cache: None,
    };
    gpu.checked("building the G-buffer pipeline", || Ok(gpu.device.create_render_pipeline(&description)))
}

impl GpuCamera {
    /// `rows`: rows of pixels of the band.
    pub fn new(view: &CameraView, object: &GpuObject, samples_per_side: usize, rows: Range<usize>) -> Self {
        Self {
            eye: view.eye,
            near: view.near,
            right: view.right,
            tan_half_fov_x: view.tan_half_fov.x,
            up: view.up,
            tan_half_fov_y: view.tan_half_fov.y,
            back: view.back,
            min_cosine: MIN_COSINE,
            size: view.size.map(|side| (side * samples_per_side) as u32),
            first_row: rows.start as u32,
            rows: rows.len() as u32,
            samples: samples_per_side as u32,
            pixel_extent: view.pixel_extent(),
            lift: object.lift,
            two_sided: u32::from(object.two_sided),
        }
    }
}

impl Vertex {
    fn new(position: Vec3, normal: Vec3, tangent: Vec3) -> Self {
        Self { position, pad_p: 0, normal, pad_n: 0, tangent, pad_t: 0 }
    }
}
