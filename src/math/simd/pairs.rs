//! Many direction pairs at once: one view direction and many light directions.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::Vec3;

use super::{LANES, multiversion};

/// Pairs of up to [`LANES`] lights with one view, one array per component.
#[derive(Debug, Clone)]
pub struct LightPairs {
    pub o: Vec3,
    /// Directions to the lights, and unit half vectors.
    pub i: [[f32; LANES]; 3],
    pub h: [[f32; LANES]; 3],
    pub i_dot_h: [f32; LANES],
    /// Azimuths of the lights in turns, 0 to 1, and the cosines of their elevations.
    pub azimuths: [f32; LANES],
    pub cosines: [f32; LANES],
    /// Number of lights, rounded up to whole steps of the inner loops; lights beyond the last are at +z.
    padded: usize,
}

/// Lights per step of the inner loops.
const STEP: usize = 16;

impl LightPairs {
    pub const MAX: usize = LANES;

    pub fn new() -> Self {
        let empty = [0.0; LANES];
        let (three, o) = ([empty; 3], Vec3::Z);
        Self { o, i: three, h: three, i_dot_h: empty, azimuths: empty, cosines: empty, padded: 0 }
    }

    /// Sets up to [`LightPairs::MAX`] lights and the view, and computes half vectors and angles.
    pub fn set(&mut self, lights: &[Vec3], o: Vec3) {
        let lights = &lights[..lights.len().min(LANES)];
        self.o = o;
        self.padded = lights.len().next_multiple_of(STEP);
        for k in 0..self.padded {
            let light = lights.get(k).copied().unwrap_or(Vec3::Z);
            for axis in 0..3 {
                self.i[axis][k] = light[axis];
            }
        }
        pair_vectors(self);
    }

    pub fn light(&self, k: usize) -> Vec3 {
        Vec3::new(self.i[0][k], self.i[1][k], self.i[2][k])
    }

    pub(super) fn padded(&self) -> usize {
        self.padded.min(LANES)
    }
}

impl Default for LightPairs {
    fn default() -> Self {
        Self::new()
    }
}

multiversion! {
    /// Computes half vectors and angles of the lights.
    pub fn pair_vectors(pairs: &mut LightPairs) {
        let (n, o) = (pairs.padded(), pairs.o);
        for k in 0..n {
            let (x, y, z) = (pairs.i[0][k], pairs.i[1][k], pairs.i[2][k]);
            let (hx, hy, hz) = (x + o.x, y + o.y, z + o.z);
            let length = (hx * hx + hy * hy + hz * hz).sqrt();
            let opposite = length < 1e-20;
            let per_length = 1.0 / length.max(1e-20);
            let hx = if opposite { 0.0 } else { hx * per_length };
            let hy = if opposite { 0.0 } else { hy * per_length };
            let hz = if opposite { 1.0 } else { hz * per_length };
            pairs.h[0][k] = hx;
            pairs.h[1][k] = hy;
            pairs.h[2][k] = hz;
            pairs.i_dot_h[k] = 0.5 * ((x * hx + y * hy + z * hz) + (o.x * hx + o.y * hy + o.z * hz));
            let half = upper_angle(y.abs(), x);
            pairs.azimuths[k] = ((if y < 0.0 { TAU - half } else { half }) * (1.0 / TAU)).min(1.0);
            pairs.cosines[k] = (x * x + y * y).sqrt();
        }
    }
}

/// Azimuth in turns and cosine of the elevation of one direction, with the same bits as in [`LightPairs`].
#[inline(always)]
pub fn azimuth_and_cosine(d: Vec3) -> (f32, f32) {
    let half = upper_angle(d.y.abs(), d.x);
    let azimuth = ((if d.y < 0.0 { TAU - half } else { half }) * (1.0 / TAU)).min(1.0);
    (azimuth, (d.x * d.x + d.y * d.y).sqrt())
}

/// Azimuth in turns, as [`azimuth_and_cosine`], and polar angle in `[0, π]` of one direction.
#[inline(always)]
pub fn azimuth_and_polar_angle(d: Vec3) -> (f32, f32) {
    let (azimuth, sine) = azimuth_and_cosine(d);
    (azimuth, upper_angle(sine, d.z))
}

/// The angle of `(x, y)` in `[0, π]` for `y >= 0`, 0 at the origin. The absolute error is 1e-7 plus rounding
/// (Abramowitz and Stegun, 4.4.49).
#[inline(always)]
fn upper_angle(y: f32, x: f32) -> f32 {
    let (longer, shorter) = (y.max(x.abs()), y.min(x.abs()));
    let t = shorter / longer.max(1e-30);
    let s = t * t;
    let high = s * (-0.075_289_64 + s * (0.042_909_614 + s * (-0.016_165_737 + s * 0.002_866_225_7)));
    let low = t * (1.0 + s * (-0.333_331_45 + s * (0.199_935_51 + s * (-0.142_089 + s * (0.106_562_64 + high)))));
    let octant = if y > x.abs() { FRAC_PI_2 - low } else { low };
    if x < 0.0 { PI - octant } else { octant }
}

multiversion! {
    /// Coordinates of the pairs (light `k`, `o`) on
    /// [`HemispherePairGrid`](crate::math::directions::HemispherePairGrid), each in `[0, 1]`: `√(1 - cos θ_h)`, φ_h in
    /// turns, φ_d in half turns, and the coordinate of θ_d for the given crowding. The fifth column is `i·h`.
    pub fn pair_grid_coordinates(lights: [&[f32]; 3], o: Vec3, crowding: f32, out: &mut [[f32; LANES]; 5]) {
        let [x, y, z] = lights;
        let n = x.len().min(y.len()).min(z.len()).min(LANES);
        let (x, y, z) = (&x[..n], &y[..n], &z[..n]);
        let [ring, azimuth, phi_d, step, i_dot_h] = out;
        let (ring, azimuth, phi_d) = (&mut ring[..n], &mut azimuth[..n], &mut phi_d[..n]);
        let (step, i_dot_h) = (&mut step[..n], &mut i_dot_h[..n]);
        for k in 0..n {
            let (hx, hy, hz) = (x[k] + o.x, y[k] + o.y, z[k] + o.z);
            let across = (hx * hx + hy * hy).sqrt();
            let length = (across * across + hz * hz).sqrt().max(1e-20);
            let per_length = 1.0 / length;
            let (sine, cosine) = (across * per_length, (hz * per_length).max(1e-20));
            let pole = across < 1e-9 * length;
            let per_across = 1.0 / across.max(1e-30);
            let (ax, ay) = (if pole { 1.0 } else { hx * per_across }, if pole { 0.0 } else { hy * per_across });
            // The light in the frame of h.
            let dx = cosine * (ax * x[k] + ay * y[k]) - sine * z[k];
            let dy = ax * y[k] - ay * x[k];
            let dz = 0.5 * length;
            // u² = (1 - cos θ_d) / (1 - cos θ_max), with numerator and denominator divided by sin θ_d.
            let (n, m2) = (sine * dx.abs(), cosine * cosine * (dx * dx + dy * dy));
            let r = (n * n + m2).sqrt();
            let u = (r * (r + n) / ((1.0 + dz) * cosine * cosine)).min(1.0).sqrt();
            let c = 1.0 + crowding;
            let root = (c * c - 4.0 * crowding * u).max(0.0).sqrt();
            // (c - root) / 2k in a form that does not cancel.
            step[k] = (2.0 * u / (c + root)).min(1.0);
            ring[k] = (sine * sine / (1.0 + cosine)).min(1.0).sqrt();
            let half = upper_angle(ay.abs(), ax);
            azimuth[k] = ((if ay < 0.0 { TAU - half } else { half }) * (1.0 / TAU)).min(1.0);
            let sign = if dy < 0.0 { -1.0 } else { 1.0 };
            phi_d[k] = (upper_angle(dy * sign, dx * sign) * (1.0 / PI)).min(1.0);
            i_dot_h[k] = dz.min(1.0);
        }
    }
}
