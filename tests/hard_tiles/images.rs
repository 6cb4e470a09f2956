//! Images over hard tiles, and heights.

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::File;

/// Returns a square image of a background with one texel of each of the colours at random places.
pub fn texels(side: usize, background: Vec3, colors: &[Vec3], seed: u64) -> File {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut texels = vec![background; side * side];
    for &color in colors {
        let free = loop {
            let at = random.random_range(0..texels.len());
            if texels[at] == background {
                break at;
            }
        };
        texels[free] = color;
    }
    File::Colors(side, texels)
}

/// Returns a square image of slot 1 on discs at random places, and slot 0 elsewhere. The radius is in texels.
pub fn discs(side: usize, count: usize, radius: f64, seed: u64) -> File {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let size = side as f64;
    let centres: Vec<[f64; 2]> = (0..count).map(|_| [0; 2].map(|_| size * random.random::<f64>())).collect();
    let is_inside = |k: usize| {
        let at = [k % side, k / side].map(|texel| texel as f64 + 0.5);
        centres.iter().any(|centre| {
            let [x, y] = [0, 1].map(|axis: usize| at[axis] - centre[axis]).map(|d| d - (d / size).round() * size);
            x.hypot(y) < radius
        })
    };
    File::Slots((0..side * side).map(|k| u8::from(is_inside(k))).collect())
}

impl File {
    /// Returns the mean of a colour image, which is the mean of its bilinear interpolation, too.
    pub fn mean_color(&self) -> Vec3 {
        let Self::Colors(_, texels) = self else { panic!("found no colours") };
        (texels.iter().map(|texel| texel.as_dvec3()).sum::<glam::DVec3>() / texels.len() as f64).as_vec3()
    }

    /// Returns the share of the area that is painted with slot 1.
    pub fn painted_share(&self) -> f32 {
        let Self::Slots(texels) = self else { panic!("found no slots") };
        texels.iter().map(|&texel| f32::from(texel)).sum::<f32>() / texels.len() as f32
    }
}

/// Returns the geometry of a height field, as TOML, from its heights at (column, row).
fn height_field(side: usize, mut height: impl FnMut(usize, usize) -> f64) -> String {
    let mut row = |j| (0..side).map(|i| format!("{:.6}", height(i, j))).collect::<Vec<_>>().join(", ");
    let rows: Vec<String> = (0..side).map(|j| format!("[{}]", row(j))).collect();
    format!("geometry = {{ kind = \"heightfield\", values = [{}] }}", rows.join(", "))
}

/// Returns a height field of independent random heights from 0 to `height`.
pub fn noise(side: usize, height: f64, seed: u64) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    height_field(side, |_, _| height * random.random::<f64>())
}

/// Returns a height field of pillars of 2 x 2 samples, one at a random place in each of `count` x `count` cells.
pub fn pillars(side: usize, count: usize, height: f64, seed: u64) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let cell = side / count;
    let feet: Vec<[usize; 2]> = (0..count * count)
        .map(|k| [k % count, k / count].map(|at| at * cell + random.random_range(0..=cell - 3)))
        .collect();
    let is_on = |at: [usize; 2], foot: &[usize; 2]| (0..2).all(|axis| (foot[axis]..foot[axis] + 2).contains(&at[axis]));
    height_field(side, |i, j| if feet.iter().any(|foot| is_on([i, j], foot)) { height } else { 0.0 })
}

/// Returns a height field of large waves with random heights of a small scale on them.
pub fn two_scales(side: usize, seed: u64) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let wave = |at: usize| (std::f64::consts::TAU * 2.0 * (at as f64 + 0.5) / side as f64).sin();
    height_field(side, |i, j| 0.06 * (wave(i) + wave(j)) + 0.008 * random.random::<f64>())
}
