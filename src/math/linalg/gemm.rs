//! Matrix products on row-major slices.

use rayon::prelude::*;

/// `c = a b` for row-major `a: m x k`, `b: k x n`, `c: m x n`; sequential.
pub fn multiply(m: usize, k: usize, n: usize, a: &[f32], b: &[f32], c: &mut [f32]) {
    assert!(a.len() >= m * k && b.len() >= k * n && c.len() >= m * n, "slices hold the matrices");
    // SAFETY: the assertion above checks the lengths, and the strides are those of row-major matrices of these sizes.
    unsafe {
        matrixmultiply::sgemm(
            m,
            k,
            n,
            1.0,
            a.as_ptr(),
            k as isize,
            1,
            b.as_ptr(),
            n as isize,
            1,
            0.0,
            c.as_mut_ptr(),
            n as isize,
            1,
        );
    }
}

/// `c = a bᵀ` for row-major `a: m x k`, `b: n x k`, `c: m x n`; sequential.
pub fn multiply_transposed(m: usize, k: usize, n: usize, a: &[f32], b: &[f32], c: &mut [f32]) {
    assert!(a.len() >= m * k && b.len() >= k * n && c.len() >= m * n, "slices hold the matrices");
    // SAFETY: as above; `b` is read with its strides swapped.
    unsafe {
        matrixmultiply::sgemm(
            m,
            k,
            n,
            1.0,
            a.as_ptr(),
            k as isize,
            1,
            b.as_ptr(),
            1,
            k as isize,
            0.0,
            c.as_mut_ptr(),
            n as isize,
            1,
        );
    }
}

/// `c += aᵀ b` for row-major `a: k x m` and `b: k x n`, whose rows are `strides` apart, and `c: m x n` in f64;
/// sequential. The product itself is in f32.
pub fn add_outer_products(k: usize, [m, n]: [usize; 2], [a, b]: [&[f32]; 2], strides: [usize; 2], c: &mut [f64]) {
    let fits = |values: &[f32], stride: usize, width: usize| k == 0 || values.len() >= (k - 1) * stride + width;
    assert!(fits(a, strides[0], m) && fits(b, strides[1], n) && c.len() >= m * n, "slices hold the matrices");
    let mut product = vec![0.0_f32; m * n];
    // SAFETY: the assertion above checks the lengths, and `a` is read with its strides swapped.
    unsafe {
        matrixmultiply::sgemm(
            m,
            k,
            n,
            1.0,
            a.as_ptr(),
            1,
            strides[0] as isize,
            b.as_ptr(),
            strides[1] as isize,
            1,
            0.0,
            product.as_mut_ptr(),
            n as isize,
            1,
        );
    }
    c.iter_mut().zip(&product).for_each(|(sum, new)| *sum += f64::from(*new));
}

/// `c = a b` with the rows of `a` and `c` distributed over threads; every row has the same bits as from [`multiply`].
pub fn multiply_parallel(m: usize, k: usize, n: usize, a: &[f32], b: &[f32], c: &mut [f32]) {
    const ROWS: usize = 64;
    if n == 0 || k == 0 {
        c.fill(0.0);
        return;
    }
    c[..m * n]
        .par_chunks_mut(ROWS * n)
        .zip(a.par_chunks(ROWS * k))
        .for_each(|(c, a)| multiply(c.len() / n, k, n, a, b, c));
}

/// `aᵀ a` in f64 for row-major `a: m x n`, of f32 entries.
pub fn gram(m: usize, n: usize, a: &[f32]) -> nalgebra::DMatrix<f64> {
    let wide: Vec<f64> = a[..m * n].iter().map(|&x| f64::from(x)).collect();
    let mut out = nalgebra::DMatrix::<f64>::zeros(n, n);
    // SAFETY: `wide` holds m x n values; they are read once as n x m and once as m x n. `out` is n x n and symmetric.
    unsafe {
        matrixmultiply::dgemm(
            n,
            m,
            n,
            1.0,
            wide.as_ptr(),
            1,
            n as isize,
            wide.as_ptr(),
            n as isize,
            1,
            0.0,
            out.as_mut_slice().as_mut_ptr(),
            1,
            n as isize,
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outer_products_have_the_same_bits_however_their_rows_are_divided() {
        const K: usize = 700;
        const M: usize = 193;
        const N: usize = 37;
        let value = |at: usize| ((at * 2_654_435_761) % 1000) as f32 / 700.0 - 0.5;
        let (a, b): (Vec<f32>, Vec<f32>) = ((0..K * M).map(value).collect(), (7..7 + K * N).map(value).collect());
        let of_rows = |rows: usize| {
            let mut c = vec![0.0; M * N];
            for (task, c) in c.chunks_mut(rows * N).enumerate() {
                add_outer_products(K, [c.len() / N, N], [&a[task * rows..], &b], [M, N], c);
            }
            c
        };
        let whole = of_rows(M);
        let exact = |m: usize, n: usize| (0..K).map(|k| f64::from(a[k * M + m]) * f64::from(b[k * N + n])).sum::<f64>();
        assert!((whole[5 * N + 3] - exact(5, 3)).abs() < 1e-3);
        for rows in [1, 13, 25, 64, 97] {
            assert_eq!(of_rows(rows), whole, "{rows} rows per task");
        }
    }
}
