//! Non-negative least squares for a few weights and three colour channels.

use glam::{DVec3, Vec3};
use nalgebra::{DMatrix, DVector};

/// Normal equations: sums of products of basis functions and targets.
pub struct NormalEquations {
    matrix: DMatrix<f64>,
    /// Right-hand sides, one column per channel.
    right: DMatrix<f64>,
    /// Sums of squared targets, per channel.
    power: DVec3,
}

impl NormalEquations {
    pub fn new(count: usize) -> Self {
        Self { matrix: DMatrix::zeros(count, count), right: DMatrix::zeros(count, 3), power: DVec3::ZERO }
    }

    /// Adds one sample: values of the basis functions, and the target of their weighted sum.
    pub fn add(&mut self, basis: &[f64], target: DVec3) {
        for (row, a) in basis.iter().enumerate() {
            for (column, b) in basis.iter().enumerate() {
                self.matrix[(row, column)] += a * b;
            }
            for channel in 0..3 {
                self.right[(row, channel)] += a * target[channel];
            }
        }
        self.power += target * target;
    }

    /// Returns the weights and the residual sum of squares.
    pub fn solve(&self) -> (Vec<Vec3>, f64) {
        let count = self.matrix.nrows();
        let mut weights = vec![Vec3::ZERO; count];
        let mut residual = 0.0;
        for channel in 0..3 {
            let (best, squares) = self.solve_channel(channel);
            residual += squares;
            for (weight, value) in weights.iter_mut().zip(best) {
                weight[channel] = value as f32;
            }
        }
        (weights, residual)
    }

    /// Solves one channel by trying all subsets of the basis functions, of which there are at most four. The result is
    /// the best subset without negative weights.
    fn solve_channel(&self, channel: usize) -> (Vec<f64>, f64) {
        let count = self.matrix.nrows();
        let (mut best, mut least) = (vec![0.0; count], self.power[channel]);
        for subset in 1_u32..1 << count {
            let members: Vec<usize> = (0..count).filter(|k| subset >> k & 1 == 1).collect();
            let matrix = DMatrix::from_fn(members.len(), members.len(), |a, b| self.matrix[(members[a], members[b])]);
            let right = DVector::from_fn(members.len(), |a, _| self.right[(members[a], channel)]);
            let Some(solution) = matrix.cholesky().map(|factor| factor.solve(&right)) else {
                continue;
            };
            let squares = self.power[channel] - solution.dot(&right);
            if solution.min() >= 0.0 && squares < least {
                least = squares;
                best = vec![0.0; count];
                members.iter().zip(solution.iter()).for_each(|(&k, value)| best[k] = *value);
            }
        }
        (best, least.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_come_back_and_negative_ones_become_zero() {
        let mut normal = NormalEquations::new(3);
        for k in 0..50 {
            let t = f64::from(k) / 50.0;
            let basis = [1.0, t, t * t];
            let target = DVec3::new(0.5 + 2.0 * t + 3.0 * t * t, 2.0 - t, t * t);
            normal.add(&basis, target);
        }
        let (weights, _) = normal.solve();
        assert!(
            (weights[0].x - 0.5).abs() < 1e-4 && (weights[1].x - 2.0).abs() < 1e-3 && (weights[2].x - 3.0).abs() < 1e-3
        );
        // For a falling line, slope 0 is better than a positive slope.
        assert!(weights[1].y == 0.0 && (weights[0].y - 1.5).abs() < 0.05);
        assert!((weights[2].z - 1.0).abs() < 1e-4 && weights[0].z < 1e-4);
    }
}
