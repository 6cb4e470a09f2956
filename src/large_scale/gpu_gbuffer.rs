//! The G-buffer on wgpu: the twin of [`GBuffer::new`], into the same arrays and by the same rules.
//!
//! A raster pass writes only which triangle each sample shows; a compute pass meets each sample's ray with that
//! triangle and interpolates (`shaders/gbuffer.wgsl`). The two routes agree but at edges: there the triangle may be the
//! neighbour, because adapters snap vertices to their own subpixels.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::gbuffer::LEAST_COSINE;
use super::raster::NOTHING;
use super::{CameraView, GBuffer, ObjectMesh};
use crate::gpu::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};

/// Bytes of positions resolved at once; larger pictures go in bands of rows.
const BAND_BYTES: u64 = 64 << 20;
const IDS: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// `gbuffer.wgsl`, compiled: build once, use for any object and camera.
#[derive(Debug)]
pub struct GpuGBuffer {
    scene: wgpu::BindGroupLayout,
    samples: wgpu::BindGroupLayout,
    /// Back faces dropped, and kept (two-sided surfaces).
    draw: [wgpu::RenderPipeline; 2],
    resolve: wgpu::ComputePipeline,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Camera {
    eye: Vec3,
    near: f32,
    right: Vec3,
    tan_half_fov_x: f32,
    up: Vec3,
    tan_half_fov_y: f32,
    back: Vec3,
    least_cosine: f32,
    size: [u32; 2],
    first_row: u32,
    rows: u32,
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

/// What one picture is resolved into, band by band.
struct Band {
    triangles: wgpu::Buffer,
    positions: wgpu::Buffer,
    normals: wgpu::Buffer,
    tangents: wgpu::Buffer,
}

impl GpuGBuffer {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("gbuffer")?;
        let stages = wgpu::ShaderStages::VERTEX | wgpu::ShaderStages::COMPUTE;
        let scene = gpu.layout("object", stages, &[UNIFORM, READ, READ])?;
        let shown = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Uint,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let bindings = [shown, WRITE, WRITE, WRITE, WRITE];
        let samples = gpu.layout("G-buffer", wgpu::ShaderStages::COMPUTE, &bindings)?;
        let draw = [Some(wgpu::Face::Back), None];
        let [culled, both] = draw.map(|cull| draw_pipeline(gpu, &module, &scene, cull));
        let resolve = gpu.compute_pipeline(&module, "resolve", &[&scene, &samples])?;
        Ok(Self { scene, samples, draw: [culled?, both?], resolve })
    }

    /// Rasterises the mesh with `samples_per_side²` samples a pixel, as [`GBuffer::new`] does.
    pub fn draw(
        &self,
        gpu: &Gpu,
        mesh: &ObjectMesh,
        view: &CameraView,
        samples_per_side: usize,
    ) -> Result<GBuffer, GpuError> {
        use wgpu::BufferUsages as Usage;
        let [width, height] = view.size.map(|n| n.saturating_mul(samples_per_side));
        let mut buffer = GBuffer { width, height, ..GBuffer::default() };
        let (longer, most) = (width.max(height) as u64, u64::from(gpu.limits.max_texture_dimension_2d));
        if longer > most {
            return Err(GpuError::TooLarge { what: "a side of the picture".to_owned(), needed: longer, allowed: most });
        }
        if width == 0 || height == 0 {
            return Ok(buffer);
        }
        let band_rows = (BAND_BYTES / (12 * width as u64)).clamp(1, height as u64) as usize;
        let vertices = mesh.positions.iter().zip(&mesh.normals).zip(&mesh.tangents);
        let vertices: Vec<Vertex> = vertices.map(|((&p, &n), &t)| Vertex::new(p, n, t)).collect();
        let vertices = gpu.upload("object vertices", &vertices, Usage::STORAGE)?;
        let indices = gpu.upload("object triangles", &mesh.triangles, Usage::STORAGE)?;
        let camera = gpu.upload("camera", &[Camera::new(view, width, height, 0, 0)], Usage::UNIFORM)?;
        let resources = [&camera, &vertices, &indices].map(|b| b.as_entire_binding());
        let scene = gpu.group("object", &self.scene, &resources)?;

        let shown = gpu.checked("drawing the object", || {
            Ok(self.draw_triangles(gpu, &scene, mesh, [width as u32, height as u32]))
        })?;
        let band = Band::new(gpu, (band_rows * width) as u64)?;
        let outputs = [&band.triangles, &band.positions, &band.normals, &band.tangents];
        let mut resources = vec![wgpu::BindingResource::TextureView(&shown)];
        resources.extend(outputs.map(|b| b.as_entire_binding()));
        let samples = gpu.group("G-buffer", &self.samples, &resources)?;
        for first_row in (0..height).step_by(band_rows) {
            let rows = band_rows.min(height - first_row);
            gpu.write(&camera, &[Camera::new(view, width, height, first_row, rows)])?;
            gpu.checked("resolving the G-buffer", || {
                self.resolve_band(gpu, &scene, &samples, width as u32, rows as u32);
                Ok(())
            })?;
            band.append_to(gpu, &mut buffer, rows * width)?;
        }
        Ok(buffer)
    }

    /// Draws the object; gives back the texture of triangles.
    fn draw_triangles(
        &self,
        gpu: &Gpu,
        scene: &wgpu::BindGroup,
        mesh: &ObjectMesh,
        size: [u32; 2],
    ) -> wgpu::TextureView {
        let target = |format, usage| {
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("G-buffer"),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let shown = target(IDS, wgpu::TextureUsages::TEXTURE_BINDING);
        let depth = target(DEPTH, wgpu::TextureUsages::empty());
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let color = wgpu::RenderPassColorAttachment {
            view: &shown,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store },
        };
        let depth = wgpu::RenderPassDepthStencilAttachment {
            view: &depth,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
            stencil_ops: None,
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("G-buffer"),
            color_attachments: &[Some(color)],
            depth_stencil_attachment: Some(depth),
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_pipeline(&self.draw[usize::from(mesh.two_sided)]);
        pass.set_bind_group(0, scene, &[]);
        pass.draw(0..3 * mesh.triangles.len() as u32, 0..1);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
        shown
    }

    fn resolve_band(&self, gpu: &Gpu, scene: &wgpu::BindGroup, samples: &wgpu::BindGroup, width: u32, rows: u32) {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.resolve);
        pass.set_bind_group(0, scene, &[]);
        pass.set_bind_group(1, samples, &[]);
        pass.dispatch_workgroups(width.div_ceil(8), rows.div_ceil(8), 1);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
    }
}

/// Draws triangles by number, nearest first with reversed depth.
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
            entry_point: Some("name_triangle"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(IDS.into())],
        }),
        multiview_mask: None,
        cache: None,
    };
    gpu.checked("building the G-buffer pipeline", || Ok(gpu.device.create_render_pipeline(&description)))
}

impl Camera {
    fn new(view: &CameraView, width: usize, height: usize, first_row: usize, rows: usize) -> Self {
        Self {
            eye: view.eye,
            near: view.near,
            right: view.right,
            tan_half_fov_x: view.tan_half_fov.x,
            up: view.up,
            tan_half_fov_y: view.tan_half_fov.y,
            back: view.back,
            least_cosine: LEAST_COSINE,
            size: [width as u32, height as u32],
            first_row: first_row as u32,
            rows: rows as u32,
        }
    }
}

impl Vertex {
    fn new(position: Vec3, normal: Vec3, tangent: Vec3) -> Self {
        Self { position, pad_p: 0, normal, pad_n: 0, tangent, pad_t: 0 }
    }
}

impl Band {
    fn new(gpu: &Gpu, samples: u64) -> Result<Self, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let vectors = |label| gpu.buffer(label, 12 * samples, usage);
        Ok(Self {
            triangles: gpu.buffer("G-buffer triangles", 4 * samples, usage)?,
            positions: vectors("G-buffer positions")?,
            normals: vectors("G-buffer normals")?,
            tangents: vectors("G-buffer tangents")?,
        })
    }

    fn append_to(&self, gpu: &Gpu, buffer: &mut GBuffer, samples: usize) -> Result<(), GpuError> {
        let triangles: Vec<u32> = gpu.read(&self.triangles)?;
        buffer.triangles.extend(triangles.into_iter().take(samples));
        for (from, to) in [
            (&self.positions, &mut buffer.positions),
            (&self.normals, &mut buffer.normals),
            (&self.tangents, &mut buffer.tangents),
        ] {
            let vectors: Vec<Vec3> = gpu.read(from)?;
            to.extend(vectors.into_iter().take(samples));
        }
        Ok(())
    }
}

/// The shader's own value for a sample that shows nothing.
const _: () = assert!(NOTHING == 0xffff_ffff);
