//! Small factorizations that do not fail: eigenvectors of Gram matrices in f64, with checked input.

use nalgebra::DMatrix;

use crate::base::{Error, Result};

/// Eigenvalues (descending, not negative) and eigenvectors (columns) of a symmetric positive semi-definite matrix.
#[derive(Debug, Clone)]
pub struct Eigen {
    pub values: Vec<f64>,
    pub vectors: DMatrix<f64>,
}

/// Factors a Gram matrix after scaling its largest entry to one.
///
/// # Errors
/// Values that are not finite, or eigenvalues that do not converge.
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

/// The smallest number of leading values that keeps the fraction `kept` of their sum; at least one.
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

/// Computes the squares of all singular values of `a`, descending, and its leading right singular vectors (columns).
/// `rank` chooses their number from the squares. A Gram matrix squares the condition number, so one step of orthogonal
/// iteration follows, which makes the vectors as accurate as those of a factorization of `a` itself (Halko et al. 2011,
/// Alg. 4.4).
pub fn right_singular(a: &DMatrix<f64>, rank: impl FnOnce(&[f64]) -> usize) -> Result<(Vec<f64>, DMatrix<f64>)> {
    let wide = a.nrows() < a.ncols();
    let solved = eigen(if wide { a * a.transpose() } else { a.transpose() * a })?;
    let rank = rank(&solved.values).min(solved.values.len());
    if rank == 0 {
        return Ok((solved.values, DMatrix::zeros(a.ncols(), 0)));
    }
    let first = solved.vectors.columns(0, rank).into_owned();
    // The scale keeps products of very large or small entries in range.
    let scale = a.amax();
    let a = if scale > 0.0 { a / scale } else { a.clone() };
    let forward = |v: &DMatrix<f64>| (&a * v).qr().q();
    let back = |u: &DMatrix<f64>| (a.transpose() * u).qr().q();
    let right = if wide { back(&first) } else { first };
    Ok((solved.values, back(&forward(&right))))
}

#[cfg(test)]
#[path = "gram_tests.rs"]
mod tests;
