//! Shadow rays on wgpu: the twin of [`Occluder::visible`], through the same hierarchy (`shaders/light_rays.wgsl`).
//! One thread traces the rays of one point to 32 lights. Rays start where the CPU's start; their answers stay on the device.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use super::bvh;
use super::gpu_batches::Batches;
use super::shading_points::ShadingPoints;
use super::shadow::{Occluder, Visible, ray_origin};
use super::{DirectionalLight, ObjectMesh};
use crate::cancel::Cancel;
use crate::error::Result;
use crate::gpu::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};

/// Rays of the first submission, and the most of any.
const BATCH_RAYS: [u64; 2] = [1 << 16, 1 << 24];
const THREADS: u32 = 64;
/// The stack in the shader.
const STACK: usize = 64;
const _: () = assert!(bvh::MAX_DEPTH + 4 <= STACK);

/// `light_rays.wgsl`, compiled: build once, use for any object.
#[derive(Debug)]
pub struct GpuLightRays {
    layout: wgpu::BindGroupLayout,
    trace: wgpu::ComputePipeline,
}

/// An object's hierarchy on the device; made once per mesh.
#[derive(Debug)]
pub struct GpuOccluder {
    nodes: wgpu::Buffer,
    blockers: wgpu::Buffer,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Params {
    first_point: u32,
    end_point: u32,
    light_count: u32,
    words_per_point: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Node {
    low: Vec3,
    first: u32,
    high: Vec3,
    count: u32,
}

/// A vector and padding to the 16 bytes WGSL gives it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Padded {
    v: Vec3,
    pad: u32,
}

impl From<Vec3> for Padded {
    fn from(v: Vec3) -> Self {
        Self { v, pad: 0 }
    }
}

impl GpuOccluder {
    pub fn new(gpu: &Gpu, occluder: &Occluder) -> std::result::Result<Self, GpuError> {
        let nodes = occluder.bvh.nodes.iter();
        let nodes: Vec<Node> = nodes
            .map(|node| Node { low: node.bounds.low, first: node.first, high: node.bounds.high, count: node.count })
            .collect();
        let blockers = occluder.bvh.blockers.iter();
        let blockers: Vec<[Padded; 3]> =
            blockers.map(|b| [b.corner, b.edges[0], b.edges[1]].map(Padded::from)).collect();
        Ok(Self {
            nodes: gpu.upload("object hierarchy", &nodes, wgpu::BufferUsages::STORAGE)?,
            blockers: gpu.upload("object blockers", &blockers, wgpu::BufferUsages::STORAGE)?,
        })
    }
}

impl GpuLightRays {
    pub fn new(gpu: &Gpu) -> std::result::Result<Self, GpuError> {
        let module = gpu.module("light_rays")?;
        let bindings = [UNIFORM, READ, READ, READ, READ, WRITE];
        let layout = gpu.layout("light rays", wgpu::ShaderStages::COMPUTE, &bindings)?;
        Ok(Self { trace: gpu.compute_pipeline(&module, "trace", &[&layout])?, layout })
    }

    /// One bit per point and light, as [`Occluder::visible`] answers it but for rounding, in the order of [`Visible`]'s words.
    ///
    /// # Errors
    /// What the device refuses, or [`crate::Error::Cancelled`].
    #[expect(clippy::too_many_arguments, reason = "what to trace, and where")]
    pub fn trace(
        &self,
        gpu: &Gpu,
        occluder: &GpuOccluder,
        mesh: &ObjectMesh,
        points: &ShadingPoints,
        lights: &[DirectionalLight],
        eye: Vec3,
        cancel: &Cancel,
    ) -> Result<wgpu::Buffer> {
        use wgpu::BufferUsages as Usage;
        let words = Visible::words_of(lights.len());
        let bytes = (4 * words * points.len()) as u64;
        let bits = gpu.buffer("light visibility", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        if points.is_empty() || lights.is_empty() {
            return Ok(bits);
        }
        let origin = |point: usize| ray_origin(mesh, points.triangles[point] as usize, points.positions[point], eye).0;
        let rays: Vec<[Padded; 2]> =
            (0..points.len()).into_par_iter().map(|k| [origin(k).into(), points.normals[k].into()]).collect();
        let light_data: Vec<[Padded; 2]> =
            lights.iter().map(|light| [light.direction.into(), finite_inverse(light.direction).into()]).collect();

        let params = gpu.buffer("parameters", size_of::<Params>() as u64, Usage::UNIFORM | Usage::COPY_DST)?;
        let point_buffer = gpu.upload("shading points", &rays, Usage::STORAGE)?;
        let light_buffer = gpu.upload("lights", &light_data, Usage::STORAGE)?;
        let bound = [&params, &occluder.nodes, &occluder.blockers, &point_buffer, &light_buffer, &bits];
        let group = gpu.group("light rays", &self.layout, &bound.map(|buffer| buffer.as_entire_binding()))?;
        let (light_count, words_per_point) = (lights.len() as u32, words as u32);
        Batches::of(points.len(), lights.len() as u64, BATCH_RAYS, THREADS).each(gpu, cancel, |points| {
            let [first_point, end_point] = [points.start, points.end].map(|n| n as u32);
            gpu.write(&params, &[Params { first_point, end_point, light_count, words_per_point }])?;
            gpu.checked("tracing light rays", || {
                let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_pipeline(&self.trace);
                pass.set_bind_group(0, &group, &[]);
                pass.dispatch_workgroups((end_point - first_point).div_ceil(THREADS), words_per_point, 1);
                drop(pass);
                gpu.queue.submit([encoder.finish()]);
                Ok(())
            })
        })?;
        Ok(bits)
    }

    /// The same, read back.
    ///
    /// # Errors
    /// As [`GpuLightRays::trace`].
    pub fn visible(
        &self,
        gpu: &Gpu,
        occluder: &GpuOccluder,
        mesh: &ObjectMesh,
        points: &ShadingPoints,
        lights: &[DirectionalLight],
        eye: Vec3,
    ) -> Result<Visible> {
        let bits = self.trace(gpu, occluder, mesh, points, lights, eye, &Cancel::default())?;
        let mut visible = Visible::none(points.len(), lights.len());
        let answers: Vec<u32> = gpu.read(&bits)?;
        let count = visible.words.len();
        visible.words.copy_from_slice(&answers[..count]);
        Ok(visible)
    }
}

/// `1 / direction` with very large numbers in place of infinities, which shaders need not support.
fn finite_inverse(direction: Vec3) -> Vec3 {
    direction.recip().clamp(Vec3::splat(-1e30), Vec3::splat(1e30))
}
