//! The part of `G` that comes from light between facets, on a coarse grid.

use glam::{DVec3, Vec3};

use crate::math::directions::PolarGrid;

/// `G_indirect` at the nodes of a polar grid for both directions [1/sr]; symmetric.
#[derive(Debug, Clone)]
pub struct InterreflectionTable {
    pub grid: PolarGrid,
    /// Row `o`, column `i`.
    values: Vec<Vec3>,
    /// Rays that met another facet, as a part of all.
    pub met: f64,
}

impl InterreflectionTable {
    /// From `G` at all pairs of nodes, row by row; what noise made unequal is made equal.
    pub(super) fn new(grid: PolarGrid, raw: &[Vec3], met: f64) -> Self {
        let n = grid.len();
        let values = (0..n * n).map(|at| 0.5 * (raw[at] + raw[at % n * n + at / n]).max(Vec3::ZERO)).collect();
        Self { grid, values, met }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.values.as_slice())
    }

    /// `G_indirect(i, o)` of each light into `out` [1/sr]; 0 where either is at or under the horizon.
    pub fn add(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) {
        let n = self.grid.len();
        let to_viewer = self.grid.taps(o);
        for (k, &i) in lights.iter().enumerate() {
            let mut value = Vec3::ZERO;
            if i.z > 0.0 && o.z > 0.0 {
                let to_light = self.grid.taps(i);
                for (row, row_weight) in to_viewer {
                    let row = &self.values[row * n..(row + 1) * n];
                    let along: Vec3 = to_light.iter().map(|&(column, weight)| row[column] * weight).sum();
                    value += along * row_weight;
                }
            }
            out(k, value.as_dvec3());
        }
    }
}
