//! Scattered samples on a grid of directions (push-pull, Gortler et al. 1996, Sec. 3.4).

use glam::DVec2;

/// A square of directions (i.x, i.y) with a power of two of cells per side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionGrid {
    pub side: usize,
    pub center: DVec2,
    pub half: f64,
}

/// Values on a [`DirectionGrid`], x fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Slice {
    pub values: Vec<f32>,
    /// True for cells that hold samples. The others are filled in and are no data.
    pub covered: Vec<bool>,
}

impl DirectionGrid {
    /// Index of the cell of a direction; `None` outside.
    fn cell(&self, i: DVec2) -> Option<usize> {
        let at = ((i - self.center + self.half) / (2.0 * self.half) * self.side as f64).floor();
        let last = (self.side - 1) as f64;
        let is_inside = at.cmpge(DVec2::ZERO).all() && at.cmple(DVec2::splat(last)).all();
        is_inside.then(|| at.y as usize * self.side + at.x as usize)
    }

    /// Returns true for a direction inside.
    pub fn holds(&self, i: DVec2) -> bool {
        self.cell(i).is_some()
    }

    /// Averages samples in cells and fills the others from coarser levels. All cells are 0 without any sample inside.
    pub fn push_pull(&self, samples: impl IntoIterator<Item = (DVec2, f64)>) -> Slice {
        let mut level = Level { side: self.side, weights: vec![0.0; self.side * self.side], values: Vec::new() };
        let mut sums = vec![0.0; self.side * self.side];
        for (i, value) in samples {
            if let Some(cell) = self.cell(i) {
                sums[cell] += value;
                level.weights[cell] += 1.0;
            }
        }
        level.values = sums.iter().zip(&level.weights).map(|(sum, weight)| sum / weight.max(1.0)).collect();
        level.saturate();
        let covered = level.weights.iter().map(|weight| *weight > 0.0).collect();
        let mut levels = vec![level];
        while let Some(coarse) = levels.last().filter(|level| level.side > 1).map(Level::pulled) {
            levels.push(coarse);
        }
        let mut filled = levels.pop().map(|level| level.values).unwrap_or_default();
        while let Some(level) = levels.pop() {
            filled = level.pushed(&filled);
        }
        Slice { values: filled.into_iter().map(|value| value as f32).collect(), covered }
    }
}

/// Values with weights from 0 to 1.
struct Level {
    side: usize,
    weights: Vec<f64>,
    values: Vec<f64>,
}

impl Level {
    fn saturate(&mut self) {
        self.weights.iter_mut().for_each(|weight| *weight = weight.min(1.0));
    }

    /// The next coarser level: weighted means of four cells each.
    fn pulled(&self) -> Self {
        let side = self.side / 2;
        let mut coarse = Self { side, weights: vec![0.0; side * side], values: vec![0.0; side * side] };
        for (k, (weight, value)) in self.weights.iter().zip(&self.values).enumerate() {
            let at = k / self.side / 2 * side + k % self.side / 2;
            coarse.weights[at] += weight;
            coarse.values[at] += weight * value;
        }
        for (value, weight) in coarse.values.iter_mut().zip(&coarse.weights) {
            *value = if *weight > 0.0 { *value / weight } else { 0.0 };
        }
        coarse.saturate();
        coarse
    }

    /// This level with its gaps filled from the next coarser one, interpolated bilinearly.
    fn pushed(&self, coarse: &[f64]) -> Vec<f64> {
        let half = self.side / 2;
        // Middles of fine cells lie a quarter of a coarse cell beside the middle of their own.
        let near = |at: usize| {
            let other = if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { (at / 2 + 1).min(half - 1) };
            (at / 2, other)
        };
        let value = |k: usize| {
            let ((x, x2), (y, y2)) = (near(k % self.side), near(k / self.side));
            let row = |y: usize| 0.75 * coarse[y * half + x] + 0.25 * coarse[y * half + x2];
            let filled = 0.75 * row(y) + 0.25 * row(y2);
            self.weights[k] * self.values[k] + (1.0 - self.weights[k]) * filled
        };
        (0..self.side * self.side).map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: DirectionGrid = DirectionGrid { side: 16, center: DVec2::new(-0.5, 0.1), half: 0.4 };

    fn middle(k: usize) -> DVec2 {
        GRID.center + (DVec2::new((k % 16) as f64, (k / 16) as f64) + 0.5) * (0.8 / 16.0) - GRID.half
    }

    #[test]
    fn samples_in_every_cell_come_back_and_a_constant_fills_all_gaps() {
        let value = |i: DVec2| (3.0 * i.x).sin() + i.y;
        let full = GRID.push_pull((0..256).map(|k| (middle(k), value(middle(k)))));
        assert!(full.covered.iter().all(|covered| *covered));
        assert!((0..256).all(|k| (f64::from(full.values[k]) - value(middle(k))).abs() < 1e-6));
        let sparse = GRID.push_pull((0..256).step_by(37).map(|k| (middle(k), 2.5)));
        assert_eq!(sparse.covered.iter().filter(|covered| **covered).count(), 7);
        assert!(sparse.values.iter().all(|value| (value - 2.5).abs() < 1e-6));
    }

    #[test]
    fn gaps_in_a_plane_are_filled_to_a_fraction_of_its_range() {
        let plane = |i: DVec2| 1.0 + i.x - 2.0 * i.y;
        let checker = (0..256).filter(|k| (k % 16 + k / 16) % 2 == 0).map(|k| (middle(k), plane(middle(k))));
        let slice = GRID.push_pull(checker);
        let inner = |k: &usize| (2..14).contains(&(k % 16)) && (2..14).contains(&(k / 16));
        let worst = (0..256).filter(inner).map(|k| (f64::from(slice.values[k]) - plane(middle(k))).abs());
        // One cell is 0.05 wide, along which the plane changes by 0.15 at most.
        assert!(worst.fold(0.0, f64::max) < 0.05);
    }

    #[test]
    fn no_sample_inside_gives_zeros_that_are_no_data() {
        let slice = GRID.push_pull([(DVec2::new(3.0, 0.0), 1.0), (DVec2::new(f64::NAN, 0.0), 1.0)]);
        assert!(slice.values.iter().all(|value| *value == 0.0) && !slice.covered.contains(&true));
    }
}
