//! The weights of the columns of a table: tints, or the lobes of a normal cluster.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::{TintRow, tint_shader};
use crate::brdf::{Term, analytic_lobe};
use crate::effective::Tint;
use crate::effective::shading_table::columns::Weight;
use crate::gpu::{Gpu, GpuError};

/// `Term` in `column_lobes.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Row {
    tint: TintRow,
    normal: Vec3,
    lobe: u32,
    shape: f32,
    scale: f32,
    next: u32,
    pad: u32,
}

impl Row {
    fn of_lobe(term: &Term, normal: Vec3, color: Vec3) -> Result<Self, GpuError> {
        let [kind, shape, scale] = analytic_lobe(term).ok_or_else(measured)?.numbers();
        let tint = TintRow::of(&Tint::Term(term.clone(), color));
        Ok(Self { tint, normal, lobe: 1 + kind as u32, shape, scale, ..Self::default() })
    }
}

/// The terms of all columns, in the order of `column_lobes.wgsl`.
pub(crate) struct ColumnTerms {
    rows: Vec<Row>,
    pub(crate) vec4s: usize,
}

impl ColumnTerms {
    /// Collects the terms of columns.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] if a normal cluster has a measured BRDF.
    pub(crate) fn of(weights: &[Weight]) -> Result<Self, GpuError> {
        let vec4s = weights.len().div_ceil(4);
        let mut rows = vec![Row::default(); 4 * vec4s];
        for (column, weight) in weights.iter().enumerate() {
            match weight {
                Weight::Tint(tint) => rows[column].tint = TintRow::of(tint),
                Weight::Lobes { measured: tables, .. } if !tables.is_empty() => return Err(measured()),
                Weight::Lobes { normal, terms, color, .. } => {
                    let mut index = column;
                    for (k, term) in terms.iter().enumerate() {
                        if k > 0 {
                            rows[index].next = rows.len() as u32;
                            index = rows.len();
                            rows.push(Row::default());
                        }
                        rows[index] = Row::of_lobe(term, *normal, *color)?;
                    }
                }
            }
        }
        Ok(Self { rows, vec4s })
    }

    /// Returns the number of lobes that a query evaluates.
    pub(crate) fn lobes(&self) -> usize {
        self.rows.iter().filter(|row| row.lobe > 0).count()
    }

    /// Returns the swaps for shaders that read these terms.
    pub(crate) fn swaps(&self) -> [(&'static str, &'static str); 2] {
        [
            ("column_tints", if self.lobes() > 0 { "column_lobes" } else { "column_tints" }),
            ("tint_fixed", tint_shader(self.rows.iter().map(|row| &row.tint))),
        ]
    }

    pub(crate) fn upload(&self, gpu: &Gpu) -> Result<wgpu::Buffer, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE;
        if self.lobes() > 0 {
            return gpu.upload("columns", &self.rows, usage);
        }
        let tints: Vec<TintRow> = self.rows.iter().map(|row| row.tint).collect();
        gpu.upload("columns", &tints, usage)
    }
}

fn measured() -> GpuError {
    GpuError::Unsupported("measured BRDFs of normal clusters are evaluated on the CPU only".to_owned())
}
