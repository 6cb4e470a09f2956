//! Random-projection accelerated SVD with mean subtraction (Wu et al. 2011, Table 2; Sec. 3.7).

use std::f32::consts::TAU;

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::base::Result;
use crate::effective::low_rank::gram::{rank_for, right_singular};

/// Fills a block of R with independent N(0,1) values, which depend on seed and block only.
pub(super) fn fill_normal(seed: u64, block: u64, out: &mut [f32]) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(block);
    for pair in out.chunks_mut(2) {
        // Box and Muller: a radius and an angle give two values.
        let radius = (-2.0 * (1.0 - rng.random::<f32>()).ln()).sqrt();
        let (sin, cos) = (TAU * rng.random::<f32>()).sin_cos();
        pair[0] = radius * cos;
        if let Some(second) = pair.get_mut(1) {
            *second = radius * sin;
        }
    }
}

/// Right singular vectors of the small matrix `Q = Rᵀ P / √l`.
#[derive(Debug, Clone)]
pub(super) struct RightVectors {
    pub rank: usize,
    /// Orthonormal columns, row-major `columns of P x rank`.
    pub vectors: Vec<f64>,
}

/// Computes the fewest right singular vectors of `q` (l rows) that keep the fraction `keep` of its power, from its
/// smaller Gram matrix. Power below the rounding of f32 entries, relative to `scale`, counts as zero; `scale` is the
/// power before the mean is subtracted.
pub(super) fn right_vectors(q: &DMatrix<f64>, keep: f64, scale: f64) -> Result<RightVectors> {
    let significant = |values: &[f64]| {
        let floor = 1e-10 * scale.max(values.first().copied().unwrap_or(0.0));
        values.iter().take_while(|&&value| value > floor).count()
    };
    let (_, right) = right_singular(q, |values| match significant(values) {
        0 => 0,
        count => rank_for(&values[..count], keep),
    })?;
    let rank = right.ncols();
    let vectors = right.transpose().as_slice().to_vec();
    Ok(RightVectors { rank, vectors })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_values_have_mean_zero_and_variance_one_and_are_reproducible() {
        let mut values = vec![0.0; 200_001];
        fill_normal(3, 5, &mut values);
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let variance = values.iter().map(|x| x * x).sum::<f32>() / values.len() as f32;
        // The limits are four standard errors: 4/√n and 4 √(2/n).
        assert!(mean.abs() < 9e-3 && (variance - 1.0).abs() < 1.3e-2, "{mean} {variance}");
        let mut again = vec![0.0; 11];
        fill_normal(3, 5, &mut again);
        assert_eq!(again[..10], values[..10]);
        fill_normal(3, 6, &mut again);
        assert_ne!(again[..10], values[..10]);
    }

    #[test]
    fn normal_values_pass_the_chi_squared_test() {
        let mut values = vec![0.0; 1_000_000];
        fill_normal(9, 1, &mut values);
        let values: Vec<f64> = values.into_iter().map(f64::from).collect();
        let p = crate::testing::chi_square::p_value_of_normal(&values);
        assert!(p > 0.01, "{p}");
    }

    #[test]
    fn vectors_are_orthonormal_and_rebuild_a_matrix_of_low_rank_either_way_round() {
        for (l, n) in [(12, 40), (40, 12)] {
            let q = DMatrix::from_fn(l, n, |r, c| {
                (r as f64).sin() * c as f64 + 3.0 * (c as f64).cos() + (r * r) as f64 * 0.01
            });
            let right = right_vectors(&q, 1.0, 0.0).unwrap();
            assert!(right.rank <= 3);
            let v = DMatrix::from_row_slice(n, right.rank, &right.vectors);
            assert!((v.transpose() * &v - DMatrix::identity(right.rank, right.rank)).norm() < 1e-6);
            assert!((&q * &v * v.transpose() - &q).norm() < 1e-6 * q.norm());
        }
    }

    #[test]
    fn a_matrix_of_rounding_errors_has_rank_zero() {
        let q = DMatrix::from_element(3, 5, 1e-9);
        assert_eq!(right_vectors(&q, 0.98, 1.0).unwrap().rank, 0);
        assert_eq!(right_vectors(&DMatrix::zeros(3, 5), 0.98, 0.0).unwrap().rank, 0);
    }
}
