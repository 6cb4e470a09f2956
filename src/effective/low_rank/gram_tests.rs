use super::*;

#[test]
fn a_rank_one_matrix_of_ones_has_one_value() {
    let solved = eigen(DMatrix::from_element(12, 12, 1.0)).unwrap();
    assert!((solved.values[0] - 12.0).abs() < 1e-10);
    assert!(solved.values[1..].iter().all(|value| value.abs() < 1e-10));
    assert_eq!(rank_for(&solved.values, 0.999), 1);
}

/// LAPACK's test ratios of a symmetric factorization (DCHKST): the error of the rebuilt matrix, and the deviation
/// of the vectors from orthonormal, both in units of rounding.
fn ratios(gram: &DMatrix<f64>, solved: &Eigen) -> [f64; 2] {
    let n = gram.nrows();
    if n == 0 {
        return [0.0; 2];
    }
    let rounding = n as f64 * f64::EPSILON;
    let rebuilt = &solved.vectors * DMatrix::from_diagonal(&solved.values.clone().into()) * solved.vectors.transpose();
    let norm = gram.norm();
    let lost = if norm > 0.0 { (rebuilt - gram).norm() / (norm * rounding) } else { 0.0 };
    [lost, (solved.vectors.transpose() * &solved.vectors - DMatrix::identity(n, n)).norm() / rounding]
}

/// Numbers in [-1, 1] without structure.
fn noise(rows: usize, columns: usize) -> DMatrix<f64> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    DMatrix::from_fn(rows, columns, |_, _| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    })
}

/// `U diag(values) V^T` with orthonormal U and V.
fn with_values(rows: usize, columns: usize, values: &[f64]) -> DMatrix<f64> {
    let basis = |n: usize| noise(n, n).qr().q();
    let (u, v) = (basis(rows), basis(columns));
    let s = DMatrix::from_fn(rows, columns, |r, c| if r == c { values.get(r).copied().unwrap_or(0.0) } else { 0.0 });
    u * s * v.transpose()
}

/// Matrices that are hard to factorize, with their singular values if they were built from these.
fn hard_matrices() -> Vec<(&'static str, DMatrix<f64>, Vec<f64>)> {
    let clustered: Vec<f64> = (0..24).map(|k| if k < 12 { 1.0 } else { 1e-6 } * (1.0 + 1e-14 * f64::from(k))).collect();
    let graded: Vec<f64> = (0..24).map(|k| 10_f64.powi(-k)).collect();
    let mut one_huge = vec![1.0; 24];
    one_huge[0] = 1e8;
    vec![
        ("all ones", DMatrix::from_element(40, 24, 1.0), Vec::new()),
        ("rank 0", DMatrix::zeros(40, 24), Vec::new()),
        ("rank 1", noise(40, 1) * noise(1, 24), Vec::new()),
        ("equal values", with_values(40, 24, &[1.0; 24]), vec![1.0; 24]),
        ("clustered values", with_values(40, 24, &clustered), clustered),
        ("values of 24 orders", with_values(40, 24, &graded), graded),
        ("one huge value", with_values(40, 24, &one_huge), one_huge),
        ("noise, more rows", noise(300, 24), Vec::new()),
        ("noise, more columns", noise(24, 300), Vec::new()),
        ("one entry", DMatrix::from_element(1, 1, 3.0), Vec::new()),
        ("no rows", DMatrix::zeros(0, 7), Vec::new()),
        ("no columns", DMatrix::zeros(7, 0), Vec::new()),
    ]
}

#[test]
fn the_factorization_stays_within_lapacks_ratios_on_hard_matrices_of_any_scale() {
    for (name, matrix, _) in &hard_matrices() {
        for scale in [1e-30, 1e-15, 1.0, 1e15, 1e30] {
            let scaled = matrix * scale;
            for gram in [scaled.transpose() * &scaled, &scaled * scaled.transpose()] {
                let solved = eigen(gram.clone()).unwrap();
                let [lost, skew] = ratios(&gram, &solved);
                assert!(lost < 50.0 && skew < 50.0, "{name} times {scale:e}: {lost:.1}, {skew:.1}");
                assert!(solved.values.windows(2).all(|pair| pair[0] >= pair[1] && pair[1] >= 0.0), "{name}");
                assert!((1..=gram.nrows().max(1)).contains(&rank_for(&solved.values, 0.98)), "{name}");
            }
        }
    }
}

/// Checks `‖A - U S V^T‖ / (‖A‖ max(m,n) ε)` and `‖I - V^T V‖ / (n ε)` of the last step of randomized
/// factorizations, for each matrix and its transpose. `U S` is `A V`, and only truncated values may be missing.
#[test]
fn right_vectors_stay_within_lapacks_ratios_on_hard_matrices_of_any_scale() {
    for (name, matrix, known) in &hard_matrices() {
        for scale in [1e-30, 1e-15, 1.0, 1e15, 1e30] {
            for a in [matrix * scale, matrix.transpose() * scale] {
                // The truncation of the `wu2011` preset: values below the rounding of f32 entries.
                let significant = |values: &[f64]| {
                    let floor = 1e-10 * values.first().copied().unwrap_or(0.0);
                    values.iter().take_while(|value| **value > floor).count()
                };
                let (values, v) = right_singular(&a, significant).unwrap();
                let (n, rank) = (a.ncols() as f64, v.ncols());
                assert_eq!(rank, significant(&values), "{name} times {scale:e}");
                let skew = (v.transpose() * &v - DMatrix::identity(rank, rank)).norm();
                let truncated = known.iter().skip(rank).map(|value| (value * scale).powi(2)).sum::<f64>().sqrt();
                let left = (&a - &a * &v * v.transpose()).norm() - truncated;
                let rounding = f64::EPSILON * n.max(a.nrows() as f64);
                assert!(skew <= 50.0 * n * f64::EPSILON, "{name} times {scale:e}: skew {skew:e}");
                let ratio = if a.norm() > 0.0 { left / (a.norm() * rounding) } else { 0.0 };
                assert!(ratio < 50.0, "{name} times {scale:e}, {:?}: ratio {ratio:.1}", a.shape());
            }
        }
    }
}

#[test]
fn clustered_and_huge_values_are_rebuilt_to_rounding() {
    for scale in [1e-30, 1.0, 1e30] {
        let base =
            DMatrix::from_fn(20, 9, |r, c| if r == 0 && c == 0 { 1e8 } else { ((r * 7 + c * 3) % 11) as f64 - 5.0 });
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
