//! Direction pairs for measurements of accuracy.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::math::directions::from_angles;

/// A pair of unit directions in the small-scale frame.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Pair {
    /// Direction towards the light.
    pub i: Vec3,
    /// Direction towards the viewer.
    pub o: Vec3,
}

/// Creates `count` pairs that are distributed as in images. Views have the density of projected area (the cosine of the
/// polar angle). Lights are uniform in solid angle, and every second one is near the mirror direction of its view.
pub fn image_pairs(count: usize, seed: u64) -> Vec<Pair> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut pairs = Vec::with_capacity(count);
    while pairs.len() < count {
        let [a, b, c, d]: [f32; 4] = std::array::from_fn(|_| rng.random());
        let o = from_angles(a.sqrt().asin(), TAU * b);
        let spread = Vec2::new(c - 0.5, d - 0.5) * 0.5;
        let i = match pairs.len() % 2 {
            0 => from_angles(c.acos(), TAU * d),
            _ => (Vec3::new(-o.x, -o.y, o.z) + spread.extend(0.0)).try_normalize().unwrap_or(Vec3::Z),
        };
        if i.z > 0.0 && o.z > 0.0 {
            pairs.push(Pair { i, o });
        }
    }
    pairs
}

/// Creates `count` pairs up to 85° from the normal, uniform in solid angle. Every second view is near the mirror
/// direction of its light.
pub fn mirror_biased_pairs(count: usize, seed: u64) -> Vec<Pair> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let min_cosine = 85.0_f32.to_radians().cos();
    let direction = |rng: &mut ChaCha8Rng| {
        let cosine: f32 = min_cosine + (1.0 - min_cosine) * rng.random::<f32>();
        from_angles(cosine.acos(), TAU * rng.random::<f32>())
    };
    let mut pairs = Vec::with_capacity(count);
    while pairs.len() < count {
        let i = direction(&mut rng);
        let mut o = direction(&mut rng);
        if pairs.len() % 2 == 1 {
            let spread = Vec2::new(rng.random::<f32>() - 0.5, rng.random::<f32>() - 0.5) * 0.5;
            o = (Vec3::new(-i.x, -i.y, i.z) + spread.extend(0.0)).try_normalize().unwrap_or(Vec3::Z);
            if o.z < min_cosine {
                continue;
            }
        }
        pairs.push(Pair { i, o });
    }
    pairs
}
