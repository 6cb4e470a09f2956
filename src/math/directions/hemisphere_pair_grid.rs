//! A grid that contains exactly the direction pairs above the horizon: half and difference angles (Rusinkiewicz 1998)
//! whose difference angle ends where light or view reaches the horizon.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec3};

/// A grid over `(θ_h, φ_h, φ_d, θ_d)`; `d` is the light in the frame of `h` (z along `h`, x along increasing θ).
///
/// - θ_h has the coordinate `√(1 - cos θ_h)` in `[0, 1]`, which divides the hemisphere into equal areas.
/// - φ_d has period π, because swapping light and view changes nothing.
/// - θ_d ends at `θ_max`, `tan θ_max = 1 / (tan θ_h |cos φ_d|)`, where light or view reaches the horizon. Its
///   coordinate is `u = √((1 - cos θ_d) / (1 - cos θ_max))` in `[0, 1]`. So no node is below the horizon, no query is
///   interpolated across it, and values that are zero at the horizon are zero at a node.
///
/// The node index is `((ring · azimuths + azimuth) · phi_d + step of φ_d) · theta_d + step of θ_d`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct HemispherePairGrid {
    /// Rings of θ_h, both ends included.
    pub rings: usize,
    /// Azimuths φ_h over the full circle.
    pub azimuths: usize,
    /// Nodes of φ_d over half a turn; even, so that a node is at the kink of `θ_max` at a right angle.
    pub phi_d: usize,
    /// Nodes of θ_d, both ends included.
    pub theta_d: usize,
}

impl HemispherePairGrid {
    /// Constant `k` of `u = (1 + k) x - k x²` at even steps of `x`. Steps shrink towards the horizon, where shadows and
    /// cosines change fastest.
    pub const CROWDING: f32 = 0.75;

    /// Smallest sine of the elevation of a node's directions.
    pub const MIN_SINE: f32 = 2e-3;

    pub fn nodes(&self) -> usize {
        self.half_vectors() * self.phi_d * self.theta_d
    }

    /// Number of half vectors; the nodes of each are contiguous.
    pub fn half_vectors(&self) -> usize {
        self.rings * self.azimuths
    }

    /// The lowest azimuth φ_h that an azimuth is mirrored to by the planes x = const and y = const (`mirrors`), and
    /// whether φ_d changes its sign.
    pub fn image(&self, azimuth: usize, [in_x, in_y]: [bool; 2]) -> (usize, bool) {
        let n = self.azimuths;
        // x becomes -x: φ becomes π - φ; y becomes -y: φ becomes -φ.
        let half = n.is_multiple_of(2).then_some(n / 2);
        let across_x = half.filter(|_| in_x).map(|half| ((half + n - azimuth) % n, true));
        let across_y = in_y.then_some(((n - azimuth) % n, true));
        let both = half.filter(|_| in_x && in_y).map(|half| ((azimuth + half) % n, false));
        let itself = (azimuth, false);
        [across_x, across_y, both]
            .into_iter()
            .flatten()
            .fold(itself, |best, image| if image.0 < best.0 { image } else { best })
    }

    /// Number of nodes that are not mirror images of others.
    pub fn originals(&self, mirrors: [bool; 2]) -> usize {
        let azimuths = (0..self.azimuths).filter(|&azimuth| self.image(azimuth, mirrors).0 == azimuth).count();
        self.nodes() / self.azimuths * azimuths
    }

    /// φ_h of an azimuth [rad].
    pub fn phi_h(&self, azimuth: usize) -> f32 {
        TAU * azimuth as f32 / self.azimuths as f32
    }

    /// φ_d of a step [rad].
    pub fn phi_d(&self, step: usize) -> f32 {
        PI * step as f32 / self.phi_d as f32
    }

    /// `(i, o)` of a node.
    pub fn pair(&self, node: usize) -> (Vec3, Vec3) {
        let (step, rest) = (node % self.theta_d, node / self.theta_d);
        let (phi_d, rest) = (rest % self.phi_d, rest / self.phi_d);
        let (azimuth, ring) = (rest % self.azimuths, rest / self.azimuths);
        let s = ring as f32 / (self.rings - 1) as f32;
        let cos_theta_h = (1.0 - s * s).max(Self::MIN_SINE);
        let sin_theta_h = (1.0 - cos_theta_h * cos_theta_h).max(0.0).sqrt();
        let (sin_phi, cos_phi) = self.phi_h(azimuth).sin_cos();
        let frame = Mat3::from_cols(
            Vec3::new(cos_theta_h * cos_phi, cos_theta_h * sin_phi, -sin_theta_h),
            Vec3::new(-sin_phi, cos_phi, 0.0),
            Vec3::new(sin_theta_h * cos_phi, sin_theta_h * sin_phi, cos_theta_h),
        );
        let (sin_phi_d, cos_phi_d) = self.phi_d(phi_d).sin_cos();
        let x = step as f32 / (self.theta_d - 1) as f32;
        let u = x * (1.0 + Self::CROWDING - Self::CROWDING * x);
        // 1 - cos θ_max = m² / (r (r + n)), which does not cancel at small θ_max.
        let (n, m) = (sin_theta_h * cos_phi_d.abs(), cos_theta_h);
        let r = n.hypot(m);
        let versine = (u * u * m * m / (r * (r + n))).min(1.0 - Self::MIN_SINE);
        let sin_theta_d = (versine * (2.0 - versine)).sqrt();
        let across = Vec3::new(sin_theta_d * cos_phi_d, sin_theta_d * sin_phi_d, 0.0);
        let along = Vec3::Z * (1.0 - versine);
        let lifted = |d: Vec3| Vec3::new(d.x, d.y, d.z.max(Self::MIN_SINE)).normalize_or(Vec3::Z);
        (lifted(frame * (along + across)), lifted(frame * (along - across)))
    }

    /// Writes the coordinates of the pairs (light `k`, `o`) on the axes of the grid, in steps. All directions must be
    /// above the horizon.
    pub fn coordinates(&self, lights: [&[f32]; 3], o: Vec3, out: &mut GridCoordinates) {
        crate::math::simd::pair_grid_coordinates(lights, o, Self::CROWDING, &mut out.columns);
        let scales = [(self.rings - 1) as f32, self.azimuths as f32, self.phi_d as f32, (self.theta_d - 1) as f32];
        let n = lights[0].len().min(GridCoordinates::MAX);
        for (column, scale) in out.columns.iter_mut().zip(scales) {
            for at in &mut column[..n] {
                *at *= scale;
            }
        }
    }
}

/// Coordinates of pairs on the four axes of a grid, in steps, and their `i·h`.
#[derive(Debug, Clone)]
pub struct GridCoordinates {
    columns: [[f32; GridCoordinates::MAX]; 5],
}

impl Default for GridCoordinates {
    fn default() -> Self {
        Self { columns: [[0.0; Self::MAX]; 5] }
    }
}

impl GridCoordinates {
    /// Largest number of pairs at a time.
    pub const MAX: usize = crate::math::simd::LANES;

    /// θ_h, φ_h, φ_d, θ_d of pair `k`, in steps.
    pub fn at(&self, k: usize) -> [f32; 4] {
        std::array::from_fn(|axis| self.columns[axis][k])
    }

    /// θ_h, φ_h, φ_d, θ_d in steps, and `i·h`, of all pairs.
    pub fn columns(&self) -> &[[f32; Self::MAX]; 5] {
        &self.columns
    }

    pub fn i_dot_h(&self, k: usize) -> f32 {
        self.columns[4][k]
    }
}

#[cfg(test)]
#[path = "hemisphere_pair_grid_tests.rs"]
mod tests;
