//! The basis of rotated lobes: matrix M factored through a DFT over azimuths (Wu et al. 2011, Sec. 3.5).
//!
//! The rows of M are the nodes of a [`HalfDifferenceGrid`], its columns all normals. A common rotation of directions
//! and normal changes nothing, so a DFT over `φ_h - φ_n` gives one small block per frequency, and the singular vectors
//! of all blocks are those of M. The mirror symmetry of isotropic BRDFs makes every Gram matrix real. The right
//! singular functions are `v(θ_n) e^{-imφ_n}`.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use rayon::prelude::*;

use super::gram::{eigen, rank_for};
use crate::base::Result;
use crate::brdf::{LobeAngles, Measured};
use crate::effective::Interpolation;
use crate::math::directions::{HalfDifferenceGrid, from_angles, half_vector};
use crate::math::linalg::gemm;
use crate::math::simd;
use crate::math::simd::{Lobe, PairVectors};

/// The scalar function of direction pair and normal that a basis represents, cosines included.
#[derive(Debug, Clone, Copy)]
pub enum RotatedLobe<'a> {
    Analytic(Lobe),
    /// A measured BRDF projected onto a colour direction.
    Measured {
        table: &'a dyn Measured,
        along: Vec3,
    },
}

impl RotatedLobe<'_> {
    /// Writes `f(n, i, o)` for each normal.
    fn values(&self, i: Vec3, o: Vec3, normals: [&[f32]; 3], out: &mut [f32]) {
        match *self {
            Self::Analytic(lobe) => simd::lobe_values(lobe, &PairVectors::new(i, o), normals, out),
            Self::Measured { table, along } => {
                let h = half_vector(i, o);
                for (k, out) in out.iter_mut().enumerate() {
                    let angles = LobeAngles::new(Vec3::new(normals[0][k], normals[1][k], normals[2][k]), i, o, h);
                    *out = if angles.n_dot_i > 0.0 && angles.n_dot_o > 0.0 {
                        table.f_r(&angles).dot(along) * angles.n_dot_i * angles.n_dot_o
                    } else {
                        0.0
                    };
                }
            }
        }
    }
}

/// Resolution of a basis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BasisGrid {
    pub pairs: HalfDifferenceGrid,
    /// Rings of normals over `0..=max_theta_n`.
    pub normal_rings: usize,
    /// True if normals cover the whole sphere, as overhangs require; false if they cover the upper half.
    pub whole_sphere: bool,
    /// Interpolation between rings of normals.
    pub interpolation: Interpolation,
}

impl BasisGrid {
    fn max_theta_n(&self) -> f32 {
        if self.whole_sphere { PI } else { 0.5 * PI }
    }

    fn theta_n(&self, ring: usize) -> f32 {
        (ring as f32 + 0.5) * self.max_theta_n() / self.normal_rings as f32
    }

    /// Number of φ_d steps that mirror symmetry leaves: `0..=phi_d/2`.
    fn stored_phi_d(&self) -> usize {
        self.pairs.phi_d / 2 + 1
    }

    fn frequencies(&self) -> usize {
        self.pairs.azimuths / 2 + 1
    }

    /// Number of rows of one block: `(θ_h, θ_d, half of φ_d)`.
    fn block_rows(&self) -> usize {
        self.pairs.rings * self.pairs.theta_d * self.stored_phi_d()
    }

    /// Number of columns of M as a matrix over all normals.
    pub fn columns(&self) -> usize {
        self.normal_rings * self.pairs.azimuths
    }
}

/// One singular triple of a block, which has a fixed frequency `m`.
#[derive(Debug, Clone)]
struct Mode {
    frequency: usize,
    sigma: f32,
    /// `v(θ_n)` on the rings of normals, divided by its column weight.
    right: Vec<f32>,
    /// Real and imaginary parts of `B v` over the block's rows, divided by row weights.
    left: [Vec<f32>; 2],
}

/// M's leading singular functions.
#[derive(Debug, Clone)]
pub struct RotatedBasis {
    pub grid: BasisGrid,
    modes: Vec<Mode>,
    /// Rank as a real matrix: one for each function of frequency 0 or of the highest frequency, two for each of the
    /// others.
    pub rank: usize,
    /// Fraction of the energy, the squared Frobenius norm, that is kept.
    pub kept_energy: f64,
    /// Energy and multiplicity of every function, in descending order of energy.
    spectrum: Vec<(f64, usize)>,
}

impl RotatedBasis {
    /// Tabulates and factors M, keeping the fraction `kept` of its energy.
    ///
    /// # Errors
    /// A factorization that does not converge, or values that are not finite.
    pub fn new(lobe: RotatedLobe<'_>, grid: BasisGrid, kept: f64) -> Result<Self> {
        let blocks = transformed(lobe, grid);
        let factored: Vec<Vec<(f64, Mode)>> =
            (0..grid.frequencies()).into_par_iter().map(|m| factor_block(&blocks, grid, m)).collect::<Result<_>>()?;
        let mut modes: Vec<(f64, Mode)> = factored.into_iter().flatten().collect();
        modes.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.frequency.cmp(&b.1.frequency)));
        let energies: Vec<f64> = modes.iter().map(|mode| mode.0).collect();
        let count = rank_for(&energies, kept);
        let total: f64 = energies.iter().sum();
        let kept_energy =
            if total > 0.0 { energies[..count.min(energies.len())].iter().sum::<f64>() / total } else { 1.0 };
        let spectrum = modes.iter().map(|(energy, mode)| (*energy, mode.multiplicity(grid))).collect();
        modes.truncate(count);
        let modes: Vec<Mode> = modes.into_iter().map(|mode| mode.1).collect();
        let rank = modes.iter().map(|mode| mode.multiplicity(grid)).sum();
        Ok(Self { grid, modes, rank, kept_energy, spectrum })
    }

    /// The rank, as a real matrix, that another fraction of the energy requires.
    pub fn rank_at(&self, kept: f64) -> usize {
        let energies: Vec<f64> = self.spectrum.iter().map(|entry| entry.0).collect();
        self.spectrum.iter().take(rank_for(&energies, kept)).map(|entry| entry.1).sum()
    }

    /// Number of real features per normal.
    pub fn features(&self) -> usize {
        2 * self.modes.len()
    }

    /// Size of the factors in bytes, as the paper counts it: `rank` columns over pairs and normals in f32.
    pub fn bytes(&self) -> usize {
        4 * self.rank * (self.grid.pairs.nodes() + self.grid.columns())
    }

    /// Writes the features `σ v(θ_n) cos mφ_n, σ v(θ_n) sin mφ_n` of a normal.
    pub fn write_features(&self, normal: Vec3, out: &mut [f32]) {
        let (theta, phi) = crate::math::directions::to_angles(normal);
        let rings = self.grid.normal_rings as i64;
        let at = theta / self.grid.max_theta_n() * rings as f32 - 0.5;
        let base = at.floor();
        let weights = self.grid.interpolation.weights(at - base);
        // A ring beyond the pole is the mirrored ring, rotated by half a turn, where e^{-imφ} changes sign for odd m.
        let taps: [(usize, bool); 4] = std::array::from_fn(|k| {
            let ring = base as i64 - 1 + k as i64;
            if ring < 0 {
                ((-1 - ring).min(rings - 1) as usize, true)
            } else if ring >= rings {
                let mirrored = if self.grid.whole_sphere { 2 * rings - 1 - ring } else { rings - 1 };
                (mirrored.max(0) as usize, self.grid.whole_sphere)
            } else {
                (ring as usize, false)
            }
        });
        for (mode, out) in self.modes.iter().zip(out.as_chunks_mut::<2>().0) {
            let odd = mode.frequency % 2 == 1;
            let v: f32 = taps
                .iter()
                .zip(weights)
                .map(
                    |(&(ring, crossed), weight)| {
                        if crossed && odd { -weight * mode.right[ring] } else { weight * mode.right[ring] }
                    },
                )
                .sum();
            let (sin, cos) = (mode.frequency as f32 * phi).sin_cos();
            *out = [mode.sigma * v * cos, mode.sigma * v * sin];
        }
    }

    /// `P[c](h, d) = Σ_f W[f, c] C_f(h, d)` for each column `c` of the row-major feature matrix `weights`
    /// (`features x columns`), on every node of the pair grid, `c` contiguous (the inner sum of Eq. 12).
    pub fn left_table(&self, weights: &[f32], columns: usize) -> Vec<f32> {
        let grid = self.grid;
        let (rows, frequencies, azimuths) = (grid.block_rows(), grid.frequencies(), grid.pairs.azimuths);
        // Inverse DFT as a matrix: P(φ_h) = Σ_m Re A_m cos mφ_h - Im A_m sin mφ_h.
        let inverse: Vec<f32> = (0..azimuths)
            .flat_map(|b| {
                (0..frequencies).flat_map(move |m| {
                    let (sin, cos) = (TAU * (m * b % azimuths) as f32 / azimuths as f32).sin_cos();
                    [cos, -sin]
                })
            })
            .collect();
        let stored_phi_d = grid.stored_phi_d();
        let mut table = vec![0.0_f32; grid.pairs.nodes() * columns];
        let per_ring = azimuths * grid.pairs.theta_d * grid.pairs.phi_d * columns;
        table.par_chunks_mut(per_ring).enumerate().for_each(|(ring, table)| {
            let mut spectrum = vec![0.0_f32; 2 * frequencies * columns];
            let mut rotated = vec![0.0_f32; azimuths * columns];
            for theta_d in 0..grid.pairs.theta_d {
                for phi_d in 0..grid.pairs.phi_d {
                    // The spectrum of the other half of φ_d is the complex conjugate.
                    let (stored, sign) =
                        if phi_d < stored_phi_d { (phi_d, 1.0) } else { (grid.pairs.phi_d - phi_d, -1.0) };
                    let row = (ring * grid.pairs.theta_d + theta_d) * stored_phi_d + stored;
                    debug_assert!(row < rows);
                    spectrum.fill(0.0);
                    for (k, mode) in self.modes.iter().enumerate() {
                        let scale = mode.kappa(grid) / mode.sigma;
                        let (re, im) = (mode.left[0][row] * scale, mode.left[1][row] * scale * sign);
                        let (w_cos, w_sin) = (
                            &weights[2 * k * columns..(2 * k + 1) * columns],
                            &weights[(2 * k + 1) * columns..(2 * k + 2) * columns],
                        );
                        let (out_re, out_im) = spectrum
                            [2 * mode.frequency * columns..(2 * mode.frequency + 2) * columns]
                            .split_at_mut(columns);
                        for c in 0..columns {
                            out_re[c] += re * w_cos[c] + im * w_sin[c];
                            out_im[c] += im * w_cos[c] - re * w_sin[c];
                        }
                    }
                    gemm::multiply(azimuths, 2 * frequencies, columns, &inverse, &spectrum, &mut rotated);
                    for azimuth in 0..azimuths {
                        let node = (azimuth * grid.pairs.theta_d + theta_d) * grid.pairs.phi_d + phi_d;
                        table[node * columns..(node + 1) * columns]
                            .copy_from_slice(&rotated[azimuth * columns..(azimuth + 1) * columns]);
                    }
                }
            }
        });
        table
    }
}

impl Mode {
    fn multiplicity(&self, grid: BasisGrid) -> usize {
        if self.frequency == 0 || 2 * self.frequency == grid.pairs.azimuths { 1 } else { 2 }
    }

    /// Weight of a frequency in the real series: 2 if it includes `-m`.
    fn kappa(&self, grid: BasisGrid) -> f32 {
        self.multiplicity(grid) as f32
    }
}

/// Blocks of all frequencies: `[2m + part][row * normal_rings + ring]`, without weights.
fn transformed(lobe: RotatedLobe<'_>, grid: BasisGrid) -> Vec<f32> {
    let (azimuths, rows, rings) = (grid.pairs.azimuths, grid.block_rows(), grid.normal_rings);
    let normals: Vec<Vec3> = (0..rings).map(|c| from_angles(grid.theta_n(c), 0.0)).collect();
    let component = |pick: fn(&Vec3) -> f32| -> Vec<f32> { normals.iter().map(pick).collect() };
    let (x, y, z) = (component(|n| n.x), component(|n| n.y), component(|n| n.z));
    let forward: Vec<f32> = (0..2 * grid.frequencies())
        .flat_map(|k| {
            (0..azimuths).map(move |b| {
                let (sin, cos) = (TAU * ((k / 2) * b % azimuths) as f32 / azimuths as f32).sin_cos();
                (if k % 2 == 0 { cos } else { -sin }) / azimuths as f32
            })
        })
        .collect();
    let stored_phi_d = grid.stored_phi_d();
    let parts = 2 * grid.frequencies();
    // Each row of (θ_h, θ_d, φ_d) is tabulated over φ_h and transformed.
    let spectra: Vec<Vec<f32>> = (0..rows)
        .into_par_iter()
        .map(|row| {
            let (ring, theta_d, phi_d) = (
                row / (grid.pairs.theta_d * stored_phi_d),
                row / stored_phi_d % grid.pairs.theta_d,
                row % stored_phi_d,
            );
            let mut values = vec![0.0_f32; azimuths * rings];
            for (b, values) in values.chunks_mut(rings).enumerate() {
                let (i, o) = HalfDifferenceGrid::pair(
                    grid.pairs.theta_h(ring),
                    grid.pairs.phi_h(b),
                    grid.pairs.theta_d(theta_d),
                    grid.pairs.phi_d(phi_d),
                );
                lobe.values(i, o, [&x, &y, &z], values);
            }
            let mut spectrum = vec![0.0_f32; parts * rings];
            gemm::multiply(parts, azimuths, rings, &forward, &values, &mut spectrum);
            spectrum
        })
        .collect();
    let mut blocks = vec![0.0_f32; parts * rows * rings];
    blocks.par_chunks_mut(rows * rings).enumerate().for_each(|(part, block)| {
        for (row, spectrum) in spectra.iter().enumerate() {
            block[row * rings..(row + 1) * rings].copy_from_slice(&spectrum[part * rings..(part + 1) * rings]);
        }
    });
    blocks
}

/// The singular triples of one frequency's block, with their energies in M.
fn factor_block(blocks: &[f32], grid: BasisGrid, frequency: usize) -> Result<Vec<(f64, Mode)>> {
    let (rows, rings) = (grid.block_rows(), grid.normal_rings);
    let part = |k: usize| &blocks[(2 * frequency + k) * rows * rings..(2 * frequency + k + 1) * rows * rings];
    let (real, imaginary) = (part(0), part(1));
    let stored_phi_d = grid.stored_phi_d();
    // √ of the measure: sinθ_h (sinθ_d cosθ_d dθ_d) for pairs, sinθ_n for normals.
    let row_weight: Vec<f32> = (0..rows)
        .map(|row| {
            let (ring, theta_d, phi_d) = (
                row / (grid.pairs.theta_d * stored_phi_d),
                row / stored_phi_d % grid.pairs.theta_d,
                row % stored_phi_d,
            );
            let folded = if phi_d == 0 || phi_d + 1 == stored_phi_d { 1.0 } else { 2.0 };
            (grid.pairs.theta_h(ring).sin() * grid.pairs.theta_d_measure(theta_d) * folded).sqrt()
        })
        .collect();
    let ring_weight: Vec<f32> = (0..rings).map(|ring| grid.theta_n(ring).sin().sqrt()).collect();
    let weighted = |block: &[f32]| -> Vec<f32> {
        block
            .chunks(rings)
            .zip(&row_weight)
            .flat_map(|(row, &w)| row.iter().zip(&ring_weight).map(move |(&x, &c)| x * w * c))
            .collect()
    };
    let gram = gemm::gram(rows, rings, &weighted(real)) + gemm::gram(rows, rings, &weighted(imaginary));
    let solved = eigen(gram)?;
    let largest = solved.values.first().copied().unwrap_or(0.0);
    let multiplicity = if frequency == 0 || 2 * frequency == grid.pairs.azimuths { 1.0 } else { 2.0 };
    // Smaller eigenvalues of a Gram matrix of f32 entries are rounding errors.
    let count = solved.values.iter().take_while(|&&value| value > largest * 1e-9 && value > 0.0).count();
    // B v for all v at once.
    let mixing: Vec<f32> = (0..rings)
        .flat_map(|ring| {
            (0..count).map({
                let solved = &solved;
                let w = ring_weight[ring];
                move |k| solved.vectors[(ring, k)] as f32 * w
            })
        })
        .collect();
    let mut left = [vec![0.0_f32; rows * count], vec![0.0_f32; rows * count]];
    gemm::multiply(rows, rings, count, real, &mixing, &mut left[0]);
    gemm::multiply(rows, rings, count, imaginary, &mixing, &mut left[1]);
    Ok((0..count)
        .map(|k| {
            let mode = Mode {
                frequency,
                sigma: solved.values[k].sqrt() as f32,
                right: (0..rings).map(|ring| solved.vectors[(ring, k)] as f32 / ring_weight[ring]).collect(),
                left: left.each_ref().map(|part| part.iter().skip(k).step_by(count).copied().collect()),
            };
            (solved.values[k] * multiplicity, mode)
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::lobe_values;

    /// The basis rebuilds `f` at the grid's own nodes for a normal between its rings.
    #[test]
    fn features_times_left_functions_rebuild_the_rotated_brdf() {
        let grid = BasisGrid {
            pairs: HalfDifferenceGrid { rings: 20, azimuths: 64, theta_d: 8, phi_d: 6 },
            normal_rings: 48,
            whole_sphere: false,
            interpolation: Interpolation::Cubic,
        };
        for lobe in [Lobe::cook_torrance(0.3), Lobe::ward(0.4), Lobe::Lambertian] {
            let basis = RotatedBasis::new(RotatedLobe::Analytic(lobe), grid, 0.999_99).unwrap();
            for (theta, phi) in [(0.05, 0.3), (0.4, 2.0), (0.7, 5.1)] {
                let normal = from_angles(theta, phi);
                let mut features = vec![0.0; basis.features()];
                basis.write_features(normal, &mut features);
                let table = basis.left_table(&features, 1);
                let (mut error, mut norm) = (0.0_f64, 0.0_f64);
                for (node, &got) in table.iter().enumerate() {
                    let p = grid.pairs;
                    let (phi_d, rest) = (node % p.phi_d, node / p.phi_d);
                    let (theta_d, rest) = (rest % p.theta_d, rest / p.theta_d);
                    let (azimuth, ring) = (rest % p.azimuths, rest / p.azimuths);
                    let (i, o) =
                        HalfDifferenceGrid::pair(p.theta_h(ring), p.phi_h(azimuth), p.theta_d(theta_d), p.phi_d(phi_d));
                    let mut want = [0.0];
                    lobe_values(lobe, &PairVectors::new(i, o), [&[normal.x], &[normal.y], &[normal.z]], &mut want);
                    let weight = f64::from(p.theta_h(ring).sin() * p.theta_d(theta_d).sin() * p.theta_d(theta_d).cos());
                    error += weight * f64::from(got - want[0]).powi(2);
                    norm += weight * f64::from(want[0]).powi(2);
                }
                let relative = (error / norm).sqrt();
                assert!(relative < 0.02, "{lobe:?} at {theta}, {phi}: {relative}");
            }
        }
    }
}
