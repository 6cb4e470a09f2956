//! The interreflected part of `G` on a grid.

use glam::{DVec3, Vec3};

use crate::math::directions::PolarGrid;

/// Mean square of the error of a cubic between nodes, relative to that in the middle.
const MEAN_OF_STEP: f64 = 0.4;

/// One of so many rows shows the error of interpolation.
const EXAMINED: usize = 5;

/// `G_indirect` [1/sr] at the nodes of a polar grid for both directions; symmetric.
#[derive(Debug, Clone)]
pub struct InterreflectionTable {
    pub grid: PolarGrid,
    /// Row `o`, column `i`.
    values: Vec<Vec3>,
    /// Fraction of all rays that hit an element.
    pub hit_fraction: f64,
    /// Estimated relative L2 of the error of `G_indirect`: the noise of the walks, and interpolation between nodes.
    pub rel_error: f64,
}

impl InterreflectionTable {
    /// Makes a table from `G` at all pairs of nodes, row by row. The two values of a swapped pair, which differ by
    /// noise, are averaged; `noise` is the root of the sum of the variances of all averages.
    pub(super) fn new(grid: PolarGrid, raw: &[Vec3], noise: f64, hit_fraction: f64) -> Self {
        let n = grid.len();
        let swapped = |at: usize| at % n * n + at / n;
        let values: Vec<Vec3> = (0..n * n).map(|at| 0.5 * (raw[at] + raw[swapped(at)]).max(Vec3::ZERO)).collect();
        let norm = values.iter().map(|value| square(*value)).sum::<f64>().sqrt();
        let mut table = Self { grid, values, hit_fraction, rel_error: 0.0 };
        if norm > 0.0 {
            table.rel_error = (noise / norm).hypot(table.interpolation_error());
        }
        table
    }

    /// Relative L2 of the error of interpolation. Nodes are compared with cubics through neighbours at twice and at four
    /// times the step of the grid; the errors at the step itself follow from both (Richardson 1911).
    fn interpolation_error(&self) -> f64 {
        let (n, azimuths) = (self.grid.len(), self.grid.azimuths);
        let [mut along_rings, mut along_azimuths] = [[0.0_f64; 3]; 2];
        for row in self.values.chunks(n).step_by(EXAMINED) {
            let at = |ring: usize, azimuth: usize| row[ring * azimuths + azimuth % azimuths];
            for (ring, azimuth) in (0..self.grid.rings).flat_map(|ring| (0..azimuths).map(move |at| (ring, at))) {
                let value = at(ring, azimuth);
                // The last ring is the horizon, which is nearer to the one before.
                if (3..self.grid.rings.saturating_sub(3)).contains(&ring) {
                    let between = middle([ring - 3, ring - 1, ring + 1, ring + 3].map(|ring| at(ring, azimuth)));
                    add(&mut along_rings, value, [between, value]);
                }
                let along = |step: usize| {
                    let away = [azimuths - 3 * step, azimuths - step, step, 3 * step];
                    middle(away.map(|away| at(ring, azimuth + away)))
                };
                if azimuths > 12 {
                    add(&mut along_azimuths, value, [along(1), along(2)]);
                }
            }
        }
        // Few rings have neighbours at four times the step, so that azimuths show the order for both.
        let [_, twice, four_times] = along_azimuths;
        let order = if four_times > 0.0 { (twice / four_times).clamp(1.0 / 256.0, 0.25) } else { 0.25 };
        let of = |[norm, twice, _]: [f64; 3]| if norm > 0.0 { MEAN_OF_STEP * order * twice / norm } else { 0.0 };
        // Interpolation is along both angles of both directions.
        (2.0 * (of(along_rings) + of(along_azimuths))).sqrt()
    }

    /// Size of the values in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.values.as_slice())
    }

    /// Calls `out` with the index and `G_indirect(i, o)` [1/sr] of each light; 0 if a direction is at or below the
    /// horizon.
    pub fn eval_lights(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) {
        let n = self.grid.len();
        let to_viewer = self.grid.cubic_taps(o);
        for (k, &i) in lights.iter().enumerate() {
            let mut value = Vec3::ZERO;
            if i.z > 0.0 && o.z > 0.0 {
                let to_light = self.grid.cubic_taps(i);
                for (row, row_weight) in to_viewer {
                    let row = &self.values[row * n..(row + 1) * n];
                    let along: Vec3 = to_light.iter().map(|&(column, weight)| row[column] * weight).sum();
                    value += along * row_weight;
                }
            }
            // A cubic may be below zero; no reflected light is.
            out(k, value.max(Vec3::ZERO).as_dvec3());
        }
    }
}

fn square(value: Vec3) -> f64 {
    value.as_dvec3().length_squared()
}

/// The cubic through four evenly spaced values, in their middle.
fn middle([a, b, c, d]: [Vec3; 4]) -> Vec3 {
    (9.0 * (b + c) - a - d) / 16.0
}

/// Adds the squares of a value and of its distances from two interpolated ones.
fn add(sums: &mut [f64; 3], value: Vec3, others: [Vec3; 2]) {
    let squares = [square(value), square(value - others[0]), square(value - others[1])];
    sums.iter_mut().zip(squares).for_each(|(sum, square)| *sum += square);
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A table of a symmetric function of two directions.
    fn table(of: impl Fn(Vec3, Vec3) -> f32) -> InterreflectionTable {
        let grid = PolarGrid::new(12, 36);
        let nodes = grid.directions();
        let pairs = nodes.iter().flat_map(|o| nodes.iter().map(move |i| (*i, *o)));
        let raw: Vec<Vec3> = pairs.map(|(i, o)| Vec3::splat(of(i, o))).collect();
        InterreflectionTable::new(grid, &raw, 0.0, 1.0)
    }

    /// A lobe about the mirror direction.
    fn lobe(width: f32) -> impl Fn(Vec3, Vec3) -> f32 {
        move |i, o| i.z * o.z * (-(i.truncate() + o.truncate()).length_squared() / (width * width)).exp()
    }

    /// Relative L2 of interpolation at random directions.
    fn true_error(table: &InterreflectionTable, of: impl Fn(Vec3, Vec3) -> f32) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let (mut error, mut norm) = (0.0, 0.0);
        for _ in 0..20_000 {
            let [i, o] = [(); 2].map(|()| {
                let (theta, phi) = (1.4 * random.random::<f32>(), std::f32::consts::TAU * random.random::<f32>());
                crate::math::directions::from_angles(theta, phi)
            });
            table.eval_lights(&[i], o, |_, g| error += (g.x - f64::from(of(i, o))).powi(2));
            norm += f64::from(of(i, o)).powi(2);
        }
        (error / norm).sqrt()
    }

    #[test]
    fn a_smooth_table_states_hardly_an_error_and_a_narrow_lobe_about_that_of_its_interpolation() {
        let smooth = table(|i, o| i.z * o.z);
        assert!(smooth.rel_error < 0.01, "{}", smooth.rel_error);
        for width in [0.15_f32, 0.2, 0.3] {
            let found = table(lobe(width));
            let error = true_error(&found, lobe(width));
            eprintln!("width {width}: stated {:.4}, true {error:.4}", found.rel_error);
            assert!((error / 1.8..error * 1.8).contains(&found.rel_error), "{width}: {} {error}", found.rel_error);
        }
    }
}
