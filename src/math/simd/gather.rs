//! The query of low-rank factors: two short gathers and a dot product.

use super::multiversion;

/// Columns that are processed at a time.
const WIDTH: usize = 16;

multiversion! {
    /// `Σ_c (Σ_t w_t u[n_t][c]) (Σ_t w_t p[n_t][c])` for rows of `columns` contiguous values.
    pub fn gathered_dot(u: &[f32], io: &[(usize, f32); 16], p: &[f32], hd: &[(usize, f32); 16], columns: usize) -> f32 {
        let mut total = 0.0;
        let mut start = 0;
        while start < columns {
            let width = WIDTH.min(columns - start);
            let mut left = [0.0_f32; WIDTH];
            let mut right = [0.0_f32; WIDTH];
            let gather = |table: &[f32], taps: &[(usize, f32); 16], sums: &mut [f32; WIDTH]| {
                for &(node, weight) in taps {
                    let at = node * columns + start;
                    if width == WIDTH {
                        let row: &[f32; WIDTH] = match table[at..at + WIDTH].try_into() {
                            Ok(row) => row,
                            Err(_) => return,
                        };
                        for l in 0..WIDTH {
                            sums[l] += weight * row[l];
                        }
                    } else {
                        for (sum, x) in sums.iter_mut().zip(&table[at..at + width]) {
                            *sum += weight * x;
                        }
                    }
                }
            };
            gather(u, io, &mut left);
            gather(p, hd, &mut right);
            total += left.iter().zip(&right).map(|(a, b)| a * b).sum::<f32>();
            start += WIDTH;
        }
        total
    }
}
