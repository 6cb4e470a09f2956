//! M, the pre-rotated BRDFs, factored in streamed blocks and never stored whole (Wu et al. 2011, Sec. 3.5 and 3.7).

use std::sync::Arc;
use std::time::Instant;

use glam::{DVec3, Vec3};
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::super::facet_sum::{SumMaterial, lobe};
use super::super::gemm;
use super::projection::{fill_normal, right_vectors};
use super::sampling::Sampling;
use super::{Wu2011Settings, pair_of_row, rows_of};
use crate::brdf::{Brdf, ColorBasis, LobeAngles, Term};
use crate::directions::{ParaboloidMap, ParaboloidSphere};
use crate::error::Result;
use crate::simd::{self, Lobe, PairVectors};

/// Rows of M at a time.
const BLOCK: usize = 64;

/// Parts of the rows whose sums are kept apart and added in order: the same bits with any number of threads.
const PARTS: usize = 16;

/// The paper's ranks of M reach 95, more than the 50 rows it names for N: M is projected onto this many.
const MATERIAL_PROJECTION_ROWS: usize = 160;

/// M of one material: what is precomputed, and stays while the geometry is edited.
#[derive(Debug)]
pub struct MaterialFactors {
    pub(super) directions: Arc<ParaboloidMap>,
    pub(super) normals: ParaboloidSphere,
    pub(super) channels: Vec<ChannelFactors>,
    /// Directions that the paper's sampling asks for, before the cap on the build time.
    pub wanted_directions: usize,
    pub seconds: f64,
}

/// M along one colour direction: `M_kj ≈ mean_j + Σ_c coefficients_kc vectors_jc`.
#[derive(Debug)]
pub(super) struct ChannelFactors {
    /// The colour direction that the scalar stands for.
    pub color: Vec3,
    pub mean: Vec<f64>,
    /// Row-major `columns x rank`, the normals' weights taken out.
    pub vectors: Vec<f64>,
    /// Row-major `rows x rank`.
    pub coefficients: Vec<f32>,
    pub rank: usize,
    /// Part of the power of M - mean that is kept, measured over all of M.
    pub kept: f64,
}

impl MaterialFactors {
    /// Tabulates and factors a material; its `color` is left to the product.
    pub fn new(material: &SumMaterial, settings: &Wu2011Settings) -> Result<Self> {
        let started = Instant::now();
        let wanted = Sampling::of(&material.brdf);
        let mut sampling = wanted.capped(&material.brdf);
        if let Some(directions) = settings.m_directions {
            sampling.directions = directions;
        }
        let directions = Arc::new(ParaboloidMap::nearest_to(sampling.directions));
        let normals = ParaboloidSphere::new(ParaboloidMap::nearest_to(sampling.half_normals));
        let colors = ColorBasis::of(&material.brdf);
        let channels = (0..settings.colors)
            .filter(|&k| colors.energy[k] > 1e-9)
            .map(|k| {
                let rows = Rows::new(&material.brdf, colors.directions[k], &directions, &normals);
                rows.factor(settings)
            })
            .collect::<Result<Vec<_>>>()?;
        let seconds = started.elapsed().as_secs_f64();
        Ok(Self { directions, normals, channels, wanted_directions: wanted.directions, seconds })
    }

    /// Rows of M: unordered pairs of directions.
    pub fn rows(&self) -> usize {
        rows_of(self.directions.len())
    }

    /// Columns of M: normals of the whole sphere.
    pub fn columns(&self) -> usize {
        self.normals.len()
    }

    /// Rank of the approximation, all colours together.
    pub fn rank(&self) -> usize {
        self.channels.iter().map(|channel| channel.rank).sum()
    }

    /// Bytes that are kept between edits of the geometry.
    pub fn bytes(&self) -> usize {
        self.channels.iter().map(|c| 4 * c.coefficients.len() + 8 * (c.vectors.len() + c.mean.len())).sum()
    }
}

/// M row by row: the cosine-weighted BRDF along a colour, at all normals.
pub(super) struct Rows<'a> {
    lobes: Vec<(Lobe, &'a Term)>,
    measured: Vec<&'a Term>,
    along: Vec3,
    directions: &'a ParaboloidMap,
    normals: [Vec<f32>; 3],
    column_weights: Vec<f64>,
}

/// Sums over rows of one part.
struct Sums {
    /// `Rᵀ D_r M`, row-major `l x columns`.
    projected: Vec<f64>,
    /// `Rᵀ D_r 1`.
    ones: Vec<f64>,
    /// `Σ w² M`, `Σ w² M²` a column, `Σ w²`.
    first: Vec<f64>,
    second: Vec<f64>,
    weight: f64,
}

impl<'a> Rows<'a> {
    pub fn new(brdf: &'a Brdf, along: Vec3, directions: &'a ParaboloidMap, normals: &ParaboloidSphere) -> Self {
        let component = |pick: fn(Vec3) -> f32| (0..normals.len()).map(|j| pick(normals.direction(j))).collect();
        Self {
            lobes: brdf.terms.iter().filter_map(|term| lobe(term).map(|lobe| (lobe, term))).collect(),
            measured: brdf.terms.iter().filter(|term| term.measured().is_some()).collect(),
            along,
            directions,
            normals: [component(|n| n.x), component(|n| n.y), component(|n| n.z)],
            column_weights: (0..normals.len()).map(|j| f64::from(normals.solid_angle(j)).sqrt()).collect(),
        }
    }

    fn columns(&self) -> usize {
        self.column_weights.len()
    }

    fn count(&self) -> usize {
        rows_of(self.directions.len())
    }

    /// Power weight `w²` of a row: the solid angles of both directions, twice where the pair stands for two.
    pub fn weight(&self, row: usize) -> f32 {
        let (i, o) = pair_of_row(row);
        let both = self.directions.solid_angle(i) * self.directions.solid_angle(o);
        if i == o { both } else { 2.0 * both }
    }

    /// One row of M.
    pub fn write(&self, row: usize, scratch: &mut Vec<f32>, out: &mut [f32]) {
        let (i, o) = pair_of_row(row);
        let pair = PairVectors::new(self.directions.directions()[i], self.directions.directions()[o]);
        scratch.resize(out.len(), 0.0);
        out.fill(0.0);
        for (lobe, term) in &self.lobes {
            simd::lobe_values(*lobe, &pair, self.normals.each_ref().map(Vec::as_slice), scratch);
            let tint = term.tint(pair.i_dot_h).dot(self.along);
            out.iter_mut().zip(scratch.iter()).for_each(|(out, x)| *out += tint * x);
        }
        for term in &self.measured {
            for (j, out) in out.iter_mut().enumerate() {
                let normal = Vec3::new(self.normals[0][j], self.normals[1][j], self.normals[2][j]);
                let angles = LobeAngles::new(normal, pair.i, pair.o, pair.h);
                if angles.above() {
                    *out += term.f_cos(&angles).dot(self.along);
                }
            }
        }
    }

    /// Calls `each(first row, rows of M)` for the blocks of one part, in order.
    fn stream(&self, part: usize, mut each: impl FnMut(usize, &[f32])) {
        let columns = self.columns();
        let blocks = self.count().div_ceil(BLOCK);
        let mut scratch = Vec::new();
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

    fn factor(&self, settings: &Wu2011Settings) -> Result<ChannelFactors> {
        let columns = self.columns();
        let l = settings.projection_rows.max(MATERIAL_PROJECTION_ROWS);
        let parts: Vec<Sums> = (0..PARTS).into_par_iter().map(|part| self.project(part, l, settings.seed)).collect();
        let sum = |pick: fn(&Sums) -> &Vec<f64>| {
            let mut total = pick(&parts[0]).clone();
            parts[1..].iter().for_each(|part| total.iter_mut().zip(pick(part)).for_each(|(t, x)| *t += x));
            total
        };
        let (projected, ones, first, second) = (sum(|s| &s.projected), sum(|s| &s.ones), sum(|s| &s.first), sum(|s| &s.second));
        let weight: f64 = parts.iter().map(|part| part.weight).sum();
        let mean: Vec<f64> = first.iter().map(|x| x / weight).collect();
        let d = &self.column_weights;
        let q = DMatrix::from_fn(l, columns, |k, j| (projected[k * columns + j] - ones[k] * mean[j]) * d[j] / (l as f64).sqrt());
        let power_with_mean: f64 = (0..columns).map(|j| second[j] * d[j] * d[j]).sum();
        let power: f64 = (0..columns).map(|j| (second[j] - weight * mean[j] * mean[j]) * d[j] * d[j]).sum();
        let right = right_vectors(&q, settings.keep_m, power_with_mean)?;
        let rank = right.rank;
        let scaled = |divide: bool| -> Vec<f64> {
            right.vectors.iter().enumerate().map(|(k, &v)| if divide { v / d[k / rank] } else { v * d[k / rank] }).collect()
        };
        let coefficients = self.coefficients(&scaled(false), &mean, rank);
        let kept_power: f64 = coefficients
            .chunks(rank.max(1))
            .enumerate()
            .map(|(row, c)| f64::from(self.weight(row)) * c.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>())
            .sum();
        let kept = if power > 1e-10 * power_with_mean { kept_power / power } else { 1.0 };
        Ok(ChannelFactors { color: self.along, mean, vectors: scaled(true), coefficients, rank, kept })
    }

    /// Random projection and moments of one part.
    fn project(&self, part: usize, l: usize, seed: u64) -> Sums {
        let columns = self.columns();
        let mut sums = Sums { projected: vec![0.0; l * columns], ones: vec![0.0; l], first: vec![0.0; columns], second: vec![0.0; columns], weight: 0.0 };
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
    fn coefficients(&self, weighted: &[f64], mean: &[f64], rank: usize) -> Vec<f32> {
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

impl ChannelFactors {
    /// `f` of the scalar back in colour: the direction times the material's colour.
    pub fn tint(&self, material_color: Vec3) -> DVec3 {
        (self.color * material_color).as_dvec3()
    }
}
