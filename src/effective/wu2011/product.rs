//! The product of N and M on M's directions (Wu et al. 2011, Eq. 12) as a table over unordered pairs.

use glam::DVec3;
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::material::ChannelFactors;
use super::rows_of;
use super::visible_normals::NormalFactors;
use crate::math::directions::{ParaboloidMap, Tap};
use crate::math::linalg::gemm;

/// One scalar of `G` on the pairs of a map, and its colour.
#[derive(Debug, Clone)]
pub(super) struct NodePairTable {
    /// The value of `i <= o` is at `o(o+1)/2 + i`.
    pub values: Vec<f32>,
    pub tint: DVec3,
}

impl NodePairTable {
    /// Interpolates bilinearly in both directions.
    pub fn eval(&self, light: &[Tap; 4], view: &[Tap; 4]) -> f64 {
        let mut sum = 0.0;
        for &(o, w_o) in view {
            for &(i, w_i) in light {
                let (low, high) = (i.min(o), i.max(o));
                sum += w_o * w_i * self.values[rows_of(high) + low];
            }
        }
        f64::from(sum)
    }
}

/// `Σ_j N_kj M_jk / area` on all pairs of M's directions, to which N is interpolated linearly. `bins` are the columns
/// of M that correspond to N's columns.
pub(super) fn product(
    n: &NormalFactors,
    n_map: &ParaboloidMap,
    bins: &[usize],
    m: &ChannelFactors,
    m_map: &ParaboloidMap,
    area: f64,
) -> Vec<f32> {
    let mixing = mixing(n, bins, m, area);
    let (width, rank) = (n.rank + 1, m.rank + 1);
    let nodes = n_map.len();
    let taps: Vec<[Tap; 4]> = m_map.directions().iter().map(|&d| n_map.taps(d)).collect();
    // U_N is interpolated in the light direction first: [light on M's map][view on N's map][c].
    let mut half = vec![0.0_f32; m_map.len() * nodes * n.rank];
    if n.rank > 0 {
        half.par_chunks_mut(nodes * n.rank).zip(&taps).for_each(|(out, taps)| {
            for &(node, w) in taps {
                // The table is symmetric in its two directions.
                for (out, u) in out.iter_mut().zip(&n.table[node * nodes * n.rank..(node + 1) * nodes * n.rank]) {
                    *out += w * u;
                }
            }
        });
    }
    let rows: Vec<Vec<f32>> = (0..m_map.len())
        .into_par_iter()
        .map(|o| {
            let mut left = vec![0.0_f32; (o + 1) * width];
            for (i, left) in left.chunks_mut(width).enumerate() {
                left[0] = 1.0;
                for &(node, w) in &taps[o] {
                    let at = (i * nodes + node) * n.rank;
                    left[1..].iter_mut().zip(&half[at..at + n.rank]).for_each(|(out, u)| *out += w * u);
                }
            }
            let mut mixed = vec![0.0_f32; (o + 1) * rank];
            gemm::multiply(o + 1, width, rank, &left, &mixing, &mut mixed);
            let first = rows_of(o);
            mixed
                .chunks(rank)
                .enumerate()
                .map(|(i, mixed)| {
                    let at = (first + i) * m.rank;
                    mixed[0] + mixed[1..].iter().zip(&m.coefficients[at..at + m.rank]).map(|(x, u)| x * u).sum::<f32>()
                })
                .collect()
        })
        .collect();
    rows.concat()
}

/// `[mean_N, V_N]ᵀ [mean_M, V_M] / area` over the bins that contain facets, row-major `(rank_N + 1) x (rank_M + 1)`.
fn mixing(n: &NormalFactors, bins: &[usize], m: &ChannelFactors, area: f64) -> Vec<f32> {
    let of = |mean: f64, vectors: &[f64], rank: usize, row: usize, c: usize| {
        if c == 0 { mean } else { vectors[row * rank + c - 1] }
    };
    let left = DMatrix::from_fn(bins.len(), n.rank + 1, |j, c| of(n.mean[j], &n.vectors, n.rank, j, c));
    let right = DMatrix::from_fn(bins.len(), m.rank + 1, |j, c| of(m.mean[bins[j]], &m.vectors, m.rank, bins[j], c));
    let mixed = left.transpose() * right / area;
    mixed.transpose().iter().map(|&x| x as f32).collect()
}
