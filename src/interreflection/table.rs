//! The interreflected part of `G` on a grid.

use glam::{DVec3, Vec3};

use crate::math::directions::{CubicTaps, PolarGrid, Tap};
use crate::math::simd;

/// Mean square of the error of a cubic between nodes, relative to that in the middle.
const MEAN_OF_STEP: f64 = 0.4;

/// From this number of lights on, it is faster to sum whole rows once than the columns that each light reads.
const MIN_LIGHTS_FOR_A_ROW: usize = 3;

/// Azimuths that are stored twice, so that the taps of a ring are contiguous.
const REPEATED: usize = 3;

/// One of so many rows shows the error of interpolation.
const EXAMINED: usize = 5;

/// `G_indirect` [1/sr] at the nodes of a polar grid for both directions; symmetric.
#[derive(Debug, Clone)]
pub struct InterreflectionTable {
    pub grid: PolarGrid,
    /// A row for each `o`: planes of red, green and blue with the rings of `i`. The first [`REPEATED`] azimuths of a ring
    /// follow its last one.
    rows: Vec<f32>,
    /// Fraction of all rays that hit an element.
    pub hit_fraction: f64,
    /// Estimated relative L2 of the noise of the walks.
    pub noise: f64,
    /// Estimated relative L2 of the error of interpolation between nodes.
    pub interpolation: f64,
}

impl InterreflectionTable {
    /// Makes a table from `G` at all pairs of nodes, row by row. The two values of a swapped pair, which differ by
    /// noise, are averaged; `noise` is the root of the sum of the variances of all averages.
    pub(super) fn new(grid: PolarGrid, raw: &[Vec3], noise: f64, hit_fraction: f64) -> Self {
        let n = grid.len();
        let swapped = |at: usize| at % n * n + at / n;
        let values: Vec<Vec3> = (0..n * n).map(|at| 0.5 * (raw[at] + raw[swapped(at)]).max(Vec3::ZERO)).collect();
        let norm = values.iter().map(|value| square(*value)).sum::<f64>().sqrt();
        let (noise, interpolation) =
            if norm > 0.0 { (noise / norm, interpolation_error(grid, &values)) } else { (0.0, 0.0) };
        let mut rows = Vec::with_capacity(n * row_length(grid));
        for (row, channel) in values.chunks(n).flat_map(|row| (0..3).map(move |channel| (row, channel))) {
            for ring in row.chunks(grid.azimuths) {
                rows.extend(ring.iter().chain(&ring[..REPEATED]).map(|value| value[channel]));
            }
        }
        Self { grid, rows, hit_fraction, noise, interpolation }
    }

    /// An empty table with these errors.
    #[cfg(test)]
    pub fn with_errors(noise: f64, interpolation: f64) -> Self {
        Self { grid: PolarGrid::new(2, 4), rows: Vec::new(), hit_fraction: 0.0, noise, interpolation }
    }

    /// Estimated relative L2 of the error of `G_indirect`.
    pub fn rel_error(&self) -> f64 {
        self.noise.hypot(self.interpolation)
    }

    /// Size of the values in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.rows.as_slice())
    }

    /// Calls `out` with the index and `G_indirect(i, o)` [1/sr] of each light; 0 if a direction is at or below the
    /// horizon. The values do not depend on which lights are asked for together.
    pub fn eval_lights(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) {
        let to_viewer = self.grid.cubic_taps(o).nodes();
        // Many lights share the sum over the rows around the viewer. For few lights the columns that they read are enough.
        let mut row = Vec::new();
        if o.z > 0.0 && lights.len() >= MIN_LIGHTS_FOR_A_ROW {
            row = vec![0.0; row_length(self.grid)];
            simd::gathered_row(&self.rows, &to_viewer, &mut row);
        }
        for (k, &i) in lights.iter().enumerate() {
            let mut value = Vec3::ZERO;
            if i.z > 0.0 && o.z > 0.0 {
                let to_light = self.grid.cubic_taps(i);
                value = match row.is_empty() {
                    true => self.along_light(&to_light, |at| self.along_viewer(&to_viewer, at)),
                    false => self.along_light(&to_light, |at| run(&row, at)),
                };
            }
            // A cubic may be below zero; no reflected light is.
            out(k, value.max(Vec3::ZERO).as_dvec3());
        }
    }

    /// The sum over the taps of a light; `at` returns four columns of a row, from an index on.
    #[inline(always)]
    fn along_light(&self, taps: &CubicTaps, at: impl Fn(usize) -> [f32; 4]) -> Vec3 {
        let per_ring = self.grid.azimuths + REPEATED;
        let mut sums = [[0.0_f32; 4]; 3];
        for (ring, first, weight) in taps.rings {
            for (channel, sums) in sums.iter_mut().enumerate() {
                let values = at((channel * self.grid.ring_count() + ring) * per_ring + first);
                (0..4).for_each(|k| sums[k] += weight * values[k]);
            }
        }
        Vec3::from(sums.map(|sums| (0..4).map(|k| taps.azimuths[k] * sums[k]).sum()))
    }

    /// Four columns of [`simd::gathered_row`], with the same bits.
    fn along_viewer(&self, to_viewer: &[Tap; 16], first: usize) -> [f32; 4] {
        let (length, mut sums) = (row_length(self.grid), [0.0; 4]);
        for &(row, weight) in to_viewer {
            let values = run(&self.rows, row * length + first);
            (0..4).for_each(|k| sums[k] += weight * values[k]);
        }
        sums
    }
}

/// Number of values in a row.
fn row_length(grid: PolarGrid) -> usize {
    3 * grid.ring_count() * (grid.azimuths + REPEATED)
}

/// Four values from an index on.
#[inline(always)]
fn run(values: &[f32], at: usize) -> [f32; 4] {
    values.get(at..).and_then(|values| values.first_chunk()).copied().unwrap_or_default()
}

/// Relative L2 of the error of interpolation. Nodes are compared with cubics through neighbours at twice and at four
/// times the step of the grid; the errors at the step itself follow from both (Richardson 1911).
fn interpolation_error(grid: PolarGrid, values: &[Vec3]) -> f64 {
    let (n, azimuths) = (grid.len(), grid.azimuths);
    let [mut along_rings, mut along_azimuths] = [[0.0_f64; 3]; 2];
    for row in values.chunks(n).step_by(EXAMINED) {
        let at = |ring: usize, azimuth: usize| row[ring * azimuths + azimuth % azimuths];
        for (ring, azimuth) in (0..grid.rings).flat_map(|ring| (0..azimuths).map(move |at| (ring, at))) {
            let value = at(ring, azimuth);
            // The last ring is the horizon, which is nearer to the one before.
            if (3..grid.rings.saturating_sub(3)).contains(&ring) {
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

    #[test]
    fn lights_that_are_asked_for_together_have_the_bits_of_each_alone() {
        let table = table(lobe(0.5));
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut direction = || {
            let (theta, phi) = (random.random_range(0.0..1.6_f32), random.random_range(0.0..6.3_f32));
            crate::math::directions::from_angles(theta, phi)
        };
        for _ in 0..50 {
            let (lights, o) = ([(); 40].map(|()| direction()), direction());
            let mut together = [DVec3::ZERO; 40];
            table.eval_lights(&lights, o, |k, g| together[k] = g);
            for (light, expected) in lights.into_iter().zip(together) {
                table.eval_lights(&[light], o, |_, g| assert_eq!(g, expected, "{light} {o}"));
            }
            assert!(together.iter().any(|g| g.x > 0.0) || o.z <= 0.0);
        }
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
        assert!(smooth.rel_error() < 0.01, "{}", smooth.rel_error());
        for width in [0.15_f32, 0.2, 0.3] {
            let found = table(lobe(width));
            let error = true_error(&found, lobe(width));
            eprintln!("width {width}: stated {:.4}, true {error:.4}", found.rel_error());
            assert!((error / 1.8..error * 1.8).contains(&found.rel_error()), "{width}: {} {error}", found.rel_error());
        }
    }
}
