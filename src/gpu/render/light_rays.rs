//! Shadow rays on the GPU: the twin of [`Occluder::visible_lights`], through the same hierarchy (`light_rays.wgsl`).
//! One thread traces the rays of one point to 32 lights.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::gpu::device::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};
use crate::render::shadow::{Occluder, bvh};

const THREADS: u32 = 64;
/// Size of the stack in the shader.
const STACK: usize = 64;
const _: () = assert!(bvh::MAX_DEPTH + 4 <= STACK);

/// The compiled pipeline of `light_rays.wgsl`, for any object.
#[derive(Debug)]
pub(super) struct GpuLightRays {
    points: wgpu::BindGroupLayout,
    rays: wgpu::BindGroupLayout,
    trace: wgpu::ComputePipeline,
}

/// The bounding volume hierarchy of an object on the GPU.
#[derive(Debug)]
pub(super) struct GpuOccluder {
    nodes: wgpu::Buffer,
    blockers: wgpu::Buffer,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Node {
    low: Vec3,
    first: u32,
    high: Vec3,
    count: u32,
}

/// A vector, padded to 16 bytes as in WGSL.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct PaddedVec3 {
    v: Vec3,
    pad: u32,
}

impl GpuOccluder {
    pub fn new(gpu: &Gpu, occluder: &Occluder) -> Result<Self, GpuError> {
        let nodes = occluder.bvh.nodes.iter();
        let nodes: Vec<Node> = nodes
            .map(|node| Node { low: node.bounds.low, first: node.first, high: node.bounds.high, count: node.count })
            .collect();
        let blockers = occluder.bvh.blockers.iter();
        let blockers: Vec<[PaddedVec3; 3]> =
            blockers.map(|b| [b.corner, b.edges[0], b.edges[1]].map(|v| PaddedVec3 { v, pad: 0 })).collect();
        Ok(Self {
            nodes: gpu.upload("object hierarchy", &nodes, wgpu::BufferUsages::STORAGE)?,
            blockers: gpu.upload("object blockers", &blockers, wgpu::BufferUsages::STORAGE)?,
        })
    }
}

impl GpuLightRays {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("light_rays")?;
        let points = gpu.layout("points of rays", wgpu::ShaderStages::COMPUTE, &[UNIFORM, READ, READ])?;
        let rays = gpu.layout("light rays", wgpu::ShaderStages::COMPUTE, &[READ, READ, READ, WRITE])?;
        Ok(Self { trace: gpu.compute_pipeline(&module, "trace", &[&points, &rays])?, points, rays })
    }

    /// Binds parameters of shading, points and lights.
    pub fn points(&self, gpu: &Gpu, bound: [&wgpu::Buffer; 3]) -> Result<wgpu::BindGroup, GpuError> {
        gpu.group("points of rays", &self.points, &bound.map(wgpu::Buffer::as_entire_binding))
    }

    /// Binds the object, the starts of rays, and one bit per point and light in the order of
    /// [`crate::render::shadow::LightVisibility`]'s words.
    pub fn rays(
        &self,
        gpu: &Gpu,
        occluder: &GpuOccluder,
        origins: &wgpu::Buffer,
        bits: &wgpu::Buffer,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let bound = [&occluder.nodes, &occluder.blockers, origins, bits];
        gpu.group("light rays", &self.rays, &bound.map(wgpu::Buffer::as_entire_binding))
    }

    pub fn trace(
        &self,
        pass: &mut wgpu::ComputePass,
        points: &wgpu::BindGroup,
        rays: &wgpu::BindGroup,
        [point_count, words]: [u32; 2],
    ) {
        pass.set_pipeline(&self.trace);
        pass.set_bind_group(0, points, &[]);
        pass.set_bind_group(1, rays, &[]);
        pass.dispatch_workgroups(point_count.div_ceil(THREADS), words, 1);
    }
}
