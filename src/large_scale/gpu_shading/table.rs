//! The pass of a table for pictures: all columns in one.

use bytemuck::{Pod, Zeroable};

use super::{GpuShading, Pass, Second, TintRow, Variant, shadow_swap, tint_file};
use crate::directions::UpperPairs;
use crate::filtering::{Interpolation, PairTable};
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

impl GpuShading {
    pub(super) fn table_pass(&mut self, gpu: &Gpu, form: &PairTable, shadowed: bool) -> Result<Pass, GpuError> {
        let tints = form.tints().ok_or_else(|| {
            GpuError::Unsupported("tables of what facets of one normal show are read on the CPU only".to_owned())
        })?;
        let mut columns: Vec<TintRow> = tints.into_iter().map(TintRow::of).collect();
        columns.resize(4 * form.fours(), TintRow::default());
        let (areas, at_nodes) = form.areas();
        let grid = form.grid;
        let table = Table {
            pairs: [grid.rings, grid.azimuths, grid.turn, grid.difference].map(|n| n as u32),
            rings: areas.rings as u32,
            azimuths: areas.azimuths as u32,
            crowding: UpperPairs::CROWDING,
            pad: 0,
        };
        let usage = wgpu::BufferUsages::STORAGE;
        let bound = [
            gpu.upload("grids", &[table], wgpu::BufferUsages::UNIFORM)?,
            gpu.upload("columns", &columns, usage)?,
            gpu.upload("table", form.values(), usage)?,
            gpu.upload("projected areas", at_nodes, usage)?,
        ];
        let cubic = f64::from(u8::from(form.interpolation == Interpolation::Cubic));
        let variant = Variant {
            shader: "shade_table",
            entry_point: "shade",
            swaps: vec![shadow_swap(shadowed), ("tint_fixed", tint_file(columns.iter()))],
            constants: vec![("FOURS", form.fours() as f64), ("CUBIC", cubic)],
        };
        let resources: Vec<_> = bound.iter().map(wgpu::Buffer::as_entire_binding).collect();
        Ok(Pass {
            pipeline: self.pipeline(gpu, variant, Second::Factors)?,
            group: gpu.group("factors", &self.factors, &resources)?,
            work: 32 * form.fours() as u64,
            each_light: true,
        })
    }
}
