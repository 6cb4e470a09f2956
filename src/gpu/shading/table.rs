//! The shading pass of a table: one pass for all columns.

use bytemuck::{Pod, Zeroable};

use super::column_terms::ColumnTerms;
use super::{GpuShading, Pass, SecondGroup, Variant, shadow_swap};
use crate::effective::{Interpolation, ShadingTable};
use crate::gpu::{Gpu, GpuError};
use crate::math::directions::{HemispherePairGrid, PolarGrid};

/// `Table` in `shade_table.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Table {
    pairs: [u32; 4],
    rings: u32,
    azimuths: u32,
    crowding: f32,
    pad: u32,
}

/// A shading table in GPU buffers.
pub(crate) struct GpuTable {
    pub(crate) grid: HemispherePairGrid,
    pub(crate) interpolation: Interpolation,
    pub(crate) columns: ColumnTerms,
    /// Directions of the projected areas.
    pub(crate) directions: PolarGrid,
    /// Values in the layout of [`ShadingTable::values`].
    pub(crate) values: wgpu::Buffer,
    /// Areas in the layout of [`ShadingTable::areas`].
    pub(crate) areas: wgpu::Buffer,
}

impl GpuShading {
    pub(super) fn table_pass(&mut self, gpu: &Gpu, table: &ShadingTable, shadowed: bool) -> Result<Pass, GpuError> {
        let columns = ColumnTerms::of(table.weights())?;
        let (directions, areas) = table.areas();
        let usage = wgpu::BufferUsages::STORAGE;
        let table = GpuTable {
            grid: table.grid,
            interpolation: table.interpolation,
            columns,
            directions: *directions,
            values: gpu.upload("table", table.values(), usage)?,
            areas: gpu.upload("projected areas", areas, usage)?,
        };
        self.gpu_table_pass(gpu, table, shadowed)
    }

    /// Creates the pass of a table in GPU buffers, which may still be empty.
    pub(super) fn gpu_table_pass(&mut self, gpu: &Gpu, table: GpuTable, shadowed: bool) -> Result<Pass, GpuError> {
        let GpuTable { grid, interpolation, columns, directions, values, areas } = table;
        let table = Table {
            pairs: [grid.rings, grid.azimuths, grid.phi_d, grid.theta_d].map(|n| n as u32),
            rings: directions.rings as u32,
            azimuths: directions.azimuths as u32,
            crowding: HemispherePairGrid::CROWDING,
            pad: 0,
        };
        let bound = [gpu.upload("grids", &[table], wgpu::BufferUsages::UNIFORM)?, columns.upload(gpu)?, values, areas];
        let cubic = f64::from(u8::from(interpolation == Interpolation::Cubic));
        let variant = Variant {
            shader: "shade_table",
            entry_point: "shade",
            swaps: [shadow_swap(shadowed)].into_iter().chain(columns.swaps()).collect(),
            constants: vec![("FOURS", columns.vec4s as f64), ("CUBIC", cubic)],
        };
        let resources: Vec<_> = bound.iter().map(wgpu::Buffer::as_entire_binding).collect();
        Ok(Pass {
            pipeline: self.pipeline(gpu, variant, SecondGroup::Factors)?,
            group: gpu.group("factors", &self.factors, &resources)?,
            work: (32 * columns.vec4s + columns.lobes()) as u64,
            each_light: true,
        })
    }
}
