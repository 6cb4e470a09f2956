//! The interreflected part of `G` on a grid.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::math::directions::{CubicTaps, ReducedGrid, RingTaps, Tap};
use crate::math::simd::{self, LANES, azimuth_and_polar_angle, multiversion};

/// Mean square of the error of a cubic between nodes, relative to that in the middle, for lobes of some steps' width.
const MEAN_OF_STEP: f64 = 0.2;

/// From this number of lights on, it is faster to sum whole rows once than the columns that each light reads.
const MIN_LIGHTS_FOR_A_ROW: usize = 3;

/// Azimuths that are stored twice, so that the taps of a ring are contiguous.
const REPEATED: usize = 3;

/// Largest angle of the directions for which errors are stated.
const LARGEST_ANGLE: f64 = 85.0 * std::f64::consts::PI / 180.0;

/// One of so many rows shows the error of interpolation.
const EXAMINED: usize = 11;

/// `G_indirect` [1/sr] at the nodes of a polar grid for both directions; symmetric.
#[derive(Debug, Clone)]
pub struct InterreflectionTable {
    pub grid: ReducedGrid,
    /// A row for each `o`: planes of red, green and blue with the rings of `i`. The first [`REPEATED`] azimuths of a ring
    /// follow its last one.
    rows: Vec<f32>,
    /// Estimated relative L2 of the noise of the walks.
    pub noise: f64,
    /// Estimated relative L2 of the error of interpolation between nodes.
    pub interpolation: f64,
}

impl InterreflectionTable {
    /// Makes a table from `G` at all pairs of nodes, row by row. The two values of a swapped pair, which differ by
    /// noise, are averaged; `noise` is the root of the sum of the variances of all averages, weighted by
    /// [`NodeWeights::of_pair`].
    pub(super) fn new(grid: ReducedGrid, raw: &[Vec3], noise: f64) -> Self {
        let n = grid.len();
        let mean = |row: usize, column: usize| 0.5 * (raw[row * n + column] + raw[column * n + row]).max(Vec3::ZERO);
        let values: Vec<Vec3> = (0..n * n).into_par_iter().map(|at| mean(at / n, at % n)).collect();
        let weights = NodeWeights::new(grid);
        let norm_of_row = |(row, values): (usize, &[Vec3])| {
            values.iter().enumerate().map(|(column, value)| weights.of_pair(row, column) * square(*value)).sum::<f64>()
        };
        // Each row is summed by itself, so that the bits do not depend on the threads.
        let norms: Vec<f64> = values.par_chunks(n).enumerate().map(norm_of_row).collect();
        let norm: f64 = norms.into_iter().sum();
        let (noise, interpolation) =
            if norm > 0.0 { (noise / norm.sqrt(), interpolation_error(grid, &weights, &values)) } else { (0.0, 0.0) };
        let length = 3 * plane_length(grid);
        let mut rows = vec![0.0; n * length];
        rows.par_chunks_mut(length).zip(values.par_chunks(n)).for_each(|(row, values)| {
            let rings = (0..grid.ring_count()).map(|ring| &values[grid.first_node(ring)..grid.first_node(ring + 1)]);
            let nodes = rings.flat_map(|ring| ring.iter().chain(&ring[..REPEATED]));
            for (at, value) in nodes.enumerate() {
                (0..3).for_each(|channel| row[channel * length / 3 + at] = value[channel]);
            }
        });
        Self { grid, rows, noise, interpolation }
    }

    /// An empty table with these errors.
    #[cfg(test)]
    pub fn with_errors(noise: f64, interpolation: f64) -> Self {
        Self { grid: ReducedGrid::new(2), rows: Vec::new(), noise, interpolation }
    }

    /// Estimated relative L2 of the error of `G_indirect`.
    pub fn rel_error(&self) -> f64 {
        self.noise.hypot(self.interpolation)
    }

    /// Size of the values in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.rows.as_slice())
    }

    /// The rows as red, green, blue and zero, row by row: for each `o`, the rings of `i`, each followed by its first
    /// [`REPEATED`] azimuths.
    #[cfg(feature = "gpu")]
    pub fn rgb_rows(&self) -> Vec<[f32; 4]> {
        let plane = plane_length(self.grid);
        let of_row = |row: &[f32]| (0..plane).map(|at| [row[at], row[plane + at], row[2 * plane + at], 0.0]).collect();
        self.rows.chunks(3 * plane).flat_map(|row| -> Vec<_> { of_row(row) }).collect()
    }

    /// Calls `out` with the index and `G_indirect(i, o)` [1/sr] of each light; 0 if a direction is at or below the
    /// horizon. The values do not depend on which lights are asked for together.
    pub fn eval_lights(&self, lights: &[Vec3], o: Vec3, mut out: impl FnMut(usize, DVec3)) {
        let to_viewer = self.grid.nodes(&self.grid.cubic_taps(o));
        // Many lights share the sum over the rows around the viewer. For few lights the columns that they read are enough.
        let mut row = Vec::new();
        if o.z > 0.0 && lights.len() >= MIN_LIGHTS_FOR_A_ROW {
            row = vec![0.0; 3 * plane_length(self.grid)];
            simd::gathered_row(&self.rows, &to_viewer, &mut row);
        }
        for (chunk, lights) in lights.chunks(LANES).enumerate() {
            let mut values = [Vec3::ZERO; LANES];
            if o.z > 0.0 && !row.is_empty() {
                along_lights(&self.grid, &row, lights, &mut values);
            } else if o.z > 0.0 {
                for (i, value) in lights.iter().zip(&mut values).filter(|(i, _)| i.z > 0.0) {
                    let to_light = self.grid.cubic_taps(*i);
                    *value = along_light(&self.grid, &to_light, |at| self.along_viewer(&to_viewer, at));
                }
            }
            values
                .iter()
                .take(lights.len())
                .enumerate()
                .for_each(|(k, value)| out(chunk * LANES + k, value.as_dvec3()));
        }
    }

    /// Four columns of [`simd::gathered_row`], with the same bits.
    fn along_viewer(&self, to_viewer: &[Tap; 16], first: usize) -> [f32; 4] {
        let (length, mut sums) = (3 * plane_length(self.grid), [0.0; 4]);
        for &(row, weight) in to_viewer {
            let values = run(&self.rows, row * length + first);
            (0..4).for_each(|k| sums[k] += weight * values[k]);
        }
        sums
    }
}

multiversion! {
    /// Writes the sum over the taps of each light, at most [`LANES`] of them, in a row.
    pub fn along_lights(grid: &ReducedGrid, row: &[f32], lights: &[Vec3], out: &mut [Vec3; LANES]) {
        let mut angles = [(0.0, 0.0); LANES];
        for (angles, light) in angles.iter_mut().zip(lights) {
            *angles = azimuth_and_polar_angle(*light);
        }
        for ((out, light), angles) in out.iter_mut().zip(lights).zip(angles) {
            if light.z > 0.0 {
                *out = along_light(grid, &grid.cubic_taps_at(angles), |at| run(row, at));
            }
        }
    }
}

/// The sum over the taps of a light; `at` returns four columns of a row, from an index on. A cubic may be below zero; no
/// reflected light is.
#[inline(always)]
fn along_light(grid: &ReducedGrid, taps: &CubicTaps, at: impl Fn(usize) -> [f32; 4]) -> Vec3 {
    let plane = plane_length(*grid);
    let mut sums = [[0.0_f32; 4]; 3];
    for RingTaps { ring, first, weights } in taps.rings {
        let start = grid.first_node(ring) + REPEATED * ring + first;
        for (channel, sums) in sums.iter_mut().enumerate() {
            let values = at(channel * plane + start);
            (0..4).for_each(|k| sums[k] += weights[k] * values[k]);
        }
    }
    Vec3::from(sums.map(|[a, b, c, d]| (a + b) + (c + d))).max(Vec3::ZERO)
}

/// Number of values of a channel in a row.
fn plane_length(grid: ReducedGrid) -> usize {
    grid.len() + REPEATED * grid.ring_count()
}

/// Four values from an index on.
#[inline(always)]
fn run(values: &[f32], at: usize) -> [f32; 4] {
    values.get(at..).and_then(|values| values.first_chunk()).copied().unwrap_or_default()
}

/// Weights with which sums over pairs of nodes are those over pairs of directions up to 85°, uniform in solid angle, of
/// squares of `f̄`: `G` divided by an area that the viewer sees in proportion to the cosine.
pub(super) struct NodeWeights {
    /// Solid angle.
    pub lights: Vec<f64>,
    /// Integral of `1/cos²` over the solid angle.
    pub viewers: Vec<f64>,
}

impl NodeWeights {
    pub fn new(grid: ReducedGrid) -> Self {
        let end = |ring: usize| (ring as f64 * std::f64::consts::FRAC_PI_2 / grid.rings as f64).min(LARGEST_ANGLE);
        let of = |integral: fn(f64) -> f64| -> Vec<f64> {
            let of_ring = |ring: usize| {
                let count = grid.azimuths_of(ring);
                let all = if ring < grid.rings { integral(end(ring + 1)) - integral(end(ring)) } else { 0.0 };
                std::iter::repeat_n(all / count as f64, count)
            };
            (0..grid.ring_count()).flat_map(of_ring).collect()
        };
        Self { lights: of(|theta| -theta.cos()), viewers: of(|theta| 1.0 / theta.cos()) }
    }

    /// The weight of a pair of nodes and its swapped pair.
    pub fn of_pair(&self, row: usize, column: usize) -> f64 {
        0.5 * (self.lights[row] * self.viewers[column] + self.viewers[row] * self.lights[column])
    }
}

/// Relative L2 of the error of interpolation. Nodes are compared with cubics through neighbours at twice and at four
/// times the step of the grid; the errors at the step itself follow from both (Richardson 1911).
fn interpolation_error(grid: ReducedGrid, weights: &NodeWeights, values: &[Vec3]) -> f64 {
    let n = grid.len();
    let of_row = |(index, row): (usize, &[Vec3])| {
        let mut sums = [[0.0_f64; 3]; 2];
        for node in 0..grid.first_node(grid.rings) {
            let (ring, azimuth) = grid.ring_and_azimuth(node);
            let (first, count) = (grid.first_node(ring), grid.azimuths_of(ring));
            let weight = weights.of_pair(index, node);
            if ring + 1 < grid.rings {
                let turns = azimuth as f32 / count as f32;
                let at = |away: i32| {
                    let taps = grid.ring_taps(ring as i32 + away, turns, 1.0);
                    grid.nodes_of_ring(&taps).into_iter().map(|(node, weight)| row[node] * weight).sum::<Vec3>()
                };
                // Near the horizon there is no fourth ring, and a parabola takes three.
                let has_four = ring + 3 < grid.rings;
                let [a, b, c] = [-3, -1, 1].map(at);
                let between = if has_four { middle([a, b, c, at(3)]) } else { 0.75 * b + 0.375 * c - 0.125 * a };
                add(&mut sums[0], weight, row[node], [between, row[node]]);
            }
            if count > 12 {
                let along = |step: usize| {
                    let away = [count - 3 * step, count - step, step, 3 * step];
                    middle(away.map(|away| row[first + (azimuth + away) % count]))
                };
                add(&mut sums[1], weight, row[node], [along(1), along(2)]);
            }
        }
        sums
    };
    let examined: Vec<_> = values.par_chunks(n).enumerate().step_by(EXAMINED).map(of_row).collect();
    let sum = |kind: usize| [0, 1, 2].map(|k| examined.iter().map(|sums| sums[kind][k]).sum::<f64>());
    let [along_rings, along_azimuths] = [sum(0), sum(1)];
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

/// Adds the weighted squares of a value and of its distances from two interpolated ones.
fn add(sums: &mut [f64; 3], weight: f64, value: Vec3, others: [Vec3; 2]) {
    let squares = [square(value), square(value - others[0]), square(value - others[1])];
    sums.iter_mut().zip(squares).for_each(|(sum, square)| *sum += weight * square);
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::metrics::Pair;

    /// A table of a symmetric function of two directions.
    fn table(of: impl Fn(Vec3, Vec3) -> f32) -> InterreflectionTable {
        let grid = ReducedGrid::new(12);
        let nodes = grid.directions();
        let pairs = nodes.iter().flat_map(|o| nodes.iter().map(move |i| (*i, *o)));
        let raw: Vec<Vec3> = pairs.map(|(i, o)| Vec3::splat(of(i, o))).collect();
        InterreflectionTable::new(grid, &raw, 0.0)
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
            // More than are evaluated at once.
            let (lights, o) = ([(); LANES + 6].map(|()| direction()), direction());
            let mut together = [DVec3::ZERO; LANES + 6];
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

    /// Relative L2 of interpolation in `G` over the viewer's cosine, at random directions up to 85°.
    fn true_error(table: &InterreflectionTable, of: impl Fn(Vec3, Vec3) -> f32) -> f64 {
        let (mut error, mut norm) = (0.0, 0.0);
        for Pair { i, o } in random_pairs(20_000) {
            let weight = 1.0 / f64::from(o.z).powi(2);
            table.eval_lights(&[i], o, |_, g| error += weight * (g.x - f64::from(of(i, o))).powi(2));
            norm += weight * f64::from(of(i, o)).powi(2);
        }
        (error / norm).sqrt()
    }

    /// Pairs of directions up to 85°, uniform in solid angle.
    fn random_pairs(count: usize) -> impl Iterator<Item = Pair> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let least = LARGEST_ANGLE.cos() as f32;
        (0..count).map(move |_| {
            let [i, o] = [(); 2].map(|()| {
                let (theta, phi) =
                    (random.random_range(least..1.0).acos(), random.random_range(0.0..std::f32::consts::TAU));
                crate::math::directions::from_angles(theta, phi)
            });
            Pair { i, o }
        })
    }

    #[test]
    fn weights_of_nodes_sum_to_the_integrals_up_to_85_degrees() {
        use std::f64::consts::TAU;
        for rings in [8, 12] {
            let NodeWeights { lights, viewers } = NodeWeights::new(ReducedGrid::new(rings));
            let [lights, viewers] = [lights, viewers].map(|weights| TAU * weights.into_iter().sum::<f64>());
            assert!((lights - TAU * (1.0 - LARGEST_ANGLE.cos())).abs() < 1e-9, "{lights}");
            assert!((viewers - TAU * (1.0 / LARGEST_ANGLE.cos() - 1.0)).abs() < 1e-9, "{viewers}");
        }
    }

    #[test]
    fn a_smooth_table_states_hardly_an_error_and_a_narrow_lobe_about_that_of_its_interpolation() {
        let smooth = table(|i, o| i.z * o.z);
        assert!(smooth.rel_error() < 0.01, "{}", smooth.rel_error());
        for width in [0.15_f32, 0.2, 0.3, 0.4, 0.5] {
            let found = table(lobe(width));
            let error = true_error(&found, lobe(width));
            eprintln!("width {width}: stated {:.4}, true {error:.4}", found.rel_error());
            assert!((error / 1.8..error * 1.8).contains(&found.rel_error()), "{width}: {} {error}", found.rel_error());
        }
    }
}
