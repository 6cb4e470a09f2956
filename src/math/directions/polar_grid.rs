//! Polar grids: rings of constant elevation with azimuths in each. Interpolation is bilinear, and crosses the pole.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::Vec3;

use super::{from_angles, to_angles};

/// One node of an interpolation: its index in the grid and its weight.
pub type Tap = (usize, f32);

/// A grid with `θ_a = (a+½)(π/2)/(rings)` for all rings but the last, which is at [`PolarGrid::HORIZON_DEG`], and with
/// `φ_b = 2πb/azimuths`.
///
/// The node index is `ring * azimuths + azimuth`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PolarGrid {
    /// Number of rings without the one at the horizon.
    pub rings: usize,
    /// Azimuths per ring; even, so that interpolation can cross the pole.
    pub azimuths: usize,
}

/// `1 / cos 89.9°`.
const INVERSE_HORIZON_COSINE: f32 = 572.9581;

impl PolarGrid {
    /// Polar angle of the last ring [degrees]. It is below 90° because a bidirectional quantity need not vanish at the
    /// horizon.
    pub const HORIZON_DEG: f32 = 89.9;

    pub fn new(rings: usize, azimuths: usize) -> Self {
        Self { rings: rings.max(2), azimuths: (azimuths.max(4) + 1) & !1 }
    }

    /// Rings including the one at the horizon.
    pub fn ring_count(&self) -> usize {
        self.rings + 1
    }

    /// Number of nodes.
    #[expect(clippy::len_without_is_empty, reason = "a grid has at least two rings")]
    pub fn len(&self) -> usize {
        self.ring_count() * self.azimuths
    }

    pub fn theta(&self, ring: usize) -> f32 {
        Self::theta_of(self.rings, ring)
    }

    /// The polar angle of a ring of any grid with so many `rings` and one at the horizon.
    pub(super) fn theta_of(rings: usize, ring: usize) -> f32 {
        if ring >= rings { Self::HORIZON_DEG.to_radians() } else { (ring as f32 + 0.5) * FRAC_PI_2 / rings as f32 }
    }

    pub fn phi(&self, azimuth: usize) -> f32 {
        TAU * azimuth as f32 / self.azimuths as f32
    }

    pub fn direction(&self, node: usize) -> Vec3 {
        from_angles(self.theta(node / self.azimuths), self.phi(node % self.azimuths))
    }

    pub fn directions(&self) -> Vec<Vec3> {
        (0..self.len()).map(|node| self.direction(node)).collect()
    }

    /// Factor that multiplies a bidirectional quantity read from the grid at a direction with this z. Between the last
    /// ring and the horizon it falls to zero with the cosine. Without it, a constant value divided by a projected area
    /// that goes to zero would grow without bound.
    pub fn horizon_taper(z: f32) -> f32 {
        (z * INVERSE_HORIZON_COSINE).min(1.0)
    }

    /// Solid angle [sr] that a node represents; 0 for nodes of the horizon ring.
    pub fn solid_angle(&self, node: usize) -> f32 {
        let ring = node / self.azimuths;
        if ring >= self.rings {
            return 0.0;
        }
        let step = FRAC_PI_2 / self.rings as f32;
        ((ring as f32 * step).cos() - ((ring + 1) as f32 * step).cos()) * TAU / self.azimuths as f32
    }

    /// The four bilinear taps of a direction; weights are in `[0,1]` and sum to one.
    pub fn taps(&self, direction: Vec3) -> [Tap; 4] {
        let (theta, phi) = to_angles(direction);
        let step = FRAC_PI_2 / self.rings as f32;
        let at = theta / step - 0.5;
        // Inside the first ring, interpolation crosses the pole: ring -1 is ring 0, rotated by half a turn.
        let (lower, upper, t) = if at < 0.0 {
            (None, 0, at + 1.0)
        } else {
            let ring = (at as usize).min(self.rings - 1);
            let (from, to) = (self.theta(ring), self.theta(ring + 1));
            (Some(ring), ring + 1, ((theta - from) / (to - from)).clamp(0.0, 1.0))
        };
        let on_ring = |phi: f32, weight: f32, ring: usize| {
            let at = phi.rem_euclid(TAU) / TAU * self.azimuths as f32;
            let b = at as usize;
            let f = at - b as f32;
            let row = ring * self.azimuths;
            [(row + b % self.azimuths, weight * (1.0 - f)), (row + (b + 1) % self.azimuths, weight * f)]
        };
        let first = match lower {
            Some(ring) => on_ring(phi, 1.0 - t, ring),
            None => on_ring(phi + PI, 1.0 - t, 0),
        };
        let second = on_ring(phi, t, upper);
        [first[0], first[1], second[0], second[1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_reproduce_a_constant_and_are_exact_at_the_nodes() {
        let grid = PolarGrid::new(8, 24);
        for node in 0..grid.len() {
            let taps = grid.taps(grid.direction(node));
            let weight: f32 = taps.iter().filter(|tap| tap.0 == node).map(|tap| tap.1).sum();
            assert!((weight - 1.0).abs() < 1e-3, "node {node}: {taps:?}");
        }
        for k in 0..500 {
            let theta = k as f32 / 500.0 * FRAC_PI_2;
            let taps = grid.taps(from_angles(theta, k as f32 * 0.7));
            assert!((taps.iter().map(|tap| tap.1).sum::<f32>() - 1.0).abs() < 1e-5);
            assert!(taps.iter().all(|tap| tap.1 >= 0.0 && tap.0 < grid.len()));
        }
    }

    #[test]
    fn the_taper_begins_at_the_last_ring() {
        let lowest = from_angles(PolarGrid::HORIZON_DEG.to_radians(), 0.3).z;
        assert!((PolarGrid::horizon_taper(lowest) - 1.0).abs() < 1e-4);
        assert_eq!((PolarGrid::horizon_taper(0.5), PolarGrid::horizon_taper(0.0)), (1.0, 0.0));
    }

    #[test]
    fn solid_angles_sum_to_the_hemisphere() {
        let grid = PolarGrid::new(16, 36);
        let sum: f32 = (0..grid.len()).map(|node| grid.solid_angle(node)).sum();
        assert!((sum - TAU).abs() < 1e-4);
    }

    #[test]
    fn interpolation_is_continuous_across_the_pole_and_the_seam() {
        let grid = PolarGrid::new(8, 24);
        let field: Vec<f32> = grid.directions().iter().map(|d| d.x + 2.0 * d.y + 0.3 * d.z).collect();
        let eval = |d: Vec3| grid.taps(d).iter().map(|tap| tap.1 * field[tap.0]).sum::<f32>();
        for k in 0..64 {
            let phi = k as f32 * 0.1;
            let (a, b) = (eval(from_angles(1e-4, phi)), eval(from_angles(1e-4, phi + PI)));
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
        for theta in [0.2, 0.9, 1.5] {
            assert!((eval(from_angles(theta, 1e-5)) - eval(from_angles(theta, -1e-5))).abs() < 1e-3);
        }
    }
}
