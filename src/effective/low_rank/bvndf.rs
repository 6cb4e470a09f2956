//! The BVNDF, matrix N, in the metric of the rotated basis, by random projection; N itself is never stored (Wu et al.
//! 2011, Sec. 3.4).

use glam::Vec3;
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::gram::{rank_for, right_singular};
use crate::base::Result;
use crate::math::directions::PolarGrid;
use crate::math::linalg::gemm;
use crate::visibility::Visibility;

/// Visibility of a group of facets on the nodes of a direction grid, dense: `[node][facet]`.
#[derive(Debug)]
pub struct VisibilityRows {
    pub grid: PolarGrid,
    pub facets: usize,
    pub rows: Vec<f32>,
}

impl VisibilityRows {
    /// Evaluates the visibility of a run of facets.
    pub fn new(visibility: &Visibility, facets: std::ops::Range<usize>, grid: PolarGrid) -> Self {
        let mut rows = vec![0.0; grid.len() * facets.len()];
        rows.par_chunks_mut(facets.len().max(1))
            .enumerate()
            .for_each(|(node, row)| visibility.fill(grid.direction(node), facets.clone(), row));
        Self { grid, facets: facets.len(), rows }
    }

    /// Interpolates each facet's visibility along any direction, as a query of [`LowRank`](crate::effective::LowRank)
    /// does.
    pub fn read(&self, direction: Vec3, out: &mut [f32]) {
        out.fill(0.0);
        let taper = PolarGrid::horizon_taper(direction.z);
        for (node, weight) in self.grid.taps(direction) {
            let row = &self.rows[node * self.facets..][..self.facets];
            for (out, v) in out.iter_mut().zip(row) {
                *out += taper * weight * v;
            }
        }
    }

    /// The rows of a run of facets.
    pub fn part(&self, facets: std::ops::Range<usize>) -> Self {
        let rows = self.rows.chunks(self.facets.max(1)).flat_map(|row| row[facets.clone()].iter().copied()).collect();
        Self { grid: self.grid, facets: facets.len(), rows }
    }

    /// The rows times `(n·d)+` of each facet.
    pub fn with_cosines(&self, normals: &[Vec3]) -> Self {
        let grid = self.grid;
        let mut rows = self.rows.clone();
        rows.par_chunks_mut(self.facets.max(1)).enumerate().for_each(|(node, row)| {
            let direction = grid.direction(node);
            for (v, normal) in row.iter_mut().zip(normals) {
                *v *= normal.dot(direction).max(0.0);
            }
        });
        Self { rows, ..*self }
    }
}

/// Number of random vectors beyond twice the largest rank.
const EXTRA: usize = 20;

/// Computes the leading right vectors of N in the metric of the features, row-major `features x rank`, and the rank.
///
/// The Khatri-Rao projection is `Q = Σ_s w_s (g·V_s)(h·V_s) x_s` with random pairs `(g, h)`, weighted by √(solid
/// angle).
///
/// # Errors
/// A factorization that does not converge, or values that are not finite.
pub fn leading_features(
    visibility: &VisibilityRows,
    weights: &[f32],
    features: &[f32],
    feature_count: usize,
    kept: f64,
    max_rank: usize,
    seed: u64,
) -> Result<(Vec<f32>, usize)> {
    let (facets, nodes) = (visibility.facets, visibility.grid.len());
    let count = 2 * max_rank + EXTRA;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut random = || -> Vec<f32> {
        (0..count * nodes).map(|k| gaussian(&mut rng) * visibility.grid.solid_angle(k % nodes).sqrt()).collect()
    };
    let (g, h) = (random(), random());
    let project = |vectors: &[f32]| {
        let mut out = vec![0.0; count * facets];
        gemm::multiply_parallel(count, nodes, facets, vectors, &visibility.rows, &mut out);
        out
    };
    let mut mixed = project(&g);
    for (row, other) in mixed.chunks_mut(facets.max(1)).zip(project(&h).chunks(facets.max(1))) {
        for ((x, y), w) in row.iter_mut().zip(other).zip(weights) {
            *x *= y * w;
        }
    }
    let mut q = vec![0.0; count * feature_count];
    gemm::multiply_parallel(count, facets, feature_count, &mixed, features, &mut q);
    let sketch = DMatrix::<f64>::from_fn(count, feature_count, |k, f| f64::from(q[k * feature_count + f]));
    let limit = max_rank.min(feature_count);
    let (_, vectors) = right_singular(&sketch, |values| rank_for(values, kept).min(limit))?;
    let rank = vectors.ncols();
    let leading = (0..feature_count)
        .flat_map(|f| {
            (0..rank).map({
                let vectors = &vectors;
                move |k| vectors[(f, k)] as f32
            })
        })
        .collect();
    Ok((leading, rank))
}

/// A normally distributed number (Box and Muller).
fn gaussian(rng: &mut ChaCha8Rng) -> f32 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    (radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()) as f32
}

/// `U_c(i,o) = Σ_s w_s y_c(s) V_s(i) V_s(o)` on all pairs of nodes, `[o][i][c]` with `c` contiguous. `y` is row-major
/// `facets x columns`. Each column is a weighted Gram matrix, symmetric in `i` and `o` and computed in blocks of views.
pub fn visibility_table(visibility: &VisibilityRows, weights: &[f32], y: &[f32], columns: usize) -> Vec<f32> {
    node_pair_table(&visibility.rows, visibility.grid.len(), weights, y, columns)
}

/// [`visibility_table`] with values at some pairs of nodes `(o, i)` only; all others are 0.
pub fn visibility_at(
    visibility: &VisibilityRows,
    weights: &[f32],
    y: &[f32],
    columns: usize,
    read: &[(usize, usize)],
) -> Vec<f32> {
    const PAIRS: usize = 64;
    let (facets, nodes) = (visibility.facets, visibility.grid.len());
    let row = |node: usize| &visibility.rows[node * facets..][..facets];
    let mut sums = vec![0.0_f32; read.len() * columns];
    sums.par_chunks_mut((PAIRS * columns).max(1)).zip(read.par_chunks(PAIRS)).for_each(|(sums, read)| {
        let mut visible = vec![0.0_f32; read.len() * facets];
        for (visible, &(o, i)) in visible.chunks_mut(facets.max(1)).zip(read) {
            for (((visible, v_o), v_i), w) in visible.iter_mut().zip(row(o)).zip(row(i)).zip(weights) {
                *visible = v_o * v_i * w;
            }
        }
        gemm::multiply(read.len(), facets, columns, &visible, y, sums);
    });
    let mut table = vec![0.0_f32; nodes * nodes * columns];
    for (&(o, i), sums) in read.iter().zip(sums.chunks(columns.max(1))) {
        table[(o * nodes + i) * columns..][..columns].copy_from_slice(sums);
    }
    table
}

/// [`visibility_table`] from dense rows `[node][facet]` over any set of directions.
pub(crate) fn node_pair_table(rows: &[f32], nodes: usize, weights: &[f32], y: &[f32], columns: usize) -> Vec<f32> {
    const VIEWS: usize = 48;
    let facets = weights.len();
    let mut table = vec![0.0_f32; nodes * nodes * columns];
    // Blocks on and right of the diagonal are computed; the others mirror them.
    table.par_chunks_mut(VIEWS * nodes * columns).enumerate().for_each(|(block, table)| {
        let first = block * VIEWS;
        let views = (nodes - first).min(VIEWS);
        let width = nodes - first;
        let mut scaled = vec![0.0_f32; views * facets];
        let mut product = vec![0.0_f32; views * width];
        for c in 0..columns {
            for (scaled, row) in scaled.chunks_mut(facets.max(1)).zip(rows[first * facets..].chunks(facets.max(1))) {
                for (s, (x, v)) in scaled.iter_mut().zip(row).enumerate() {
                    *x = v * weights[s] * y[s * columns + c];
                }
            }
            gemm::multiply_transposed(views, facets, width, &scaled, &rows[first * facets..], &mut product);
            for view in 0..views {
                for light in 0..width {
                    table[(view * nodes + first + light) * columns + c] = product[view * width + light];
                }
            }
        }
    });
    for o in 0..nodes {
        for i in 0..(o / VIEWS) * VIEWS {
            let (from, to) = ((i * nodes + o) * columns, (o * nodes + i) * columns);
            table.copy_within(from..from + columns, to);
        }
    }
    table
}

#[cfg(test)]
#[path = "bvndf_tests.rs"]
mod tests;
