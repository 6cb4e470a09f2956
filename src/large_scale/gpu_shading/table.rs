//! The pass of a table for pictures: all columns in one.

use bytemuck::{Pod, Zeroable};

use super::{GpuShading, Pass, Second, TintRow, Variant, shadow_swap, tint_file};
use crate::directions::{PolarGrid, UpperPairs};
use crate::filtering::{Interpolation, PairTable, Tint};
use crate::gpu::{Gpu, GpuError};

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
pub(super) struct Held<'a> {
    pub(super) grid: UpperPairs,
    pub(super) interpolation: Interpolation,
    /// Of each column.
    pub(super) tints: Vec<&'a Tint>,
    /// Those that the projected areas are known for.
    pub(super) directions: PolarGrid,
    /// As [`PairTable::values`] and [`PairTable::areas`].
    pub(super) values: wgpu::Buffer,
    pub(super) areas: wgpu::Buffer,
}

impl GpuShading {
    pub(super) fn table_pass(&mut self, gpu: &Gpu, form: &PairTable, shadowed: bool) -> Result<Pass, GpuError> {
        let tints = form.tints().ok_or_else(|| {
            GpuError::Unsupported("tables of what facets of one normal show are read on the CPU only".to_owned())
        })?;
        let (directions, areas) = form.areas();
        let usage = wgpu::BufferUsages::STORAGE;
        let held = Held {
            grid: form.grid,
            interpolation: form.interpolation,
            tints,
            directions: *directions,
            values: gpu.upload("table", form.values(), usage)?,
            areas: gpu.upload("projected areas", areas, usage)?,
        };
        self.held_table_pass(gpu, held, shadowed)
    }

    /// The pass of a table whose numbers are on the device, or will be.
    pub(super) fn held_table_pass(&mut self, gpu: &Gpu, held: Held, shadowed: bool) -> Result<Pass, GpuError> {
        let Held { grid, interpolation, tints, directions, values, areas } = held;
        let fours = tints.len().div_ceil(4);
        let mut columns: Vec<TintRow> = tints.into_iter().map(TintRow::of).collect();
        columns.resize(4 * fours, TintRow::default());
        let table = Table {
            pairs: [grid.rings, grid.azimuths, grid.turn, grid.difference].map(|n| n as u32),
            rings: directions.rings as u32,
            azimuths: directions.azimuths as u32,
            crowding: UpperPairs::CROWDING,
            pad: 0,
        };
        let bound = [
            gpu.upload("grids", &[table], wgpu::BufferUsages::UNIFORM)?,
            gpu.upload("columns", &columns, wgpu::BufferUsages::STORAGE)?,
            values,
            areas,
        ];
        let cubic = f64::from(u8::from(interpolation == Interpolation::Cubic));
        let variant = Variant {
            shader: "shade_table",
            entry_point: "shade",
            swaps: vec![shadow_swap(shadowed), ("tint_fixed", tint_file(columns.iter()))],
            constants: vec![("FOURS", fours as f64), ("CUBIC", cubic)],
        };
        let resources: Vec<_> = bound.iter().map(wgpu::Buffer::as_entire_binding).collect();
        Ok(Pass {
            pipeline: self.pipeline(gpu, variant, Second::Factors)?,
            group: gpu.group("factors", &self.factors, &resources)?,
            work: 32 * fours as u64,
            each_light: true,
        })
    }
}
