//! M, the pre-rotated BRDFs, factored in streamed blocks and never stored whole (Wu et al. 2011, Sec. 3.5 and 3.7).

use std::sync::Arc;
use std::time::Instant;

use glam::{DVec3, Vec3};
use nalgebra::DMatrix;

use super::projection::right_vectors;
use super::rows::{Rows, Sums};
use super::rows_of;
use super::sampling::Sampling;
use crate::base::{InputError, Result};
use crate::brdf::ColorBasis;
use crate::effective::{Material, Wu2011Settings};
use crate::math::directions::{ParaboloidMap, ParaboloidSphere};

/// The paper's ranks of M reach 95, more than the 50 rows it names for N: M is projected onto this many.
const MATERIAL_PROJECTION_ROWS: usize = 160;

/// Coefficients of `U_M` that are held at most: 2 GB.
const MAX_COEFFICIENTS: usize = 1 << 29;

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
    pub fn new(material: &Material, settings: &Wu2011Settings) -> Result<Self> {
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
                ChannelFactors::of(&rows, settings)
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

impl ChannelFactors {
    fn of(rows: &Rows<'_>, settings: &Wu2011Settings) -> Result<Self> {
        let columns = rows.columns();
        let l = settings.projection_rows.max(MATERIAL_PROJECTION_ROWS);
        let sums = rows.project(l, settings.seed);
        let Sums { projected, ones, first, second, weight } = &sums;
        let mean: Vec<f64> = first.iter().map(|x| x / weight).collect();
        let d = &rows.column_weights;
        let q = DMatrix::from_fn(l, columns, |k, j| {
            (projected[k * columns + j] - ones[k] * mean[j]) * d[j] / (l as f64).sqrt()
        });
        let power_with_mean: f64 = (0..columns).map(|j| second[j] * d[j] * d[j]).sum();
        let power: f64 = (0..columns).map(|j| (second[j] - weight * mean[j] * mean[j]) * d[j] * d[j]).sum();
        let right = right_vectors(&q, settings.keep_m, power_with_mean)?;
        let rank = right.rank;
        let scaled = |divide: bool| -> Vec<f64> {
            right
                .vectors
                .iter()
                .enumerate()
                .map(|(k, &v)| if divide { v / d[k / rank] } else { v * d[k / rank] })
                .collect()
        };
        if rows.count() * rank > MAX_COEFFICIENTS {
            return Err(InputError::new(
                "quality.keep_m",
                format_args!("{} rows of rank {rank}", rows.count()),
                "coefficients that fit into 2 GB",
            )
            .into());
        }
        let coefficients = rows.coefficients(&scaled(false), &mean, rank);
        let kept_power: f64 = coefficients
            .chunks(rank.max(1))
            .enumerate()
            .map(|(row, c)| f64::from(rows.weight(row)) * c.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>())
            .sum();
        let kept = if power > 1e-10 * power_with_mean { kept_power / power } else { 1.0 };
        Ok(Self { color: rows.along, mean, vectors: scaled(true), coefficients, rank, kept })
    }

    /// `f` of the scalar back in colour: the direction times the material's colour.
    pub fn tint(&self, material_color: Vec3) -> DVec3 {
        (self.color * material_color).as_dvec3()
    }
}
