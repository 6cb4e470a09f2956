//! The interreflected part of `G` on a grid.

use glam::{DVec3, Vec3};

use crate::math::directions::PolarGrid;

/// `G_indirect` [1/sr] at the nodes of a polar grid for both directions; symmetric.
#[derive(Debug, Clone)]
pub struct InterreflectionTable {
    pub grid: PolarGrid,
    /// Row `o`, column `i`.
    values: Vec<Vec3>,
    /// Fraction of all rays that hit an element.
    pub hit_fraction: f64,
}

impl InterreflectionTable {
    /// Makes a table from `G` at all pairs of nodes, row by row. The two values of a swapped pair, which differ by
    /// noise, are averaged.
    pub(super) fn new(grid: PolarGrid, raw: &[Vec3], hit_fraction: f64) -> Self {
        let n = grid.len();
        let values = (0..n * n).map(|at| 0.5 * (raw[at] + raw[at % n * n + at / n]).max(Vec3::ZERO)).collect();
        Self { grid, values, hit_fraction }
    }

    /// Size of the values in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.values.as_slice())
    }

    /// Calls `out` with the index and `G_indirect(i, o)` [1/sr] of each light; 0 if a direction is at or below the
    /// horizon.
    pub fn eval_lights(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) {
        let n = self.grid.len();
        let to_viewer = self.grid.cubic_taps(o);
        for (k, &i) in lights.iter().enumerate() {
            let mut value = Vec3::ZERO;
            if i.z > 0.0 && o.z > 0.0 {
                let to_light = self.grid.cubic_taps(i);
                for (row, row_weight) in to_viewer {
                    let row = &self.values[row * n..(row + 1) * n];
                    let along: Vec3 = to_light.iter().map(|&(column, weight)| row[column] * weight).sum();
                    value += along * row_weight;
                }
            }
            // A cubic may be below zero; no reflected light is.
            out(k, value.max(Vec3::ZERO).as_dvec3());
        }
    }
}
