//! Noise that repeats with the tile, as samples on a square grid.

use std::f64::consts::{PI, TAU};

use glam::DVec2;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::math::linalg::gemm::{add_outer_products, multiply_parallel};
use crate::scene::{NoiseBasis, NoiseDriver};

/// Samples per cell of the finest octave, and the limits of a grid's side.
const SAMPLES_PER_CELL: usize = 8;
const SIDES: (usize, usize) = (64, 1024);
/// Impulses of Gabor noise per cell.
const IMPULSES: usize = 12;
/// Frequency and bandwidth of a Gabor kernel, per cell.
const FREQUENCY: f64 = 1.0;
const BANDWIDTH: f64 = 0.6;

/// Side of the grid, and samples row by row; sample (x, y) lies at `((x+½)/side, (y+½)/side)`.
pub fn rasterize(noise: &NoiseDriver) -> (usize, Vec<f32>) {
    let finest = (noise.cells as usize) << (noise.octaves - 1);
    let side = (finest * SAMPLES_PER_CELL).next_power_of_two().clamp(SIDES.0, SIDES.1);
    let mut values = vec![0.0; side * side];
    for octave in 0..noise.octaves {
        let cells = (noise.cells as usize) << octave;
        let random = ChaCha8Rng::seed_from_u64(noise.seed.wrapping_add(u64::from(octave) << 32));
        let layer = match noise.basis {
            NoiseBasis::Perlin => perlin(side, cells, random),
            NoiseBasis::Gabor => gabor(side, cells, random),
            NoiseBasis::Gaussian => gaussian(side, cells, random),
        };
        let square: f64 = layer.iter().map(|value| value * value).sum::<f64>() / layer.len() as f64;
        let amplitude = if square > 0.0 { 0.5_f64.powi(octave as i32) / square.sqrt() } else { 0.0 };
        values.iter_mut().zip(layer).for_each(|(sum, value)| *sum += (value * amplitude) as f32);
    }
    (side, values)
}

/// A function of the point at every sample; points are in cells.
fn at_samples(side: usize, cells: usize, value: impl Fn(DVec2) -> f64 + Sync) -> Vec<f64> {
    let step = cells as f64 / side as f64;
    let at = |k: usize| value((DVec2::new((k % side) as f64, (k / side) as f64) + 0.5) * step);
    (0..side * side).into_par_iter().with_min_len(4096).map(at).collect()
}

/// Gradient noise (Perlin 2002) with unit gradients.
fn perlin(side: usize, cells: usize, mut random: impl Rng) -> Vec<f64> {
    let gradients: Vec<DVec2> = (0..cells * cells).map(|_| DVec2::from_angle(TAU * random.random::<f64>())).collect();
    at_samples(side, cells, |p| {
        let (cell, f) = (p.floor(), p - p.floor());
        let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
        let corner = |dx: usize, dy: usize| {
            let (x, y) = ((cell.x as usize + dx) % cells, (cell.y as usize + dy) % cells);
            gradients[y * cells + x].dot(f - DVec2::new(dx as f64, dy as f64))
        };
        let row = |dy| corner(0, dy) + fade.x * (corner(1, dy) - corner(0, dy));
        row(0) + fade.y * (row(1) - row(0))
    })
}

/// An impulse of Gabor noise: its position within the cell, the wave vector, the phase and the sign of its kernel.
#[derive(Debug, Clone, Copy)]
struct Impulse {
    at: DVec2,
    wave: DVec2,
    phase: f64,
    sign: f64,
}

/// Cells around that of a sample whose impulses reach it. Two cells away a kernel is below 1 %.
const NEIGHBORS: [i64; 5] = [-2, -1, 0, 1, 2];

/// The impulses of all cells, [`IMPULSES`] each.
fn impulses(cells: usize, mut random: impl Rng) -> Vec<Impulse> {
    let impulse = |_| {
        let at = DVec2::new(random.random(), random.random());
        let wave = DVec2::from_angle(TAU * random.random::<f64>()) * (TAU * FREQUENCY);
        Impulse {
            at,
            wave,
            phase: TAU * random.random::<f64>(),
            sign: if random.random::<bool>() { 1.0 } else { -1.0 },
        }
    };
    (0..cells * cells * IMPULSES).map(impulse).collect()
}

/// Sparse convolution noise with Gabor kernels of random orientation and phase (Lagae et al. 2009). A kernel
/// `e^(-a d²) cos(k·d + φ)` is the real part of a product of functions of the two coordinates, so that the samples of a
/// cell are a matrix product over the impulses around it.
fn gabor(side: usize, cells: usize, random: impl Rng) -> Vec<f64> {
    let impulses = impulses(cells, random);
    let step = cells as f64 / side as f64;
    let position = |k: usize| (k as f64 + 0.5) * step;
    // The first sample in each cell along an axis.
    let starts: Vec<usize> =
        (0..=cells).map(|cell| (0..side).position(|k| position(k) >= cell as f64).unwrap_or(side)).collect();
    let wrapped = |cell: usize, offset: i64| (cell as i64 + offset).rem_euclid(cells as i64) as usize;
    let of_cell = |cell: usize| {
        let [cx, cy] = [cell % cells, cell / cells];
        let [columns, rows] = [cx, cy].map(|cell| starts[cell]..starts[cell + 1]);
        let (mut along_x, mut along_y) = (Vec::new(), Vec::new());
        for (dy, dx) in NEIGHBORS.into_iter().flat_map(|dy| NEIGHBORS.map(|dx| (dy, dx))) {
            let first = (wrapped(cy, dy) * cells + wrapped(cx, dx)) * IMPULSES;
            for Impulse { at, wave, phase, sign } in &impulses[first..first + IMPULSES] {
                let d = |first: usize, cell: usize, offset: i64, at: f64| {
                    position(first) - (cell as i64 + offset) as f64 - at
                };
                let [x, y] = [d(columns.start, cx, dx, at.x), d(rows.start, cy, dy, at.y)];
                push_wave([x, step], columns.len(), wave.x, 0.0, [1.0, 1.0], &mut along_x);
                push_wave([y, step], rows.len(), wave.y, *phase, [*sign, -sign], &mut along_y);
            }
        }
        let terms = 2 * NEIGHBORS.len().pow(2) * IMPULSES;
        let mut values = vec![0.0; rows.len() * columns.len()];
        let sizes = [rows.len(), columns.len()];
        add_outer_products(terms, sizes, [&along_y, &along_x], sizes, &mut values);
        (rows.start, columns, values)
    };
    let blocks: Vec<_> = (0..cells * cells).into_par_iter().map(of_cell).collect();
    let mut field = vec![0.0; side * side];
    for (first, columns, values) in blocks {
        for (row, values) in values.chunks(columns.len().max(1)).enumerate() {
            let start = (first + row) * side + columns.start;
            field[start..start + values.len()].copy_from_slice(values);
        }
    }
    field
}

/// Appends `e^(-a d²)` times the cosine of `k d + φ`, then times its sine, both scaled, at evenly spaced distances `d`.
/// Each follows from the one before.
fn push_wave([d, step]: [f64; 2], count: usize, k: f64, phase: f64, scales: [f64; 2], out: &mut Vec<f32>) {
    let a = PI * BANDWIDTH * BANDWIDTH;
    let (mut wave, turn) = (DVec2::from_angle(k * d + phase), DVec2::from_angle(k * step));
    let mut envelope = (-a * d * d).exp();
    let (mut ratio, change) = ((-a * step * (2.0 * d + step)).exp(), (-2.0 * a * step * step).exp());
    let first = out.len();
    out.resize(first + 2 * count, 0.0);
    let (cosines, sines) = out[first..].split_at_mut(count);
    for (cosine, sine) in cosines.iter_mut().zip(sines) {
        *cosine = (scales[0] * envelope * wave.x) as f32;
        *sine = (scales[1] * envelope * wave.y) as f32;
        wave = turn.rotate(wave);
        envelope *= ratio;
        ratio *= change;
    }
}

/// White noise convolved with exp(-2 r²/L²), where L is a cell, so that its autocorrelation is exp(-r²/L²). The
/// convolution along an axis is a product with a circulant matrix.
fn gaussian(side: usize, cells: usize, mut random: impl Rng) -> Vec<f64> {
    let length = side as f64 / cells as f64;
    let reach = ((2.2 * length).ceil() as i64).min(2 * side as i64);
    let mut first_row = vec![0.0; side];
    for offset in -reach..=reach {
        first_row[offset.rem_euclid(side as i64) as usize] += (-2.0 * (offset as f64 / length).powi(2)).exp();
    }
    let circulant: Vec<f32> = (0..side * side).map(|k| first_row[(k % side + side - k / side) % side] as f32).collect();
    let white = |_| crate::color_map::normal::quantile(random.random::<f64>().max(1e-300)) as f32;
    let field: Vec<f32> = (0..side * side).map(white).collect();
    let [mut along_x, mut along_both] = [(); 2].map(|()| vec![0.0; side * side]);
    multiply_parallel(side, side, side, &field, &circulant, &mut along_x);
    multiply_parallel(side, side, side, &circulant, &along_x, &mut along_both);
    along_both.into_iter().map(f64::from).collect()
}

/// The part of the variance of noise that a Gaussian footprint leaves within it, without samples: from the spectrum
/// for Gabor and normal noise, from the octaves' kernels for gradient noise. `deviations` are those of the footprint
/// along its two axes, as parts of the tile's side. For gradient noise the axes count as those of the lattice.
pub fn residual_variance(noise: &NoiseDriver, deviations: [f64; 2]) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for octave in 0..noise.octaves {
        let power = 0.25_f64.powi(octave as i32);
        let cells = f64::from(noise.cells << octave);
        sum += power * kept_power(noise.basis, deviations.map(|deviation| deviation * cells));
        total += power;
    }
    (1.0 - sum / total).clamp(0.0, 1.0)
}

/// The power of one octave after a Gaussian filter of these deviations [cells].
fn kept_power(basis: NoiseBasis, [u, v]: [f64; 2]) -> f64 {
    match basis {
        // The spectrum is a normal density of variance 1/(2π²L²); a filter multiplies it by exp(-4π²σ²k²).
        NoiseBasis::Gaussian => 1.0 / ((1.0 + 4.0 * u * u) * (1.0 + 4.0 * v * v)).sqrt(),
        NoiseBasis::Gabor => {
            const ANGLES: usize = 48;
            let variance = BANDWIDTH * BANDWIDTH / (4.0 * PI);
            let axis = |width: f64, k: f64| {
                let m = 4.0 * PI * PI * width * width;
                let widened = 1.0 + 2.0 * variance * m;
                (-k * k * m / widened).exp() / widened.sqrt()
            };
            let at = |k: usize| {
                let (sine, cosine) = (PI * (k as f64 + 0.5) / ANGLES as f64).sin_cos();
                axis(u, FREQUENCY * cosine) * axis(v, FREQUENCY * sine)
            };
            (0..ANGLES).map(at).sum::<f64>() / ANGLES as f64
        }
        NoiseBasis::Perlin => {
            // A sum of kernels d_x b(d_x) b(d_y) and d_y b(d_x) b(d_y) with independent factors.
            let energy = |width: f64, odd: bool| filtered_energy(width, odd);
            let zero = energy(0.0, true) * energy(0.0, false);
            0.5 * (energy(u, true) * energy(v, false) + energy(v, true) * energy(u, false)) / zero
        }
    }
}

/// The energy ∫ (k ∗ g)² of a kernel of gradient noise along one axis, `b(t)` or `t b(t)`, after a Gaussian of this
/// deviation [cells]: ∫∫ k(s) k(t) exp(-(s-t)²/4σ²)/√(4πσ²).
fn filtered_energy(deviation: f64, odd: bool) -> f64 {
    const STEPS: usize = 200;
    let kernel = |t: f64| {
        let a = t.abs();
        let weight = 1.0 - a * a * a * (a * (6.0 * a - 15.0) + 10.0);
        if odd { t * weight } else { weight }
    };
    let step = 2.0 / STEPS as f64;
    let at = |k: usize| -1.0 + step * (k as f64 + 0.5);
    let values: Vec<f64> = (0..STEPS).map(|k| kernel(at(k))).collect();
    if deviation < step {
        // The filter is narrower than the step: the energy of the kernel itself.
        return values.iter().map(|value| value * value).sum::<f64>() * step;
    }
    let lag = |d: usize| {
        let x = d as f64 * step / deviation;
        let weight = (-0.25 * x * x).exp() / (4.0 * PI).sqrt() / deviation;
        let product: f64 = values.iter().zip(&values[d..]).map(|(a, b)| a * b).sum();
        product * weight * if d == 0 { 1.0 } else { 2.0 }
    };
    (0..STEPS).map(lag).sum::<f64>() * step * step
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(basis: NoiseBasis, cells: u32, octaves: u32) -> NoiseDriver {
        NoiseDriver { basis, cells, octaves, seed: 3 }
    }

    #[test]
    fn noise_repeats_with_the_tile_and_depends_on_its_seed() {
        for basis in NoiseBasis::ALL {
            let (side, values) = rasterize(&noise(*basis, 8, 2));
            let step = |a: usize, b: usize| f64::from((values[a] - values[b]).abs());
            let inside: f64 = (0..side).map(|y| step(y * side + 20, y * side + 21)).sum();
            let across: f64 = (0..side).map(|y| step(y * side + side - 1, y * side)).sum();
            assert!(across < 3.0 * inside, "{basis:?}: {across} {inside}");
            assert_eq!(values, rasterize(&noise(*basis, 8, 2)).1);
            assert_ne!(values, rasterize(&NoiseDriver { seed: 4, ..noise(*basis, 8, 2) }).1);
        }
    }

    #[test]
    fn gabor_noise_is_the_sum_of_its_kernels() {
        let (side, cells) = (64, 3);
        let random = || ChaCha8Rng::seed_from_u64(7);
        let (values, impulses) = (gabor(side, cells, random()), impulses(cells, random()));
        for (index, value) in values.iter().enumerate().step_by(97) {
            let p = (DVec2::new((index % side) as f64, (index / side) as f64) + 0.5) * (cells as f64 / side as f64);
            let mut sum = 0.0;
            for (number, Impulse { at, wave, phase, sign }) in impulses.iter().enumerate() {
                let cell = DVec2::new((number / IMPULSES % cells) as f64, (number / IMPULSES / cells) as f64);
                // All copies of the impulse that are within two cells of the sample's.
                for copy in 0..25 {
                    let tiles = DVec2::new(f64::from(copy % 5 - 2), f64::from(copy / 5 - 2));
                    let corner = cell + tiles * cells as f64;
                    if (corner - p.floor()).abs().max_element() <= 2.0 {
                        let d = p - corner - *at;
                        let envelope = (-PI * BANDWIDTH * BANDWIDTH * d.length_squared()).exp();
                        sum += sign * envelope * (wave.dot(d) + phase).cos();
                    }
                }
            }
            assert!((value - sum).abs() < 1e-4, "{index}: {value} {sum}");
        }
    }

    #[test]
    fn normal_noise_has_the_autocorrelation_of_its_definition() {
        let (side, cells) = (256, 16);
        let values = gaussian(side, cells, ChaCha8Rng::seed_from_u64(5));
        let lag = |columns: usize| -> f64 {
            (0..side * side).map(|k| values[k] * values[k / side * side + (k + columns) % side]).sum()
        };
        for columns in [4, 8, 16, 24] {
            let expected = (-(columns as f64 * cells as f64 / side as f64).powi(2)).exp();
            // 16² cells: the standard error of a correlation is about 1/16.
            assert!((lag(columns) / lag(0) - expected).abs() < 0.12, "{columns}: {} {expected}", lag(columns) / lag(0));
        }
    }

    #[test]
    fn the_variance_that_a_footprint_leaves_agrees_with_that_of_the_samples() {
        for (basis, octaves) in
            [(NoiseBasis::Gaussian, 1), (NoiseBasis::Gabor, 1), (NoiseBasis::Perlin, 1), (NoiseBasis::Perlin, 3)]
        {
            let driver = noise(basis, 16, octaves);
            let (side, values) = rasterize(&driver);
            let total = values.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / values.len() as f64;
            for width in [0.3, 0.8] {
                // A Gaussian filter along both axes, by direct convolution.
                let deviation = width / 16.0 * side as f64;
                let reach = (4.0 * deviation).ceil() as i64;
                let kernel: Vec<f64> =
                    (-reach..=reach).map(|k| (-0.5 * (k as f64 / deviation).powi(2)).exp()).collect();
                let sum: f64 = kernel.iter().sum();
                let mut field: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
                for _ in 0..2 {
                    let at = |index: usize| {
                        let (row, column) = (index % side, index / side);
                        let tap = |(k, w): (usize, &f64)| {
                            w * field[row * side + (column as i64 + k as i64 - reach).rem_euclid(side as i64) as usize]
                        };
                        kernel.iter().enumerate().map(tap).sum::<f64>() / sum
                    };
                    field = (0..side * side).map(at).collect();
                }
                let kept = field.iter().map(|v| v * v).sum::<f64>() / field.len() as f64;
                let ours = residual_variance(&driver, [width / 16.0; 2]);
                let measured = 1.0 - kept / total;
                assert!((ours - measured).abs() < 0.04, "{basis:?} {octaves} {width}: {ours} {measured}");
            }
        }
    }
}
