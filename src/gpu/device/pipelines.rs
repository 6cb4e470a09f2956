//! Creation of shader modules, bindings and pipelines. Bindings are numbered in order.

use crate::gpu::{Gpu, GpuError, Swaps, swapped_source};

/// A uniform block.
pub const UNIFORM: wgpu::BindingType = buffer(wgpu::BufferBindingType::Uniform);
/// A storage buffer that shaders read.
pub const READ: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: true });
/// A storage buffer that shaders write.
pub const WRITE: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: false });

const fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

impl Gpu {
    /// Compiles a shader with its imports.
    pub fn module(&self, name: &str) -> Result<wgpu::ShaderModule, GpuError> {
        self.swapped_module(name, &[])
    }

    /// Compiles a shader with its imports, some of them swapped ([`swapped_source`]).
    pub fn swapped_module(&self, name: &str, swaps: Swaps<'_>) -> Result<wgpu::ShaderModule, GpuError> {
        let description = wgpu::ShaderModuleDescriptor {
            label: Some(name),
            source: wgpu::ShaderSource::Wgsl(swapped_source(name, swaps)?.into()),
        };
        self.checked(&format!("compiling the shader {name}"), || Ok(self.device.create_shader_module(description)))
    }

    /// Creates the layout of one group of bindings that `stages` can access.
    pub fn layout(
        &self,
        label: &str,
        stages: wgpu::ShaderStages,
        bindings: &[wgpu::BindingType],
    ) -> Result<wgpu::BindGroupLayout, GpuError> {
        let entries = bindings.iter().zip(0..);
        let entries: Vec<_> = entries
            .map(|(&ty, binding)| wgpu::BindGroupLayoutEntry { binding, visibility: stages, ty, count: None })
            .collect();
        let description = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
        self.checked(&format!("laying out {label}"), || Ok(self.device.create_bind_group_layout(&description)))
    }

    /// Creates a group of bindings in the order of its layout.
    pub fn group(
        &self,
        label: &str,
        layout: &wgpu::BindGroupLayout,
        resources: &[wgpu::BindingResource],
    ) -> Result<wgpu::BindGroup, GpuError> {
        let entries = resources.iter().zip(0..);
        let entries: Vec<_> =
            entries.map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource: resource.clone() }).collect();
        let description = wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries };
        self.checked(&format!("binding {label}"), || Ok(self.device.create_bind_group(&description)))
    }

    /// Creates the layout of pipelines that have these groups of bindings.
    pub fn pipeline_layout(&self, groups: &[&wgpu::BindGroupLayout]) -> Result<wgpu::PipelineLayout, GpuError> {
        let groups: Vec<_> = groups.iter().copied().map(Some).collect();
        let description =
            wgpu::PipelineLayoutDescriptor { label: None, bind_group_layouts: &groups, immediate_size: 0 };
        self.checked("laying out a pipeline", || Ok(self.device.create_pipeline_layout(&description)))
    }

    /// Creates a compute pipeline of one entry point.
    pub fn compute_pipeline(
        &self,
        module: &wgpu::ShaderModule,
        entry_point: &str,
        groups: &[&wgpu::BindGroupLayout],
    ) -> Result<wgpu::ComputePipeline, GpuError> {
        self.compute_pipeline_with(module, entry_point, groups, &[])
    }

    /// Creates a compute pipeline of one entry point with values for some of the module's overridable constants.
    pub fn compute_pipeline_with(
        &self,
        module: &wgpu::ShaderModule,
        entry_point: &str,
        groups: &[&wgpu::BindGroupLayout],
        constants: &[(&str, f64)],
    ) -> Result<wgpu::ComputePipeline, GpuError> {
        let layout = self.pipeline_layout(groups)?;
        let description = wgpu::ComputePipelineDescriptor {
            label: Some(entry_point),
            layout: Some(&layout),
            module,
            entry_point: Some(entry_point),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        };
        self.checked(&format!("building the pipeline {entry_point}"), || {
            Ok(self.device.create_compute_pipeline(&description))
        })
    }

    /// Runs a compute shader of one group of bindings and 64 threads a workgroup for `count` elements, and submits it. Where
    /// they exceed one row of workgroups, the shader counts rows by `num_workgroups`.
    pub fn run_over(
        &self,
        count: u32,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        during: &str,
    ) -> Result<(), GpuError> {
        const THREADS: u32 = 64;
        const MAX_GROUPS: u32 = 65_535;
        let groups = count.div_ceil(THREADS);
        self.checked(during, || {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(groups.min(MAX_GROUPS), groups.div_ceil(MAX_GROUPS), 1);
            drop(pass);
            self.queue.submit([encoder.finish()]);
            Ok(())
        })
    }
}
