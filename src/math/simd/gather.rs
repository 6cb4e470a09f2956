//! Weighted sums of the rows of a table: the query of low-rank factors, and a table along one direction.

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

/// Columns of [`gathered_row`] that are processed at a time.
const ROW_WIDTH: usize = 64;

multiversion! {
    /// Writes `Σ_t w_t table[n_t][c]` to each column `c` of `out`, for rows of `out.len()` contiguous values. The terms are
    /// added in the order of the taps.
    pub fn gathered_row(table: &[f32], taps: &[(usize, f32); 16], out: &mut [f32]) {
        let columns = out.len();
        let (whole, rest) = out.as_chunks_mut::<ROW_WIDTH>();
        let first_of_rest = columns - rest.len();
        for (k, out) in whole.iter_mut().enumerate() {
            let mut sums = [0.0_f32; ROW_WIDTH];
            for &(node, weight) in taps {
                let at = node * columns + k * ROW_WIDTH;
                if let Some(row) = table.get(at..).and_then(|row| row.first_chunk::<ROW_WIDTH>()) {
                    for l in 0..ROW_WIDTH {
                        sums[l] += weight * row[l];
                    }
                }
            }
            *out = sums;
        }
        rest.fill(0.0);
        for &(node, weight) in taps {
            let at = node * columns + first_of_rest;
            for (sum, x) in rest.iter_mut().zip(&table[at..]) {
                *sum += weight * x;
            }
        }
    }
}
