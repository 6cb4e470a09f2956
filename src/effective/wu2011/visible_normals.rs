//! Matrix N, the BVNDF on nearest normals, factored by random projection and mean subtraction. N itself is never stored
//! (Wu et al. 2011, Sec. 3.4).

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::projection::{fill_normal, right_vectors};
use super::{pair_of_row, rows_of};
use crate::base::Result;
use crate::effective::Wu2011Settings;
use crate::effective::low_rank::bvndf;
use crate::math::directions::{ParaboloidMap, ParaboloidSphere};
use crate::math::linalg::gemm;

/// The facets of one material: their visibility at the directions, and the normal bin of each.
pub(super) struct BinnedFacets<'a> {
    pub directions: &'a ParaboloidMap,
    /// `[direction][facet]`, 0 or 1.
    pub visibility: &'a [f32],
    /// The bins that contain facets, as nodes of the map of normals.
    pub bins: Vec<usize>,
    /// Position in `bins` of each facet's nearest normal.
    pub bin_of_facet: Vec<usize>,
    /// `1/√Ω` of each bin; with this factor, N is a density over the sphere of normals.
    pub bin_weights: Vec<f64>,
}

/// The factors of N on the bins that contain facets: `N_kj ≈ mean_j + Σ_c table_kc vectors_jc`.
#[derive(Debug)]
pub(super) struct NormalFactors {
    pub mean: Vec<f64>,
    /// Row-major `bins x rank`, divided by the weights of the bins.
    pub vectors: Vec<f64>,
    /// `U_N` on all ordered pairs of directions: `[o][i][c]`.
    pub table: Vec<f32>,
    pub rank: usize,
}

/// Facets whose projections are computed together.
const FACETS: usize = 256;

/// First stream of random numbers for N; the blocks of M use streams below it.
const STREAM: u64 = 1 << 40;

impl<'a> BinnedFacets<'a> {
    pub fn new(
        directions: &'a ParaboloidMap,
        visibility: &'a [f32],
        nearest: &[usize],
        normals: &ParaboloidSphere,
    ) -> Self {
        let mut position: BTreeMap<usize, usize> = nearest.iter().map(|&bin| (bin, 0)).collect();
        position.values_mut().enumerate().for_each(|(k, at)| *at = k);
        let bins: Vec<usize> = position.keys().copied().collect();
        let bin_weights = bins.iter().map(|&bin| f64::from(normals.solid_angle(bin)).sqrt().recip()).collect();
        Self {
            directions,
            visibility,
            bin_of_facet: nearest.iter().map(|bin| position[bin]).collect(),
            bins,
            bin_weights,
        }
    }

    fn facets(&self) -> usize {
        self.bin_of_facet.len()
    }

    /// Sums a weighted quantity of the facets into the bins.
    fn binned(&self, weights: &[f32], of_facet: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.bins.len()];
        for (s, &bin) in self.bin_of_facet.iter().enumerate() {
            sums[bin] += f64::from(weights[s]) * of_facet(s);
        }
        sums
    }

    /// Factors N for one set of facet weights, which are areas or areas times a colour weight (Eq. 11).
    ///
    /// # Errors
    /// A factorization that does not converge, or values that are not finite.
    pub fn factor(&self, weights: &[f32], settings: &Wu2011Settings) -> Result<NormalFactors> {
        let (l, bins) = (settings.projection_rows, self.bins.len());
        let nodes = self.directions.len();
        let random = self.weighted_random(l, settings.seed);
        let projected = self.project(&random, l);
        let total: f64 = (0..nodes).map(|node| f64::from(self.directions.solid_angle(node))).sum();
        // The mean over all pairs, weighted by solid angle: (Σ_i Ω_i V_i)² of each facet.
        let mean_visibility: Vec<f64> = (0..self.facets())
            .map(|s| {
                let visible = |node: usize| {
                    f64::from(self.directions.solid_angle(node) * self.visibility[node * self.facets() + s])
                };
                ((0..nodes).map(visible).sum::<f64>() / total).powi(2)
            })
            .collect();
        let mean = self.binned(weights, |s| mean_visibility[s]);
        let scale = 1.0 / (l as f64).sqrt();
        let mut q = DMatrix::zeros(l, bins);
        let mut power_with_mean = 0.0;
        for k in 0..l {
            // Rᵀ D_r 1, the projection of a row of ones.
            let ones: f64 = random[k * nodes * nodes..(k + 1) * nodes * nodes].iter().map(|&x| f64::from(x)).sum();
            let row = self.binned(weights, |s| f64::from(projected[s * l + k]));
            for j in 0..bins {
                q[(k, j)] = (row[j] - ones * mean[j]) * self.bin_weights[j] * scale;
                power_with_mean += (row[j] * self.bin_weights[j] * scale).powi(2);
            }
        }
        let right = right_vectors(&q, settings.keep_n, power_with_mean)?;
        let rank = right.rank;
        let d = &self.bin_weights;
        let mut table = Vec::new();
        if rank > 0 && self.facets() > 0 {
            let mut offset = vec![0.0_f64; rank];
            for j in 0..bins {
                for (c, o) in offset.iter_mut().enumerate() {
                    *o += mean[j] * d[j] * right.vectors[j * rank + c];
                }
            }
            let weighted = |bin: usize| (0..rank).map(move |c| (bin, c));
            let y: Vec<f32> = self
                .bin_of_facet
                .iter()
                .flat_map(|&bin| weighted(bin))
                .map(|(j, c)| (d[j] * right.vectors[j * rank + c]) as f32)
                .collect();
            table = bvndf::node_pair_table(self.visibility, nodes, weights, &y, rank);
            for row in table.chunks_mut(rank) {
                row.iter_mut().zip(&offset).for_each(|(u, o)| *u = (f64::from(*u) - o) as f32);
            }
        }
        let vectors = right.vectors.iter().enumerate().map(|(k, v)| v / d[k / rank]).collect();
        Ok(NormalFactors { mean, vectors, table, rank })
    }

    /// R times the rows' weights `√(Ω_i Ω_o)`, or `√(2 Ω_i Ω_o)` for pairs that represent two ordered pairs. Each of
    /// the `l` columns is the triangle `i <= o` of a square matrix: `[k][o][i]`.
    fn weighted_random(&self, l: usize, seed: u64) -> Vec<f32> {
        let nodes = self.directions.len();
        let rows = rows_of(nodes);
        let mut random = vec![0.0_f32; l * nodes * nodes];
        random.par_chunks_mut(nodes * nodes).enumerate().for_each(|(k, square)| {
            let mut values = vec![0.0; rows];
            fill_normal(seed, STREAM + k as u64, &mut values);
            for (row, value) in values.into_iter().enumerate() {
                let (i, o) = pair_of_row(row);
                let both = self.directions.solid_angle(i) * self.directions.solid_angle(o);
                square[o * nodes + i] = value * if i == o { both } else { 2.0 * both }.sqrt();
            }
        });
        random
    }

    /// `V_sᵀ R_k V_s` of every facet: `[facet][k]`.
    fn project(&self, random: &[f32], l: usize) -> Vec<f32> {
        let (facets, nodes) = (self.facets(), self.directions.len());
        let mut projected = vec![0.0_f32; facets * l];
        projected.par_chunks_mut(FACETS * l).enumerate().for_each(|(block, out)| {
            let count = out.len() / l;
            let first = block * FACETS;
            let visible: Vec<f32> = (0..nodes)
                .flat_map(|node| self.visibility[node * facets + first..node * facets + first + count].iter().copied())
                .collect();
            let mut product = vec![0.0_f32; nodes * count];
            for k in 0..l {
                gemm::multiply(nodes, nodes, count, &random[k * nodes * nodes..], &visible, &mut product);
                let mut sums = vec![0.0_f32; count];
                for (t, v) in product.chunks(count).zip(visible.chunks(count)) {
                    for ((sum, t), v) in sums.iter_mut().zip(t).zip(v) {
                        *sum += t * v;
                    }
                }
                for (s, sum) in sums.into_iter().enumerate() {
                    out[s * l + k] = sum;
                }
            }
        });
        projected
    }
}
