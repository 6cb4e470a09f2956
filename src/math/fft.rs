//! Fast Fourier transform of square grids, and the cyclic convolution of two real grids.

use std::f64::consts::TAU;

use rayon::prelude::*;

/// A complex number as (real, imaginary).
type Complex = (f64, f64);

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

/// Roots of unity and the bit-reversed order for one length.
struct Plan {
    roots: Vec<Complex>,
    order: Vec<u32>,
}

impl Plan {
    /// `side` is a power of two of at least 2.
    fn new(side: usize) -> Self {
        let bits = side.trailing_zeros();
        let root = |k: usize| {
            let (sin, cos) = (-TAU * k as f64 / side as f64).sin_cos();
            (cos, sin)
        };
        let reversed = |k: usize| (k as u32).reverse_bits() >> (u32::BITS - bits);
        Self { roots: (0..side / 2).map(root).collect(), order: (0..side).map(reversed).collect() }
    }

    /// Transforms one row in place (Cooley and Tukey 1965, radix 2). The transform is not scaled.
    fn run(&self, row: &mut [Complex], inverse: bool) {
        for (k, &other) in self.order.iter().enumerate() {
            if k < other as usize {
                row.swap(k, other as usize);
            }
        }
        let side = row.len();
        let mut half = 1;
        while half < side {
            let stride = side / (2 * half);
            for block in row.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                    let (re, im) = self.roots[k * stride];
                    let turned = times(*b, (re, if inverse { -im } else { im }));
                    *b = (a.0 - turned.0, a.1 - turned.1);
                    *a = (a.0 + turned.0, a.1 + turned.1);
                }
            }
            half *= 2;
        }
    }

    /// Transforms all rows, then all columns of a grid. The result is transposed.
    fn run_grid(&self, grid: &mut Vec<Complex>, inverse: bool) {
        let side = self.order.len();
        for _ in 0..2 {
            grid.par_chunks_exact_mut(side).for_each(|row| self.run(row, inverse));
            let source: &[Complex] = grid;
            *grid = (0..side * side)
                .into_par_iter()
                .with_min_len(side)
                .map(|k| source[k % side * side + k / side])
                .collect();
        }
    }
}

/// The cyclic convolution of two real grids of `side` by `side` values, row by row: `c[x] = Σ a[y] b[x - y]`, with
/// indices modulo `side` in both axes. `side` is a power of two of at least 2. Values that are exactly 0 in a result
/// without rounding may be as large as 1e-15 times the largest one, of either sign.
pub fn convolve(a: &[f64], b: &[f64], side: usize) -> Vec<f64> {
    let plan = Plan::new(side);
    // One transform serves both grids: the spectra of real and imaginary part are its even and odd halves.
    let mut both: Vec<Complex> = a.iter().copied().zip(b.iter().copied()).collect();
    plan.run_grid(&mut both, false);
    let product = |k: usize| {
        let (row, column) = (k / side, k % side);
        let mirror = (side - row) % side * side + (side - column) % side;
        let (z, w) = (both[k], both[mirror]);
        let of_a = (0.5 * (z.0 + w.0), 0.5 * (z.1 - w.1));
        let of_b = (0.5 * (z.1 + w.1), -0.5 * (z.0 - w.0));
        times(of_a, of_b)
    };
    let mut spectrum: Vec<Complex> = (0..side * side).into_par_iter().with_min_len(side).map(product).collect();
    plan.run_grid(&mut spectrum, true);
    let scale = 1.0 / (side * side) as f64;
    spectrum.iter().map(|value| value.0 * scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_convolution_is_the_sum_over_all_pairs_of_cells() {
        let side = 8;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut grid = || (0..side * side).map(|_| rng.random::<f64>() - 0.3).collect::<Vec<f64>>();
        let (a, b) = (grid(), grid());
        let fast = convolve(&a, &b, side);
        for (k, value) in fast.iter().enumerate() {
            let (row, column) = (k / side, k % side);
            let mut sum = 0.0;
            for (j, part) in a.iter().enumerate() {
                let (r, c) = ((row + side - j / side) % side, (column + side - j % side) % side);
                sum += part * b[r * side + c];
            }
            assert!((value - sum).abs() < 1e-12, "{k}: {value} {sum}");
        }
    }
}
