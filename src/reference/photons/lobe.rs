//! Lobes of one direction of the light, from photons that are counted over the disc of exit directions.

use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::base::{Cancel, Result};
use crate::slab::{ChannelSlab, Exit, Tally};

/// Traces photons of one direction and colour channel.
pub trait PhotonSource: Sync {
    /// Follows a photon of weight 1 and reports all light that leaves.
    fn photon(&self, i: DVec3, rng: &mut ChaCha8Rng, exit: &mut dyn FnMut(Exit)) -> Tally;
}

impl PhotonSource for ChannelSlab<'_> {
    fn photon(&self, i: DVec3, rng: &mut ChaCha8Rng, exit: &mut dyn FnMut(Exit)) -> Tally {
        self.run(i, rng, exit)
    }
}

/// Work and accuracy of a lobe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobeSettings {
    /// Cells per side of the square around the disc (o.x, o.y).
    pub side: usize,
    /// Largest number of photons.
    pub photons: usize,
    /// Relative L2 of the standard errors of the cells at which the photons end.
    pub target: f64,
    pub seed: u64,
}

impl Default for LobeSettings {
    fn default() -> Self {
        Self { side: 96, photons: 4_000_000, target: 0.02, seed: 1 }
    }
}

/// Photons of one stream of random numbers, and streams between two checks of the error.
const CHUNK: usize = 8192;
const CHUNKS_PER_BATCH: usize = 16;
/// Polar angle [degrees] up to which errors are taken.
pub const ERROR_LIMIT_DEG: f64 = 85.0;

/// A mean with its standard error.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct Estimated {
    pub value: f64,
    pub standard_error: f64,
}

/// Parts of the incident light.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Totals {
    pub transmitted: Estimated,
    /// Transmitted without a reflection inside.
    pub single_pass: Estimated,
    /// Transmitted by level facets alone; a part of `transmitted`.
    pub straight: Estimated,
    pub reflected: Estimated,
    /// Reflected by the top face; a part of `reflected`.
    pub first_reflected: Estimated,
    pub absorbed: Estimated,
    /// Light that masking removes; 0 for explicit tiles.
    pub masked: Estimated,
    /// Light that the second face reflects totally when it first arrives.
    pub first_total_reflection: Estimated,
    /// All parts together, which should be 1.
    pub sum: Estimated,
}

/// BTDF over the cells of the disc (o.x, o.y), x fastest, with the variance of each cell. A cell holds flux per area of the
/// disc, which is the mean of the BTDF over the cell. Straight light is left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Bins {
    pub values: Vec<f64>,
    pub variances: Vec<f64>,
}

/// The lobe of one direction of the light in one colour channel.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueLobe {
    pub side: usize,
    pub photons: usize,
    /// Light without reflections inside, and all light.
    pub single: Bins,
    pub all: Bins,
    pub totals: Totals,
}

/// Number of fields of [`Totals`].
const PARTS: usize = 9;

/// Sums over photons.
struct Sums {
    single: Vec<[f64; 2]>,
    all: Vec<[f64; 2]>,
    parts: [[f64; 2]; PARTS],
}

impl Sums {
    fn new(side: usize) -> Self {
        let cells = vec![[0.0; 2]; side * side];
        Self { single: cells.clone(), all: cells, parts: [[0.0; 2]; PARTS] }
    }

    fn add(&mut self, other: &Self) {
        let pairs = self.single.iter_mut().zip(&other.single).chain(self.all.iter_mut().zip(&other.all));
        for (sum, more) in pairs.chain(self.parts.iter_mut().zip(&other.parts)) {
            sum[0] += more[0];
            sum[1] += more[1];
        }
    }
}

impl TrueLobe {
    /// Traces photons from `i`, which points up, until the lobe of all light reaches the target or the photons end.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn trace(source: &impl PhotonSource, i: DVec3, settings: &LobeSettings, cancel: &Cancel) -> Result<Self> {
        let batches = settings.photons.div_ceil(CHUNK * CHUNKS_PER_BATCH).max(1);
        let mut sums = Sums::new(settings.side);
        let mut photons = 0;
        for batch in 0..batches {
            cancel.check()?;
            let chunks: Vec<Sums> = (0..CHUNKS_PER_BATCH)
                .into_par_iter()
                .map(|chunk| trace_chunk(source, i, settings, (batch * CHUNKS_PER_BATCH + chunk) as u64))
                .collect();
            chunks.iter().for_each(|chunk| sums.add(chunk));
            photons += CHUNK * CHUNKS_PER_BATCH;
            let lobe = Self::of_sums(&sums, settings.side, photons);
            if batch + 1 == batches || lobe.noise() < settings.target {
                return Ok(lobe);
            }
        }
        Ok(Self::of_sums(&sums, settings.side, photons))
    }

    fn of_sums(sums: &Sums, side: usize, photons: usize) -> Self {
        let n = photons as f64;
        let area = (2.0 / side as f64).powi(2);
        let bins = |cells: &[[f64; 2]]| Bins {
            values: cells.iter().map(|cell| cell[0] / (n * area)).collect(),
            variances: cells
                .iter()
                .map(|[sum, square]| (square - sum * sum / n).max(0.0) / (n * area).powi(2))
                .collect(),
        };
        let part = |k: usize| {
            let [sum, square] = sums.parts[k];
            let variance = (square / n - (sum / n).powi(2)).max(0.0) / n;
            Estimated { value: sum / n, standard_error: variance.sqrt() }
        };
        let totals = Totals {
            transmitted: part(0),
            single_pass: part(1),
            straight: part(2),
            reflected: part(3),
            absorbed: part(4),
            masked: part(5),
            first_total_reflection: part(6),
            sum: part(7),
            first_reflected: part(8),
        };
        Self { side, photons, single: bins(&sums.single), all: bins(&sums.all), totals }
    }

    /// Weight of a cell in errors: its solid angle over its area on the disc; 0 beyond [`ERROR_LIMIT_DEG`].
    fn weight(&self, cell: usize) -> f64 {
        let square = center(self.side, cell).length_squared();
        let limit = ERROR_LIMIT_DEG.to_radians().sin().powi(2);
        if square < limit { 1.0 / (1.0 - square).sqrt() } else { 0.0 }
    }

    /// Relative L2 of the standard errors of all light.
    pub fn noise(&self) -> f64 {
        let sums = (0..self.all.values.len()).fold((0.0, 0.0), |(noise, norm), cell| {
            let weight = self.weight(cell);
            (noise + weight * self.all.variances[cell], norm + weight * self.all.values[cell].powi(2))
        });
        if sums.1 > 0.0 { (sums.0 / sums.1).sqrt() } else { 0.0 }
    }

    /// Relative L2 over solid angle of a model's cells against these, with the noise of the truth taken out.
    pub fn relative_l2(&self, truth: &Bins, model: &[f64]) -> f64 {
        let (mut difference, mut norm) = (0.0, 0.0);
        let cells = truth.values.iter().zip(&truth.variances).zip(model).enumerate();
        for (cell, ((value, variance), model)) in cells {
            let weight = self.weight(cell);
            difference += weight * ((model - value).powi(2) - variance);
            norm += weight * (value.powi(2) - variance);
        }
        if norm > 0.0 { (difference.max(0.0) / norm).sqrt() } else { 0.0 }
    }
}

/// Middle of a cell of the disc.
fn center(side: usize, cell: usize) -> glam::DVec2 {
    (glam::DVec2::new((cell % side) as f64, (cell / side) as f64) + 0.5) * (2.0 / side as f64) - 1.0
}

/// Means of a function of the direction `o`, which points down, over the cells of the disc, from `sub` by `sub` points of
/// each. Points outside the disc count as 0.
pub fn cell_means(side: usize, sub: usize, value: impl Fn(DVec3) -> f64 + Sync) -> Vec<f64> {
    let mean = |cell: usize| {
        let corner = glam::DVec2::new((cell % side) as f64, (cell / side) as f64);
        let point = |k: usize| {
            let inside = (glam::DVec2::new((k % sub) as f64, (k / sub) as f64) + 0.5) / sub as f64;
            let at = (corner + inside) * (2.0 / side as f64) - 1.0;
            let square = at.length_squared();
            if square < 1.0 - 1e-9 { value(at.extend(-(1.0 - square).sqrt())) } else { 0.0 }
        };
        (0..sub * sub).map(point).sum::<f64>() / (sub * sub) as f64
    };
    (0..side * side).into_par_iter().map(mean).collect()
}

/// Traces the photons of one stream of random numbers.
fn trace_chunk(source: &impl PhotonSource, i: DVec3, settings: &LobeSettings, stream: u64) -> Sums {
    let side = settings.side;
    let mut sums = Sums::new(side);
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    rng.set_stream(stream);
    for _ in 0..CHUNK {
        let mut parts = [0.0; PARTS];
        let losses = source.photon(i, &mut rng, &mut |exit| {
            let Exit { direction, weight, bounces, is_straight } = exit;
            if direction.z >= 0.0 {
                parts[3] += weight;
                if bounces == 0 {
                    parts[8] += weight;
                }
                return;
            }
            parts[0] += weight;
            if bounces == 0 {
                parts[1] += weight;
            }
            if is_straight {
                parts[2] += weight;
                return;
            }
            let cell = |x: f64| (((x + 1.0) / 2.0 * side as f64) as usize).min(side - 1);
            let at = cell(direction.y) * side + cell(direction.x);
            let count = |cells: &mut [[f64; 2]]| {
                cells[at][0] += weight;
                cells[at][1] += weight * weight;
            };
            count(&mut sums.all);
            if bounces == 0 {
                count(&mut sums.single);
            }
        });
        parts[4] = losses.absorbed;
        parts[5] = losses.masked;
        parts[6] = losses.first_total_reflection;
        parts[7] = parts[0] + parts[3] + losses.absorbed + losses.masked;
        for (sum, part) in sums.parts.iter_mut().zip(parts) {
            sum[0] += part;
            sum[1] += part * part;
        }
    }
    sums
}
