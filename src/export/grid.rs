//! The grid of an exported table: its pairs of directions and their order.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::Vec3;

use crate::base::{InputError, Result};
use crate::math::directions::{from_angles, to_angles};

/// Numbers of polar angles and azimuths of the light and of the viewer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ExportResolution {
    pub theta_i: usize,
    pub phi_i: usize,
    pub theta_o: usize,
    pub phi_o: usize,
}

impl Default for ExportResolution {
    /// 16 x 64 directions each: a million pairs, 12 MB per quantity, 5.6° between neighbours.
    fn default() -> Self {
        Self { theta_i: 16, phi_i: 64, theta_o: 16, phi_o: 64 }
    }
}

/// Bounds the pairs of a table (0.8 GB); more are refused before memory is allocated. It also keeps an `.npz` below the
/// 4 GiB of ZIP.
const MAX_PAIRS: usize = 1 << 25;
/// Bounds the samples of an axis.
const MAX_AXIS: usize = 1024;

impl ExportResolution {
    /// Checks the size of a table.
    ///
    /// # Errors
    /// An axis or a number of pairs out of range.
    pub fn check(&self) -> Result<()> {
        let counts = [self.theta_i, self.phi_i, self.theta_o, self.phi_o];
        for (name, count) in ["theta_i", "phi_i", "theta_o", "phi_o"].iter().zip(counts) {
            if !(1..=MAX_AXIS).contains(&count) {
                return Err(
                    InputError::new(format!("resolution.{name}"), count, format!("1 to {MAX_AXIS} samples")).into()
                );
            }
        }
        // The product is at most 2^40 and cannot overflow.
        let pairs: u64 = counts.iter().map(|&count| count as u64).product();
        if pairs > MAX_PAIRS as u64 {
            let found = format!("{} x {} x {} x {} = {pairs} pairs", counts[0], counts[1], counts[2], counts[3]);
            return Err(InputError::new("resolution", found, format!("at most {MAX_PAIRS} pairs")).into());
        }
        Ok(())
    }

    /// Returns the grid of a checked size.
    pub(super) fn grid(&self) -> ExportGrid {
        ExportGrid { light: Axes::new(self.theta_i, self.phi_i), view: Axes::new(self.theta_o, self.phi_o) }
    }
}

/// Polar angles at the middles of equal steps and azimuths from 0: `θ_a = (a+½)(π/2)/Nθ`, `φ_b = 2πb/Nφ`, in radians.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes {
    pub theta: Vec<f32>,
    pub phi: Vec<f32>,
}

impl Axes {
    fn new(rings: usize, azimuths: usize) -> Self {
        Self {
            theta: (0..rings).map(|a| ((a as f64 + 0.5) * FRAC_PI_2 / rings as f64) as f32).collect(),
            phi: (0..azimuths).map(|b| (b as f64 * TAU / azimuths as f64) as f32).collect(),
        }
    }

    /// Creates axes with the given polar angles (radians, increasing) and azimuths from 0.
    pub fn at(theta: Vec<f32>, azimuths: usize) -> Self {
        Self { theta, ..Self::new(1, azimuths) }
    }

    /// Returns the number of directions.
    pub fn len(&self) -> usize {
        self.theta.len() * self.phi.len()
    }

    /// Returns the unit vectors, azimuth fastest.
    pub fn directions(&self) -> Vec<Vec3> {
        self.theta.iter().flat_map(|&theta| self.phi.iter().map(move |&phi| from_angles(theta, phi))).collect()
    }

    /// Returns nodes and weights of the bilinear interpolation at a direction. It wraps around in azimuth, continues
    /// across the pole, and is constant beyond the last ring.
    pub fn taps(&self, direction: Vec3) -> [(usize, f32); 4] {
        let (theta, phi) = to_angles(direction);
        let rings = self.theta.len();
        let upper = self.theta.partition_point(|&ring| ring <= theta);
        let first = self.theta[0];
        let mut taps = [(0, 0.0); 4];
        // Inside the first ring, the lower neighbour is the opposite side of the same ring, across the pole.
        let (lower, fraction) = match upper {
            0 => (None, (theta + first) / (2.0 * first)),
            _ if upper == rings => (Some(rings - 1), 0.0),
            _ => (Some(upper - 1), (theta - self.theta[upper - 1]) / (self.theta[upper] - self.theta[upper - 1])),
        };
        let neighbours = [(lower, 1.0 - fraction), (Some(upper.min(rings - 1)), fraction)];
        for (k, (ring, weight)) in neighbours.into_iter().enumerate() {
            let (ring, rotation) = ring.map_or((0, std::f32::consts::PI), |ring| (ring, 0.0));
            let azimuths = self.phi.len();
            let along = (phi + rotation) / std::f32::consts::TAU * azimuths as f32;
            let base = along.floor();
            let blend = along - base;
            let tap = 2 * k;
            taps[tap] = (ring * azimuths + base as usize % azimuths, weight * (1.0 - blend));
            taps[tap + 1] = (ring * azimuths + (base as usize + 1) % azimuths, weight * blend);
        }
        taps
    }
}

/// Axes of light and view directions. Entry `(ti, pi, to, po)` of a table is at `((ti Nφ_i + pi) Nθ_o + to) Nφ_o + po`.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportGrid {
    pub light: Axes,
    pub view: Axes,
}

impl ExportGrid {
    /// Returns the number of pairs.
    pub fn pairs(&self) -> usize {
        self.light.len() * self.view.len()
    }

    /// Returns `[theta_i, phi_i, theta_o, phi_o]` of an entry.
    pub fn angles(&self, entry: usize) -> [f32; 4] {
        let [_, phis_i, thetas_o, phis_o] = self.shape();
        let (light, view) = (entry / (thetas_o * phis_o), entry % (thetas_o * phis_o));
        [
            self.light.theta[light / phis_i],
            self.light.phi[light % phis_i],
            self.view.theta[view / phis_o],
            self.view.phi[view % phis_o],
        ]
    }

    /// Returns `[Nθ_i, Nφ_i, Nθ_o, Nφ_o]`.
    pub fn shape(&self) -> [usize; 4] {
        [self.light.theta.len(), self.light.phi.len(), self.view.theta.len(), self.view.phi.len()]
    }
}
