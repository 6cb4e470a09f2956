//! Rows of M, computed when they are needed. Sums over rows have a fixed order (Wu et al. 2011, Sec. 3.7).

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::projection::fill_normal;
use super::{pair_of_row, rows_of};
use crate::brdf::{Brdf, LobeAngles, Measured, Term, analytic_lobe};
use crate::math::directions::{ParaboloidMap, ParaboloidSphere};
use crate::math::linalg::gemm;
use crate::math::simd;
use crate::math::simd::{Lobe, PairVectors};

/// Rows of M that are computed at a time.
const BLOCK: usize = 64;

/// Parts of the rows whose sums are added in order, so that results do not depend on the number of threads.
const PARTS: usize = 16;

/// Computes rows of M: the cosine-weighted BRDF along a colour direction, at all normals.
pub(super) struct Rows<'a> {
    lobes: Vec<(Lobe, &'a Term)>,
    measured: Vec<&'a Arc<dyn Measured>>,
    pub along: Vec3,
    directions: &'a ParaboloidMap,
    normals: [Vec<f32>; 3],
    /// `√Ω` of each normal.
    pub column_weights: Vec<f64>,
}

/// Buffers for one row.
#[derive(Default)]
struct Scratch {
    values: Vec<f32>,
    angles: Vec<LobeAngles>,
    colors: Vec<Vec3>,
}

/// Sums over rows.
pub(super) struct Sums {
    /// `Rᵀ D_r M`, row-major `l x columns`.
    pub projected: Vec<f64>,
    /// `Rᵀ D_r 1`.
    pub ones: Vec<f64>,
    /// `Σ w² M` per column.
    pub first: Vec<f64>,
    /// `Σ w² M²` per column.
    pub second: Vec<f64>,
    /// `Σ w²`.
    pub weight: f64,
}

impl Sums {
    fn zeros(l: usize, columns: usize) -> Self {
        Self {
            projected: vec![0.0; l * columns],
            ones: vec![0.0; l],
            first: vec![0.0; columns],
            second: vec![0.0; columns],
            weight: 0.0,
        }
    }

    fn add(&mut self, other: &Self) {
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, x)| *t += x);
        add(&mut self.projected, &other.projected);
        add(&mut self.ones, &other.ones);
        add(&mut self.first, &other.first);
        add(&mut self.second, &other.second);
        self.weight += other.weight;
    }
}

impl<'a> Rows<'a> {
    pub fn new(brdf: &'a Brdf, along: Vec3, directions: &'a ParaboloidMap, normals: &ParaboloidSphere) -> Self {
        let component = |pick: fn(Vec3) -> f32| (0..normals.len()).map(|j| pick(normals.direction(j))).collect();
        Self {
            lobes: brdf.terms.iter().filter_map(|term| analytic_lobe(term).map(|lobe| (lobe, term))).collect(),
            measured: brdf.terms.iter().filter_map(Term::measured).collect(),
            along,
            directions,
            normals: [component(|n| n.x), component(|n| n.y), component(|n| n.z)],
            column_weights: (0..normals.len()).map(|j| f64::from(normals.solid_angle(j)).sqrt()).collect(),
        }
    }

    pub fn columns(&self) -> usize {
        self.column_weights.len()
    }

    /// Number of rows.
    pub fn count(&self) -> usize {
        rows_of(self.directions.len())
    }

    /// Power weight `w²` of a row: the product of both solid angles, doubled for a row that represents two ordered
    /// pairs.
    pub fn weight(&self, row: usize) -> f32 {
        let (i, o) = pair_of_row(row);
        let both = self.directions.solid_angle(i) * self.directions.solid_angle(o);
        if i == o { both } else { 2.0 * both }
    }

    /// Writes one row of M.
    fn write(&self, row: usize, scratch: &mut Scratch, out: &mut [f32]) {
        let (i, o) = pair_of_row(row);
        let pair = PairVectors::new(self.directions.directions()[i], self.directions.directions()[o]);
        scratch.values.resize(out.len(), 0.0);
        out.fill(0.0);
        for (lobe, term) in &self.lobes {
            simd::lobe_values(*lobe, &pair, self.normals.each_ref().map(Vec::as_slice), &mut scratch.values);
            let tint = term.tint(pair.i_dot_h).dot(self.along);
            out.iter_mut().zip(&scratch.values).for_each(|(out, x)| *out += tint * x);
        }
        if self.measured.is_empty() {
            return;
        }
        let [x, y, z] = &self.normals;
        let at = |j: usize| LobeAngles::new(Vec3::new(x[j], y[j], z[j]), pair.i, pair.o, pair.h);
        scratch.angles.clear();
        scratch.angles.extend((0..out.len()).map(at));
        scratch.colors.resize(out.len(), Vec3::ZERO);
        for table in &self.measured {
            table.f_r_many(&scratch.angles, &mut scratch.colors);
            for ((out, angles), color) in out.iter_mut().zip(&scratch.angles).zip(&scratch.colors) {
                if angles.above() {
                    *out += color.dot(self.along) * (angles.n_dot_i * angles.n_dot_o);
                }
            }
        }
    }

    /// Calls `each(first row, values)` for the blocks of one part, in order.
    fn stream(&self, part: usize, mut each: impl FnMut(usize, &[f32])) {
        let columns = self.columns();
        let blocks = self.count().div_ceil(BLOCK);
        let mut scratch = Scratch::default();
        let mut values = vec![0.0_f32; BLOCK * columns];
        for block in part * blocks / PARTS..(part + 1) * blocks / PARTS {
            let first = block * BLOCK;
            let rows = (self.count() - first).min(BLOCK);
            for (k, row) in values[..rows * columns].chunks_mut(columns).enumerate() {
                self.write(first + k, &mut scratch, row);
            }
            each(first, &values[..rows * columns]);
        }
    }

    /// Projects M onto `l` random rows, and sums its moments.
    pub fn project(&self, l: usize, seed: u64) -> Sums {
        let parts: Vec<Sums> = (0..PARTS).into_par_iter().map(|part| self.project_part(part, l, seed)).collect();
        let mut total = Sums::zeros(l, self.columns());
        parts.iter().for_each(|part| total.add(part));
        total
    }

    fn project_part(&self, part: usize, l: usize, seed: u64) -> Sums {
        let columns = self.columns();
        let mut sums = Sums::zeros(l, columns);
        let mut random = vec![0.0_f32; l * BLOCK];
        let mut product = vec![0.0_f32; l * columns];
        let mut block_sums = vec![[0.0_f32; 2]; columns];
        self.stream(part, |first, values| {
            let rows = values.len() / columns;
            let random = &mut random[..l * rows];
            fill_normal(seed, (first / BLOCK) as u64, random);
            block_sums.fill([0.0; 2]);
            for (k, row) in values.chunks(columns).enumerate() {
                let w2 = self.weight(first + k);
                for (r, line) in random.chunks_mut(rows).enumerate() {
                    line[k] *= w2.sqrt();
                    sums.ones[r] += f64::from(line[k]);
                }
                for (s, x) in block_sums.iter_mut().zip(row) {
                    s[0] += w2 * x;
                    s[1] += w2 * x * x;
                }
                sums.weight += f64::from(w2);
            }
            gemm::multiply(l, rows, columns, random, values, &mut product);
            sums.projected.iter_mut().zip(&product).for_each(|(s, &x)| *s += f64::from(x));
            for (j, s) in block_sums.iter().enumerate() {
                sums.first[j] += f64::from(s[0]);
                sums.second[j] += f64::from(s[1]);
            }
        });
        sums
    }

    /// `U_M = (M - mean) D V`, row-major `rows x rank`; `weighted` is `D V`.
    pub fn coefficients(&self, weighted: &[f64], mean: &[f64], rank: usize) -> Vec<f32> {
        let columns = self.columns();
        if rank == 0 {
            return Vec::new();
        }
        let mixing: Vec<f32> = weighted.iter().map(|&x| x as f32).collect();
        let mut offset = vec![0.0_f64; rank];
        for (row, m) in weighted.chunks(rank).zip(mean) {
            offset.iter_mut().zip(row).for_each(|(o, v)| *o += m * v);
        }
        let parts: Vec<Vec<f32>> = (0..PARTS)
            .into_par_iter()
            .map(|part| {
                let mut out = Vec::new();
                self.stream(part, |_, values| {
                    let rows = values.len() / columns;
                    let start = out.len();
                    out.resize(start + rows * rank, 0.0);
                    gemm::multiply(rows, columns, rank, values, &mixing, &mut out[start..]);
                });
                for row in out.chunks_mut(rank) {
                    row.iter_mut().zip(&offset).for_each(|(u, o)| *u = (f64::from(*u) - o) as f32);
                }
                out
            })
            .collect();
        parts.concat()
    }
}
