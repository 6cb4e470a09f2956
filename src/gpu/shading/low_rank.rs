//! The shading pass of low-rank factors. One pass sums all channels, because only their sum is clamped to be
//! non-negative.

use bytemuck::{Pod, Zeroable};

use super::{GpuShading, Pass, SecondGroup, TintRow, Variant, shadow_swap, tint_shader};
use crate::effective::{ChannelTables, LowRank};
use crate::gpu::{Gpu, GpuError};

/// `Grids` in `shade_low_rank.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Grids {
    rings: u32,
    azimuths: u32,
    nodes: u32,
    channel_count: u32,
    pairs: [u32; 4],
    first_area: u32,
    pad: [u32; 3],
}

/// `Channel` in `shade_low_rank.wgsl`; offsets and columns are in units of four values.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Row {
    first_u: u32,
    first_p: u32,
    columns: u32,
    is_table: u32,
    tint: TintRow,
}

impl GpuShading {
    pub(super) fn low_rank_pass(&mut self, gpu: &Gpu, low_rank: &LowRank, shadowed: bool) -> Result<Pass, GpuError> {
        let (mut u, mut p) = (Vec::new(), Vec::new());
        let rows: Vec<Row> = low_rank.channels.iter().map(|channel| add_channel(channel, &mut u, &mut p)).collect();
        let usage = wgpu::BufferUsages::STORAGE;
        // The areas follow the factors P, because adapters guarantee only eight storage buffers.
        let first_area = (p.len() / 4) as u32;
        p.extend_from_slice(&low_rank.projected_area);
        p.resize(p.len().next_multiple_of(4), 0.0);
        let grids = Grids {
            rings: low_rank.directions.rings as u32,
            azimuths: low_rank.directions.azimuths as u32,
            nodes: low_rank.directions.len() as u32,
            channel_count: rows.len() as u32,
            pairs: [low_rank.pairs.rings, low_rank.pairs.azimuths, low_rank.pairs.theta_d, low_rank.pairs.phi_d]
                .map(|n| n as u32),
            first_area,
            pad: [0; 3],
        };
        let bound = [
            gpu.upload("grids", &[grids], wgpu::BufferUsages::UNIFORM)?,
            gpu.upload("channels", &rows, usage)?,
            gpu.upload("factors U", &u, usage)?,
            gpu.upload("factors P", &p, usage)?,
        ];
        let has = |table: u32| f64::from(u8::from(rows.iter().any(|row| row.is_table == table)));
        let variant = Variant {
            shader: "shade_low_rank",
            entry_point: "shade",
            swaps: vec![shadow_swap(shadowed), ("tint_fixed", tint_shader(rows.iter().map(|row| &row.tint)))],
            constants: vec![("HAS_TABLES", has(1)), ("HAS_FACTORS", has(0))],
        };
        let resources: Vec<_> = bound.iter().map(wgpu::Buffer::as_entire_binding).collect();
        Ok(Pass {
            pipeline: self.pipeline(gpu, variant, SecondGroup::Factors)?,
            group: gpu.group("factors", &self.factors, &resources)?,
            work: rows.iter().map(|row| if row.is_table == 1 { 16 } else { 32 * u64::from(row.columns) }).sum(),
            each_light: true,
        })
    }
}

/// Appends the tables of a channel, with rows padded to multiples of four columns, and returns their offsets.
fn add_channel(channel: &ChannelTables, u: &mut Vec<f32>, p: &mut Vec<f32>) -> Row {
    let [first_u, first_p] = [u.len(), p.len()].map(|at| (at / 4) as u32);
    let columns = channel.columns.div_ceil(4);
    match &channel.p {
        None => u.extend_from_slice(&channel.u),
        Some(factors) => {
            for (table, to) in [(&channel.u, &mut *u), (factors, &mut *p)] {
                to.reserve(table.len() / channel.columns.max(1) * 4 * columns);
                for row in table.chunks(channel.columns.max(1)) {
                    to.extend_from_slice(row);
                    to.resize(to.len().next_multiple_of(4), 0.0);
                }
            }
        }
    }
    u.resize(u.len().next_multiple_of(4), 0.0);
    Row {
        first_u,
        first_p,
        columns: columns as u32,
        is_table: u32::from(channel.p.is_none()),
        tint: TintRow::of(&channel.tint),
    }
}
