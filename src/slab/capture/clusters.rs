//! Representative points by k-means, and the weights of representatives for all other points (Dai et al. 2009, Sec. 4.3).

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::base::{Cancel, Result};
use crate::math::linalg::gemm;

/// Slices of points: `cells` values each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LobeSlices {
    pub cells: usize,
    pub values: Vec<f32>,
}

impl LobeSlices {
    pub fn count(&self) -> usize {
        self.values.len().checked_div(self.cells).unwrap_or(0)
    }

    pub fn slice(&self, point: usize) -> &[f32] {
        &self.values[point * self.cells..(point + 1) * self.cells]
    }

    /// The slices of some points.
    pub fn gathered(&self, points: &[usize]) -> Self {
        Self { cells: self.cells, values: points.iter().flat_map(|point| self.slice(*point)).copied().collect() }
    }
}

/// Points per cluster that k-means sees, and its iterations.
const POINTS_PER_CLUSTER: usize = 12;
const ITERATIONS: usize = 10;
/// Points whose distances are computed at once.
const CHUNK: usize = 256;

/// Up to `count` points, each nearest to the mean of a cluster of k-means (Lloyd's method) over a random part of `points`.
/// In ascending order.
///
/// # Errors
/// [`crate::base::Error::Cancelled`].
pub fn representatives(
    slices: &LobeSlices,
    points: &[usize],
    count: usize,
    seed: u64,
    cancel: &Cancel,
) -> Result<Vec<usize>> {
    if points.len() <= count {
        return Ok(points.to_vec());
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut seen = points.to_vec();
    // The first part of a random order (Fisher and Yates).
    let part = (POINTS_PER_CLUSTER * count).min(seen.len());
    for k in 0..part {
        let other = rng.random_range(k..seen.len());
        seen.swap(k, other);
    }
    seen.truncate(part);
    let part = slices.gathered(&seen);
    let mut means = first_means(&part, count, &mut rng);
    for _ in 0..ITERATIONS {
        cancel.check()?;
        let nearest = nearest(&part, &means, 1);
        let mut sums = vec![0.0_f64; means.values.len()];
        let mut sizes = vec![0_usize; count];
        for (point, cluster) in nearest.iter().enumerate() {
            let cluster = *cluster as usize;
            sizes[cluster] += 1;
            let sum = &mut sums[cluster * slices.cells..(cluster + 1) * slices.cells];
            sum.iter_mut().zip(part.slice(point)).for_each(|(sum, value)| *sum += f64::from(*value));
        }
        for (k, value) in means.values.iter_mut().enumerate() {
            // An empty cluster stays where it is.
            if sizes[k / slices.cells] > 0 {
                *value = (sums[k] / sizes[k / slices.cells] as f64) as f32;
            }
        }
    }
    let mut found: Vec<usize> = nearest(&means, &part, 1).into_iter().map(|k| seen[k as usize]).collect();
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

/// Slices that start the clusters: each is the farthest of a few random ones from those before it (Mitchell 1991).
fn first_means(slices: &LobeSlices, count: usize, rng: &mut ChaCha8Rng) -> LobeSlices {
    const CANDIDATES: usize = 4;
    let mut means = LobeSlices { cells: slices.cells, values: Vec::new() };
    for _ in 0..count {
        let candidates: Vec<usize> = (0..CANDIDATES).map(|_| rng.random_range(0..slices.count())).collect();
        let to_nearest = |point: &usize| {
            let distance =
                |mean: &[f32]| -> f32 { mean.iter().zip(slices.slice(*point)).map(|(a, b)| (a - b) * (a - b)).sum() };
            means.values.chunks_exact(slices.cells).map(distance).fold(f32::MAX, f32::min)
        };
        let farthest = candidates.into_iter().max_by(|a, b| to_nearest(a).total_cmp(&to_nearest(b)));
        means.values.extend_from_slice(slices.slice(farthest.unwrap_or(0)));
    }
    means
}

/// The `count` nearest of `others` for every slice of `points`, nearest first.
pub fn nearest(points: &LobeSlices, others: &LobeSlices, count: usize) -> Vec<u32> {
    let (cells, candidates) = (points.cells, others.count());
    let square = |slice: &[f32]| slice.iter().map(|value| value * value).sum::<f32>();
    let squares: Vec<f32> = others.values.chunks_exact(cells).map(square).collect();
    let of_chunk = |chunk: &[f32]| {
        let rows = chunk.len() / cells;
        let mut products = vec![0.0; rows * candidates];
        gemm::multiply_transposed(rows, cells, candidates, chunk, &others.values, &mut products);
        let mut found = Vec::with_capacity(rows * count);
        for row in products.chunks_exact(candidates) {
            let mut best: Vec<(f32, u32)> = Vec::with_capacity(count + 1);
            for (k, (product, square)) in row.iter().zip(&squares).enumerate() {
                let distance = square - 2.0 * product;
                if best.len() < count || best.last().is_some_and(|last| distance < last.0) {
                    let at = best.partition_point(|(other, _)| *other <= distance);
                    best.insert(at, (distance, k as u32));
                    best.truncate(count);
                }
            }
            found.extend(best.into_iter().map(|(_, k)| k));
        }
        found
    };
    points.values.par_chunks(CHUNK * cells).flat_map_iter(of_chunk).collect()
}

/// Sweeps over the unknowns.
const SWEEPS: usize = 64;
/// Added to the diagonal, over its entry: nearly equal columns share their weight.
const RIDGE: f64 = 1e-4;

/// Non-negative least squares of a few unknowns from their normal equations `gram x = right`, by coordinate descent. Eq. 22
/// alone would allow negative weights, which make negative distributions.
pub fn non_negative(gram: &[f64], right: &[f64]) -> Vec<f64> {
    let count = right.len();
    let mut x = vec![0.0; count];
    for _ in 0..SWEEPS {
        for k in 0..count {
            let diagonal = gram[k * count + k] * (1.0 + RIDGE);
            if diagonal > 0.0 {
                let sum: f64 = (0..count).filter(|j| *j != k).map(|j| gram[k * count + j] * x[j]).sum();
                x[k] = ((right[k] - sum) / diagonal).max(0.0);
            }
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points in three groups around corners of a triangle.
    fn groups() -> LobeSlices {
        let corner = [[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]];
        let value = |k: usize| {
            let (x, y) = ((k as f32 * 1.7).sin() * 0.3, (k as f32 * 2.9).cos() * 0.3);
            [corner[k % 3][0] + x, corner[k % 3][1] + y]
        };
        LobeSlices { cells: 2, values: (0..300).flat_map(value).collect() }
    }

    #[test]
    fn three_representatives_of_three_groups_lie_one_in_each() {
        let slices = groups();
        let all: Vec<usize> = (0..slices.count()).collect();
        let found = representatives(&slices, &all, 3, 4, &Cancel::default()).unwrap();
        let mut of_group: Vec<usize> = found.iter().map(|point| point % 3).collect();
        of_group.sort_unstable();
        assert_eq!(of_group, [0, 1, 2]);
        assert_eq!(representatives(&slices, &all[..2], 3, 4, &Cancel::default()).unwrap(), [0, 1]);
    }

    #[test]
    fn the_nearest_are_those_of_brute_force() {
        let slices = groups();
        let others = slices.gathered(&[3, 50, 100, 200, 298]);
        let found = nearest(&slices, &others, 3);
        for point in 0..slices.count() {
            let distance = |k: usize| -> f32 {
                slices.slice(point).iter().zip(others.slice(k)).map(|(a, b)| (a - b) * (a - b)).sum()
            };
            let mut expected: Vec<usize> = (0..5).collect();
            expected.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)));
            let found: Vec<usize> = found[3 * point..3 * point + 3].iter().map(|k| *k as usize).collect();
            assert_eq!(found, expected[..3], "{point}");
        }
    }

    #[test]
    fn a_mixture_gets_its_weights_back_and_a_point_outside_gets_none_that_are_negative() {
        let column = |k: usize, row: usize| ((row * (k + 2)) as f64 * 0.1).sin() + 1.0;
        let solved = |parts: [f64; 4]| {
            let target = |row: usize| (0..4).map(|k| parts[k] * column(k, row)).sum::<f64>();
            let gram: Vec<f64> =
                (0..16).map(|at| (0..90).map(|row| column(at / 4, row) * column(at % 4, row)).sum()).collect();
            let right: Vec<f64> = (0..4).map(|k| (0..90).map(|row| column(k, row) * target(row)).sum()).collect();
            non_negative(&gram, &right)
        };
        let expected = [0.5, 0.0, 0.2, 0.3];
        let found = solved(expected);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-2), "{found:?}");
        assert!(solved([1.6, -0.6, 0.0, 0.0]).iter().all(|weight| *weight >= 0.0));
        assert_eq!(non_negative(&[0.0], &[0.0]), [0.0]);
    }
}
