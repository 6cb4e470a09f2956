//! The pass of a table for pictures: all columns in one.

use bytemuck::{Pod, Zeroable};

use super::column_terms::ColumnTerms;
use super::{GpuShading, Pass, Second, Variant, shadow_swap};
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

/// A table on the device.
pub(crate) struct Held {
    pub(crate) grid: HemispherePairGrid,
    pub(crate) interpolation: Interpolation,
    pub(crate) columns: ColumnTerms,
    /// Those that the projected areas are known for.
    pub(crate) directions: PolarGrid,
    /// As [`ShadingTable::values`] and [`ShadingTable::areas`].
    pub(crate) values: wgpu::Buffer,
    pub(crate) areas: wgpu::Buffer,
}

impl GpuShading {
    pub(super) fn table_pass(&mut self, gpu: &Gpu, form: &ShadingTable, shadowed: bool) -> Result<Pass, GpuError> {
        let columns = ColumnTerms::of(form.weights())?;
        let (directions, areas) = form.areas();
        let usage = wgpu::BufferUsages::STORAGE;
        let held = Held {
            grid: form.grid,
            interpolation: form.interpolation,
            columns,
            directions: *directions,
            values: gpu.upload("table", form.values(), usage)?,
            areas: gpu.upload("projected areas", areas, usage)?,
        };
        self.held_table_pass(gpu, held, shadowed)
    }

    /// The pass of a table whose numbers are on the device, or will be.
    pub(super) fn held_table_pass(&mut self, gpu: &Gpu, held: Held, shadowed: bool) -> Result<Pass, GpuError> {
        let Held { grid, interpolation, columns, directions, values, areas } = held;
        let table = Table {
            pairs: [grid.rings, grid.azimuths, grid.turn, grid.difference].map(|n| n as u32),
            rings: directions.rings as u32,
            azimuths: directions.azimuths as u32,
            crowding: HemispherePairGrid::CROWDING,
            pad: 0,
        };
        let bound =
            [gpu.upload("grids", &[table], wgpu::BufferUsages::UNIFORM)?, columns.on_device(gpu)?, values, areas];
        let cubic = f64::from(u8::from(interpolation == Interpolation::Cubic));
        let variant = Variant {
            shader: "shade_table",
            entry_point: "shade",
            swaps: [shadow_swap(shadowed)].into_iter().chain(columns.swaps()).collect(),
            constants: vec![("FOURS", columns.fours as f64), ("CUBIC", cubic)],
        };
        let resources: Vec<_> = bound.iter().map(wgpu::Buffer::as_entire_binding).collect();
        Ok(Pass {
            pipeline: self.pipeline(gpu, variant, Second::Factors)?,
            group: gpu.group("factors", &self.factors, &resources)?,
            work: (32 * columns.fours + columns.lobes()) as u64,
            each_light: true,
        })
    }
}
