//! A face prepared for many paths: slopes drawn in advance, and its masking as a table.

use glam::{DVec2, Vec2, Vec3};
use rayon::prelude::*;

use crate::slab::Ndf;

/// Number of slopes.
pub(super) const SLOPES: usize = 1 << 14;
/// Steps of the table of masking along each axis.
const SIDE: usize = 64;
/// Steps of an evenly spread sequence in four dimensions: powers of 1 / 1.1673..., the root of `x⁵ = x + 1` (Roberts 2018).
const STEPS: [f64; 4] =
    [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_805_1, 0.538_597_257_223_612_3];

/// The slopes and the masking of a face.
#[derive(Debug, Clone)]
pub(super) struct FaceSamples {
    /// Slopes by base area; slope 0 is a level facet.
    slopes: Vec<Vec2>,
    /// `(1 + Λ) |w.z|` over stereographic coordinates of directions; empty for a smooth face. It is bounded and not 0.
    facing: Vec<f32>,
}

impl FaceSamples {
    /// `second` selects the last two dimensions of the sequence, so that the slopes of both faces are spread evenly together.
    pub fn new(face: &Ndf, second: bool) -> Self {
        let at = usize::from(second) * 2;
        let coordinate = |k: usize, step: f64| (0.5 + (k + 1) as f64 * step).fract();
        let slope = |k: usize| {
            let (slope, is_level) = face.facet(coordinate(k, STEPS[at]), coordinate(k, STEPS[at + 1]));
            if is_level { Vec2::ZERO } else { slope.as_vec2() }
        };
        let slopes = (0..SLOPES).into_par_iter().map(slope).collect();
        let facing = if face.is_smooth() { Vec::new() } else { facing_table(face) };
        Self { slopes, facing }
    }

    /// The slope of a number; numbers wrap.
    pub fn slope(&self, k: usize) -> Vec2 {
        self.slopes[k % SLOPES]
    }

    /// `(1 + Λ) |w.z|` of a direction, up or down: the area of the facets that face it, projected along it, per base area.
    pub fn facing(&self, w: Vec3) -> f32 {
        if self.facing.is_empty() {
            return w.z.abs().max(1e-9);
        }
        let at = w.truncate() / (w.z + 1f32.copysign(w.z));
        let at = (0.5 * (at + 1.0) * (SIDE - 1) as f32).clamp(Vec2::ZERO, Vec2::splat((SIDE - 1) as f32 - 1e-3));
        let (x, y) = (at.x as usize, at.y as usize);
        let (s, t) = (at.x - x as f32, at.y - y as f32);
        let row = |y: usize| {
            let k = y * SIDE + x;
            (1.0 - s) * self.facing[k] + s * self.facing[k + 1]
        };
        (1.0 - t) * row(y) + t * row(y + 1)
    }

    /// The part of the light along a direction that masking lets leave.
    pub fn seen(&self, w: Vec3) -> f32 {
        (w.z.abs() / self.facing(w)).min(1.0)
    }
}

fn facing_table(face: &Ndf) -> Vec<f32> {
    let value = |k: usize| {
        let at = DVec2::new((k % SIDE) as f64, (k / SIDE) as f64) * (2.0 / (SIDE - 1) as f64) - 1.0;
        // Nodes beyond the horizon have the values of the horizon.
        let at = at.clamp_length_max(1.0 - 1e-6);
        let square = at.length_squared();
        let w = (2.0 * at / (1.0 + square)).extend((1.0 - square) / (1.0 + square));
        ((1.0 + face.signed_lambda(w)) * w.z).max(1e-9) as f32
    };
    (0..SIDE * SIDE).into_par_iter().map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slab::Profile;

    #[test]
    fn the_table_of_masking_is_smiths() {
        for profile in [Profile::Beckmann, Profile::Ggx] {
            let face = Ndf::analytic(profile, DVec2::new(0.4, 0.15), 0.3);
            let samples = FaceSamples::new(&face, false);
            for (degrees, bound) in [(0.0, 1e-3), (30.0, 1e-3), (60.0, 2e-3), (80.0, 5e-3), (89.0_f64, 2e-2)] {
                for turn in 0..7 {
                    let (sin, cos) = degrees.to_radians().sin_cos();
                    let w = (sin * DVec2::from_angle(f64::from(turn))).extend(cos);
                    for w in [w, -w] {
                        let (table, exact) = (f64::from(samples.seen(w.as_vec3())), face.seen(w));
                        assert!((table - exact).abs() < bound, "{profile:?} {degrees} {turn}: {table} {exact}");
                    }
                }
            }
        }
    }
}
