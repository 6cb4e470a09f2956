//! The shading pass of interreflection, which follows those of direct reflection.

use bytemuck::{Pod, Zeroable};

use super::{GpuMaterial, GpuShading, Pass, SecondGroup, Variant, shadow_swap};
use crate::gpu::{Gpu, GpuError};
use crate::interreflection::InterreflectionTable;

/// `Grid` in `shade_bounced.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Grid {
    rings: u32,
    columns: u32,
    base_area: f32,
    pad: u32,
}

/// Values of the table that a pair of directions reads: sixteen rows, sixteen columns.
const READS_PER_PAIR: u64 = 256;

impl GpuShading {
    /// Adds the pass to a material. It multiplies by the scales (1/a_v) that the passes of direct reflection write.
    pub(crate) fn add_bounced(
        &mut self,
        gpu: &Gpu,
        material: &mut GpuMaterial,
        table: &InterreflectionTable,
        base_area: f64,
        shadowed: bool,
    ) -> Result<(), GpuError> {
        let starts: Vec<u32> = (0..=table.grid.ring_count()).map(|ring| table.grid.first_node(ring) as u32).collect();
        let values = table.rgb_rows();
        let grid = Grid {
            rings: table.grid.rings as u32,
            columns: (values.len() / table.grid.len()) as u32,
            base_area: base_area as f32,
            pad: 0,
        };
        let usage = wgpu::BufferUsages::STORAGE;
        let bound = [
            gpu.upload("grid", &[grid], wgpu::BufferUsages::UNIFORM)?,
            gpu.upload("rings", &starts, usage)?,
            gpu.upload("light between facets", &values, usage)?,
            gpu.upload::<u32>("nothing", &[], usage)?,
        ];
        let variant = Variant {
            shader: "shade_bounced",
            entry_point: "shade",
            swaps: vec![shadow_swap(shadowed)],
            constants: Vec::new(),
        };
        let resources: Vec<_> = bound.iter().map(wgpu::Buffer::as_entire_binding).collect();
        material.passes.push(Pass {
            pipeline: self.pipeline(gpu, variant, SecondGroup::Factors)?,
            group: gpu.group("factors", &self.factors, &resources)?,
            work: READS_PER_PAIR,
            each_light: true,
        });
        Ok(())
    }
}
