//! Small factorizations that do not fail: f64 Gram matrices and symmetric eigenvectors, checked (DESIGN.md, Sec. 8).

use nalgebra::DMatrix;

use crate::error::{Error, Result};

/// Eigenvalues (descending, not negative) and eigenvectors (columns) of a symmetric positive semi-definite matrix.
#[derive(Debug, Clone)]
pub struct Eigen {
    pub values: Vec<f64>,
    pub vectors: DMatrix<f64>,
}

/// Factors a Gram matrix. Refuses values that are not finite; scales to a largest entry of one first.
pub fn eigen(mut gram: DMatrix<f64>) -> Result<Eigen> {
    let n = gram.nrows();
    let scale = gram.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
    if !gram.iter().all(|x| x.is_finite()) {
        return Err(Error::failed("a Gram matrix holds values that are not finite"));
    }
    if scale == 0.0 || n == 0 {
        return Ok(Eigen { values: vec![0.0; n], vectors: DMatrix::identity(n, n) });
    }
    gram /= scale;
    let solved = nalgebra::SymmetricEigen::try_new(gram, f64::EPSILON, 1000 * n)
        .ok_or_else(|| Error::failed("the eigenvalues of a Gram matrix did not converge"))?;
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| solved.eigenvalues[b].total_cmp(&solved.eigenvalues[a]));
    let vectors = DMatrix::from_fn(n, n, |row, column| solved.eigenvectors[(row, order[column])]);
    let values = order.iter().map(|&k| solved.eigenvalues[k].max(0.0) * scale).collect();
    Ok(Eigen { values, vectors })
}

/// The smallest count of leading values that keeps the fraction `kept` of their sum; at least one.
pub fn rank_for(values: &[f64], kept: f64) -> usize {
    let total: f64 = values.iter().sum();
    let mut sum = 0.0;
    for (k, value) in values.iter().enumerate() {
        sum += value;
        if sum >= kept * total {
            return k + 1;
        }
    }
    values.len().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rank_one_matrix_of_ones_has_one_value() {
        let solved = eigen(DMatrix::from_element(12, 12, 1.0)).unwrap();
        assert!((solved.values[0] - 12.0).abs() < 1e-10);
        assert!(solved.values[1..].iter().all(|value| value.abs() < 1e-10));
        assert_eq!(rank_for(&solved.values, 0.999), 1);
    }

    #[test]
    fn clustered_and_huge_values_are_rebuilt_to_rounding() {
        for scale in [1e-30, 1.0, 1e30] {
            let base =
                DMatrix::from_fn(
                    20,
                    9,
                    |r, c| if r == 0 && c == 0 { 1e8 } else { ((r * 7 + c * 3) % 11) as f64 - 5.0 },
                );
            let gram = base.transpose() * &base * scale;
            let solved = eigen(gram.clone()).unwrap();
            let rebuilt =
                &solved.vectors * DMatrix::from_diagonal(&solved.values.clone().into()) * solved.vectors.transpose();
            let ratio = (rebuilt - &gram).norm() / (gram.norm() * 9.0 * f64::EPSILON);
            assert!(ratio < 50.0, "{scale}: {ratio}");
            let orthogonal =
                (solved.vectors.transpose() * &solved.vectors - DMatrix::identity(9, 9)).norm() / (9.0 * f64::EPSILON);
            assert!(orthogonal < 50.0, "{orthogonal}");
        }
    }

    #[test]
    fn a_matrix_with_a_nan_is_an_error() {
        assert!(eigen(DMatrix::from_element(2, 2, f64::NAN)).is_err());
    }
}
