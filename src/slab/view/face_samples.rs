//! A face prepared for many paths: slopes drawn in advance, and its masking as a table.

use glam::{DVec2, Vec2, Vec3};
use rayon::prelude::*;

use crate::math::simd::{BECKMANN, GGX, LANES, Quadratic, RayLane, facing_lane, smith_lambda};
use crate::slab::ray_sums::symmetric;
use crate::slab::{Ndf, Profile};

/// Number of slopes.
pub(super) const SLOPES: usize = 1 << 14;
/// Steps of the table of masking along each axis.
const SIDE: usize = 64;
/// Square of slopes, `kᵀ S k`, below which Beckmann's Λ is less than 2e-6.
const UNMASKED: f32 = 0.1;
/// Steps of an evenly spread sequence in four dimensions: powers of 1 / 1.1673..., the root of `x⁵ = x + 1` (Roberts 2018).
const STEPS: [f64; 4] =
    [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_805_1, 0.538_597_257_223_612_3];

/// The slopes and the masking of a face.
#[derive(Debug, Clone)]
pub(super) struct FaceSamples {
    /// Slopes by base area; slope 0 is a level facet. The first lane is repeated at the end.
    slope_x: Vec<f32>,
    slope_y: Vec<f32>,
    masking: Masking,
}

/// `(1 + Λ) |w.z|` of directions, in a form that is fast to evaluate. It is bounded and not 0.
#[derive(Debug, Clone)]
enum Masking {
    Smooth,
    /// Analytic slopes: squared roughnesses xx, xy and yy, and the mass of the facets.
    Ellipse {
        profile: Profile,
        squares: Quadratic,
        mass: f32,
    },
    /// By stereographic coordinates of directions.
    Table(Vec<f32>),
}

impl FaceSamples {
    /// `second` selects the last two dimensions of the sequence, so that the slopes of both faces are spread evenly together.
    pub fn new(face: &Ndf, second: bool) -> Self {
        let at = usize::from(second) * 2;
        let coordinate = |k: usize, step: f64| (0.5 + (k + 1) as f64 * step).fract();
        let slope = |k: usize| {
            let k = k % SLOPES;
            let (slope, is_level) = face.facet(coordinate(k, STEPS[at]), coordinate(k, STEPS[at + 1]));
            if is_level { Vec2::ZERO } else { slope.as_vec2() }
        };
        let slopes: Vec<Vec2> = (0..SLOPES + LANES).into_par_iter().map(slope).collect();
        let masking = match face.only_ellipse() {
            _ if face.is_smooth() => Masking::Smooth,
            Some(ellipse) => {
                let squares = symmetric(ellipse.squares);
                Masking::Ellipse { profile: ellipse.profile, squares, mass: face.rough() as f32 }
            }
            None => Masking::Table(facing_table(face)),
        };
        let (slope_x, slope_y) = slopes.iter().map(|slope| (slope.x, slope.y)).unzip();
        Self { slope_x, slope_y, masking }
    }

    /// The slope of a number; numbers wrap.
    pub fn slope(&self, k: usize) -> Vec2 {
        Vec2::new(self.slope_x[k % SLOPES], self.slope_y[k % SLOPES])
    }

    /// The components of `count` slopes from a number on, at most a lane.
    pub fn slopes(&self, k: usize, count: usize) -> [&[f32]; 2] {
        let first = k % SLOPES;
        [&self.slope_x, &self.slope_y].map(|column| &column[first..first + count])
    }

    /// The components of a lane of slopes from a number on.
    pub fn lane(&self, k: usize) -> [&[f32; LANES]; 2] {
        let first = k % SLOPES;
        [&self.slope_x, &self.slope_y].map(|column| column[first..].first_chunk().unwrap_or(&[0.0; LANES]))
    }

    /// `(1 + Λ) |w.z|` of a direction, up or down: the area of the facets that face it, projected along it, per base area.
    pub fn facing(&self, w: Vec3) -> f32 {
        let z = w.z.abs().max(1e-9);
        match &self.masking {
            Masking::Smooth => z,
            Masking::Ellipse { profile, squares: [xx, xy, yy], mass } => {
                let square = (xx * w.x * w.x + 2.0 * xy * w.x * w.y + yy * w.y * w.y) / (z * z);
                let lambda = match profile {
                    Profile::Beckmann if square < UNMASKED => 0.0,
                    Profile::Beckmann => smith_lambda::<BECKMANN>(square),
                    Profile::Ggx => smith_lambda::<GGX>(square),
                };
                (1.0 + mass * lambda) * z
            }
            Masking::Table(table) => from_table(table, w),
        }
    }

    /// [`Self::facing`] of each ray of a lane.
    pub fn facing_of(&self, rays: &RayLane, areas: &mut [f32; LANES]) {
        match &self.masking {
            Masking::Ellipse { profile: Profile::Beckmann, squares, mass } => {
                facing_lane::<BECKMANN>(*squares, *mass, rays, areas);
            }
            Masking::Ellipse { profile: Profile::Ggx, squares, mass } => {
                facing_lane::<GGX>(*squares, *mass, rays, areas);
            }
            _ => {
                for (l, area) in areas.iter_mut().enumerate() {
                    *area = self.facing(Vec3::new(rays.x[l], rays.y[l], rays.z[l]));
                }
            }
        }
    }

    /// The part of the light along a direction that masking lets leave.
    pub fn seen(&self, w: Vec3) -> f32 {
        (w.z.abs() / self.facing(w)).min(1.0)
    }
}

/// A bilinear read of [`facing_table`].
fn from_table(table: &[f32], w: Vec3) -> f32 {
    let at = w.truncate() / (w.z + 1f32.copysign(w.z));
    let at = (0.5 * (at + 1.0) * (SIDE - 1) as f32).clamp(Vec2::ZERO, Vec2::splat((SIDE - 1) as f32 - 1e-3));
    let (x, y) = (at.x as usize, at.y as usize);
    let (s, t) = (at.x - x as f32, at.y - y as f32);
    let row = |y: usize| {
        let k = y * SIDE + x;
        (1.0 - s) * table[k] + s * table[k + 1]
    };
    (1.0 - t) * row(y) + t * row(y + 1)
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

    #[test]
    fn the_fast_masking_is_smiths() {
        let slopes: Vec<_> = (0..2000)
            .map(|k| (DVec2::new(0.4 * (f64::from(k) * 0.37).sin(), 0.2 * (f64::from(k) * 0.71).cos()), 1.0))
            .collect();
        let faces = [
            Ndf::analytic(Profile::Beckmann, DVec2::new(0.4, 0.15), 0.3),
            Ndf::analytic(Profile::Ggx, DVec2::new(0.4, 0.15), 0.3),
            Ndf::of_facets(&slopes, 64).unwrap(),
        ];
        for face in faces {
            let samples = FaceSamples::new(&face, false);
            for (degrees, bound) in [(0.0, 1e-3), (30.0, 1e-3), (60.0, 2e-3), (80.0, 5e-3), (89.0_f64, 2e-2)] {
                for turn in 0..7 {
                    let (sin, cos) = degrees.to_radians().sin_cos();
                    let w = (sin * DVec2::from_angle(f64::from(turn))).extend(cos);
                    for w in [w, -w] {
                        let (table, exact) = (f64::from(samples.seen(w.as_vec3())), face.seen(w));
                        assert!((table - exact).abs() < bound, "{} {degrees} {turn}: {table} {exact}", face.describe());
                    }
                }
            }
        }
    }
}
