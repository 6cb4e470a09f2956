//! A grid over half and difference angles (Rusinkiewicz 1998), in which lobes keep their position, for all half vectors
//! of the hemisphere.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Mat3, Vec3};

use super::{from_angles, half_vector, to_angles};

/// A grid over `(θ_h, φ_h, θ_d, φ_d)`; `d` is the light in the frame of `h` (z along `h`, x along increasing θ).
///
/// `φ_d` has period π, because swapping light and view changes nothing. Polar angles cover `0..=π/2`. The node index is
/// `((ring · azimuths + azimuth) · theta_d + step of θ_d) · phi_d + step of φ_d`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct HalfDifferenceGrid {
    /// Rings of θ_h, both ends included.
    pub rings: usize,
    /// Azimuths φ_h; even.
    pub azimuths: usize,
    /// Nodes of θ_d, both ends included.
    pub theta_d: usize,
    /// Nodes of φ_d over half a turn; even.
    pub phi_d: usize,
}

/// The frame of a half vector as columns x, y, z.
fn frame(theta_h: f32, phi_h: f32) -> Mat3 {
    let (sin_phi, cos_phi) = phi_h.sin_cos();
    let (sin_theta, cos_theta) = theta_h.sin_cos();
    Mat3::from_cols(
        Vec3::new(cos_theta * cos_phi, cos_theta * sin_phi, -sin_theta),
        Vec3::new(-sin_phi, cos_phi, 0.0),
        Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta),
    )
}

impl HalfDifferenceGrid {
    pub fn nodes(&self) -> usize {
        self.rings * self.azimuths * self.theta_d * self.phi_d
    }

    pub fn theta_h(&self, ring: usize) -> f32 {
        FRAC_PI_2 * ring as f32 / (self.rings - 1) as f32
    }

    pub fn phi_h(&self, azimuth: usize) -> f32 {
        TAU * azimuth as f32 / self.azimuths as f32
    }

    /// θ_d of a step [rad]. Steps shrink towards grazing, `θ_d = π/2 (1 - (1-x)²)`, because masking and the horizon cut
    /// a lobe off within a few degrees there: `tan θ_d` multiplies the slope of a normal.
    pub fn theta_d(&self, step: usize) -> f32 {
        let left = 1.0 - step as f32 / (self.theta_d - 1) as f32;
        FRAC_PI_2 * (1.0 - left * left)
    }

    /// `x` of [`HalfDifferenceGrid::theta_d`], in `[0, 1]`.
    fn coordinate_of_theta_d(theta_d: f32) -> f32 {
        1.0 - (1.0 - (theta_d / FRAC_PI_2).clamp(0.0, 1.0)).sqrt()
    }

    /// `sin θ_d cos θ_d dθ_d` of a step, up to a constant factor: the measure of its pairs.
    pub fn theta_d_measure(&self, step: usize) -> f32 {
        let theta_d = self.theta_d(step);
        let left = 1.0 - step as f32 / (self.theta_d - 1) as f32;
        theta_d.sin() * theta_d.cos().max(0.0) * left
    }

    pub fn phi_d(&self, step: usize) -> f32 {
        PI * step as f32 / self.phi_d as f32
    }

    /// `(i, o)` of half and difference angles; either may be below the horizon.
    pub fn pair(theta_h: f32, phi_h: f32, theta_d: f32, phi_d: f32) -> (Vec3, Vec3) {
        let frame = frame(theta_h, phi_h);
        let d = from_angles(theta_d, phi_d);
        (frame * d, frame * Vec3::new(-d.x, -d.y, d.z))
    }

    /// The sixteen linear taps of a pair: node indices and weights that sum to one.
    pub fn taps(&self, i: Vec3, o: Vec3) -> [(usize, f32); 16] {
        let h = half_vector(i, o);
        let (theta_h, phi_h) = to_angles(h);
        let local = frame(theta_h, phi_h).transpose() * i;
        let (theta_d, phi_d) = to_angles(local);
        let on = |value: f32, span: f32, count: usize| {
            let at = (value / span).clamp(0.0, 1.0) * (count - 1) as f32;
            let low = (at as usize).min(count - 2);
            ([low, low + 1], at - low as f32)
        };
        let around = |value: f32, span: f32, count: usize| {
            let at = (value / span).rem_euclid(1.0) * count as f32;
            let low = at as usize % count;
            ([low, (low + 1) % count], at - at.floor())
        };
        let (a, fa) = on(theta_h, FRAC_PI_2, self.rings);
        let (b, fb) = around(phi_h, TAU, self.azimuths);
        let (c, fc) = on(Self::coordinate_of_theta_d(theta_d), 1.0, self.theta_d);
        let (d, fd) = around(phi_d, PI, self.phi_d);
        std::array::from_fn(|k| {
            let [p, q, r, s] = [k >> 3 & 1, k >> 2 & 1, k >> 1 & 1, k & 1];
            let pick = |bit: usize, f: f32| if bit == 1 { f } else { 1.0 - f };
            let node = ((a[p] * self.azimuths + b[q]) * self.theta_d + c[r]) * self.phi_d + d[s];
            (node, pick(p, fa) * pick(q, fb) * pick(r, fc) * pick(s, fd))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: HalfDifferenceGrid = HalfDifferenceGrid { rings: 17, azimuths: 32, theta_d: 9, phi_d: 8 };

    #[test]
    fn taps_of_a_node_are_that_node() {
        for (a, b, c, d) in [(3, 5, 2, 1), (8, 31, 4, 7), (12, 0, 6, 3)] {
            let (i, o) = HalfDifferenceGrid::pair(GRID.theta_h(a), GRID.phi_h(b), GRID.theta_d(c), GRID.phi_d(d));
            let node = ((a * GRID.azimuths + b) * GRID.theta_d + c) * GRID.phi_d + d;
            let weight: f32 = GRID.taps(i, o).iter().filter(|tap| tap.0 == node).map(|tap| tap.1).sum();
            assert!(weight > 0.999, "{weight}");
        }
    }

    #[test]
    fn swapping_light_and_view_reads_the_same_nodes() {
        for k in 0..200 {
            let (i, o) =
                (from_angles(0.01 + k as f32 * 0.006, k as f32), from_angles(1.3 - k as f32 * 0.006, 2.0 * k as f32));
            let field = |node: usize| (node % 97) as f32;
            let read = |i, o| GRID.taps(i, o).iter().map(|&(node, w)| field(node) * w).sum::<f32>();
            assert!((read(i, o) - read(o, i)).abs() < 0.2, "{k}: {} {}", read(i, o), read(o, i));
        }
    }
}
