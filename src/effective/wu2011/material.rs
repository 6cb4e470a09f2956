//! Matrix M of rotated lobes, factored in streamed blocks; M itself is never stored (Wu et al. 2011, Sec. 3.5 and 3.7).

use std::sync::Arc;

use glam::{DVec3, Vec3};
use nalgebra::DMatrix;

use super::projection::right_vectors;
use super::rows::{Rows, Sums};
use super::rows_of;
use super::sampling::Sampling;
use crate::base::{InputError, Result};
use crate::brdf::{ColorBasis, Material};
use crate::effective::Wu2011Settings;
use crate::math::directions::{ParaboloidMap, ParaboloidSphere};

/// Random rows that M is projected onto. The paper's ranks of M reach 95, more than the 50 rows that it names for N.
const MATERIAL_PROJECTION_ROWS: usize = 160;

/// Largest number of coefficients of `U_M`; in f32 they take 2 GB.
const MAX_COEFFICIENTS: usize = 1 << 29;

/// The factors of M of one material. They are precomputed and do not depend on the geometry.
#[derive(Debug)]
pub struct MaterialFactors {
    pub(super) directions: Arc<ParaboloidMap>,
    pub(super) normals: ParaboloidSphere,
    pub(super) channels: Vec<ChannelFactors>,
}

/// M along one colour direction: `M_kj ≈ mean_j + Σ_c coefficients_kc vectors_jc`.
#[derive(Debug)]
pub(super) struct ChannelFactors {
    /// The colour direction of the scalar values.
    pub color: Vec3,
    pub mean: Vec<f64>,
    /// Row-major `columns x rank`, divided by the weights of the normals.
    pub vectors: Vec<f64>,
    /// Row-major `rows x rank`.
    pub coefficients: Vec<f32>,
    pub rank: usize,
    /// Fraction of the power of M - mean that is kept, measured over all of M.
    #[cfg(test)]
    pub kept: f64,
}

impl MaterialFactors {
    /// Tabulates and factors the BRDF of a material; the product applies its `color`.
    ///
    /// # Errors
    /// More coefficients than 2 GB, or a factorization that fails.
    pub fn new(material: &Material, settings: &Wu2011Settings) -> Result<Self> {
        let mut sampling = Sampling::of(&material.brdf).capped(&material.brdf);
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
        Ok(Self { directions, normals, channels })
    }

    /// Number of rows of M, which are unordered direction pairs.
    pub fn rows(&self) -> usize {
        rows_of(self.directions.len())
    }

    /// Number of columns of M, which are normals of the whole sphere.
    pub fn columns(&self) -> usize {
        self.normals.len()
    }

    /// Sum of the ranks of all colour directions.
    pub fn rank(&self) -> usize {
        self.channels.iter().map(|channel| channel.rank).sum()
    }

    /// Size of the factors in bytes.
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
        #[cfg(test)]
        let kept = {
            let power: f64 = (0..columns).map(|j| (second[j] - weight * mean[j] * mean[j]) * d[j] * d[j]).sum();
            let kept: f64 = coefficients
                .chunks(rank.max(1))
                .enumerate()
                .map(|(row, c)| f64::from(rows.weight(row)) * c.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>())
                .sum();
            kept / power
        };
        Ok(Self {
            color: rows.along,
            mean,
            vectors: scaled(true),
            coefficients,
            rank,
            #[cfg(test)]
            kept,
        })
    }

    /// The factor that turns a scalar value into a colour: the colour direction times the material's colour.
    pub fn tint(&self, material_color: Vec3) -> DVec3 {
        (self.color * material_color).as_dvec3()
    }
}
