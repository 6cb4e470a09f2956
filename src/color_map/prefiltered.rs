//! The prefiltered table: a map's means under normal distributions over mean and deviation (Heitz et al. 2013, Fig. 4).

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Normal, StopMap, normal};

/// Entries along the mean, which jumps make the demanding axis, and along the deviation.
pub const MEANS: usize = 1024;
pub const DEVIATIONS: usize = 64;
/// Largest deviation of the table. A driver in deviations never has more, apart from noise added to heights.
pub(super) const MAX_DEVIATION: f64 = 1.5;
/// The table covers at least these means [deviations].
const MEAN_RANGE: f64 = 3.0;
/// Below this many steps of the mean, the closed form is read: the table would blur a jump.
const SHARP_STEPS: f64 = 1.5;
/// Entries of Φ and its integral between which building the table interpolates, and the range they cover. The error is
/// below 3e-7.
const STEPS: usize = 4096;
const REACH: f64 = 6.0;

/// A table of [`MEANS`] x [`DEVIATIONS`] linear colours, read bilinearly. The axis of deviations is their square root.
#[derive(Debug, Clone, PartialEq)]
pub struct PrefilteredTable {
    map: StopMap,
    low: f64,
    high: f64,
    /// Row by row; one row per deviation.
    colors: Vec<Vec3>,
}

/// Φ(z) and z Φ(z) + φ(z) at equal steps.
struct NormalTable(Vec<[f64; 2]>);

impl NormalTable {
    fn new() -> Self {
        let at = |k: usize| REACH * (2.0 * k as f64 / STEPS as f64 - 1.0);
        Self((0..=STEPS).map(|k| [normal::cdf(at(k)), normal::ramp(at(k))]).collect())
    }

    fn at(&self, z: f64) -> [f64; 2] {
        if z <= -REACH {
            return [0.0, 0.0];
        }
        if z >= REACH {
            return [1.0, z];
        }
        let x = (z + REACH) * (STEPS as f64 / (2.0 * REACH));
        let k = (x as usize).min(STEPS - 1);
        let (f, [a, b]) = (x - k as f64, [self.0[k], self.0[k + 1]]);
        [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1])]
    }
}

/// A normal distribution through [`NormalTable`].
struct Fast<'a>(Normal, &'a NormalTable);

impl super::Distribution for Fast<'_> {
    fn tail(&self, v: f64) -> f64 {
        self.1.at((self.0.mean - v) / self.0.deviation)[0]
    }

    fn ramp(&self, v: f64) -> f64 {
        self.0.deviation * self.1.at((self.0.mean - v) / self.0.deviation)[1]
    }

    fn deviation(&self) -> f64 {
        self.0.deviation
    }
}

impl PrefilteredTable {
    pub fn new(map: &StopMap) -> Self {
        let (first, last) = map.ends();
        let (low, high) = (first.min(-MEAN_RANGE), last.max(MEAN_RANGE));
        let normals = NormalTable::new();
        let entry = |index: usize| {
            let (row, column) = (index / MEANS, index % MEANS);
            let mean = low + (high - low) * column as f64 / (MEANS - 1) as f64;
            let at = Normal { mean, deviation: deviation_of(row as f64) };
            if row == 0 { map.color(mean).as_vec3() } else { map.mean(&Fast(at, &normals)).as_vec3() }
        };
        let colors = (0..MEANS * DEVIATIONS).into_par_iter().with_min_len(MEANS).map(entry).collect();
        Self { map: map.clone(), low, high, colors }
    }

    /// The mean and the deviation of an entry, for axes of files.
    pub fn axes(&self) -> (Vec<f64>, Vec<f64>) {
        let step = (self.high - self.low) / (MEANS - 1) as f64;
        let means = (0..MEANS).map(|k| self.low + step * k as f64).collect();
        (means, (0..DEVIATIONS).map(|k| deviation_of(k as f64)).collect())
    }

    /// The mean of the first entry, and entries per mean.
    pub fn mean_axis(&self) -> (f32, f32) {
        (self.low as f32, (1.0 / self.step()) as f32)
    }

    /// Linear colours, one row per deviation.
    pub fn colors(&self) -> &[Vec3] {
        &self.colors
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.colors[..])
    }

    /// Step of the mean between entries.
    pub fn step(&self) -> f64 {
        (self.high - self.low) / (MEANS - 1) as f64
    }

    /// The mean of the map under a normal distribution. Outside the table, and where the deviation is below the step of
    /// the means, the closed form is exact and cheap enough.
    pub fn mean(&self, at: &Normal) -> DVec3 {
        let inside = at.mean >= self.low && at.mean <= self.high;
        if !(inside && at.deviation >= SHARP_STEPS * self.step() && at.deviation <= MAX_DEVIATION) {
            return self.map.mean(at);
        }
        let x = (at.mean - self.low) / self.step();
        let y = (at.deviation / MAX_DEVIATION).sqrt() * (DEVIATIONS - 1) as f64;
        let (i, j) = ((x as usize).min(MEANS - 2), (y as usize).min(DEVIATIONS - 2));
        let (f, g) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let row = |j: usize| self.colors[j * MEANS + i].lerp(self.colors[j * MEANS + i + 1], f);
        row(j).lerp(row(j + 1), g).as_dvec3()
    }
}

fn deviation_of(row: f64) -> f64 {
    (row / (DEVIATIONS - 1) as f64).powi(2) * MAX_DEVIATION
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::stops::tests::{MAPS, map};
    use super::*;

    /// Root mean square and largest error of reads at random means and log-uniform deviations.
    pub(crate) fn errors(map: &StopMap, count: usize) -> (f64, f64) {
        let table = PrefilteredTable::new(map);
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let (mut sum, mut worst) = (0.0, 0.0_f64);
        for _ in 0..count {
            let deviation = (0.003_f64.ln() + random.random::<f64>() * (1.5_f64 / 0.003).ln()).exp();
            let at = Normal { mean: -3.0 + 6.0 * random.random::<f64>(), deviation };
            let error = table.mean(&at) - map.mean(&at);
            sum += error.length_squared() / 3.0;
            worst = worst.max(error.abs().max_element());
        }
        ((sum / count as f64).sqrt(), worst)
    }

    #[test]
    fn the_table_is_within_0_002_of_the_closed_form_and_smaller_than_2_mb() {
        for name in MAPS {
            let (rms, worst) = errors(&map(name), 20_000);
            println!("table of {name}: rms {rms:.5}, worst {worst:.3}");
            assert!(rms < 0.002 && worst < 0.08, "{name}: {rms} {worst}");
        }
        assert!(PrefilteredTable::new(&map("bands")).bytes() < 2 << 20);
    }

    #[test]
    fn reads_beyond_the_table_are_the_closed_form() {
        let table = PrefilteredTable::new(&map("bands"));
        for (mean, deviation) in [(-50.0, 0.2), (0.3, 0.0), (0.1, 1e6), (1e9, 1e-9)] {
            let at = Normal { mean, deviation };
            assert_eq!(table.mean(&at), map("bands").mean(&at));
        }
    }
}
