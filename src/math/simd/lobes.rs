//! The direct sum: scalar lobes of the analytic BRDFs over many facets, for one pair of directions.

use std::f32::consts::PI;

use glam::Vec3;

use super::math::{exp_negative, ln_one_minus};
use super::{LANES, LightPairs, blocks, lane, multiversion, total};
use crate::math::directions::half_vector;

/// The vectors of one pair of directions.
#[derive(Debug, Clone, Copy)]
pub struct PairVectors {
    pub i: Vec3,
    pub o: Vec3,
    pub h: Vec3,
    pub i_dot_h: f32,
}

impl PairVectors {
    pub fn new(i: Vec3, o: Vec3) -> Self {
        let h = half_vector(i, o);
        // The mean of the two dot products, so that swapping i and o changes no bit.
        Self { i, o, h, i_dot_h: 0.5 * (i.dot(h) + o.dot(h)) }
    }
}

/// An analytic lobe, `f_r (n·i)+ (n·o)+` without its tint, with the constants of its inner loop precomputed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lobe {
    Lambertian,
    BlinnPhong { half_exponent: f32, scale: f32 },
    CookTorrance { inverse_m2: f32, scale: f32 },
    Ward { inverse_alpha2: f32, scale: f32 },
    Ggx { alpha2: f32, scale: f32 },
}

impl Lobe {
    pub fn blinn_phong(exponent: f32) -> Self {
        Self::BlinnPhong { half_exponent: 0.5 * exponent, scale: (exponent + 8.0) / (8.0 * PI) }
    }

    pub fn cook_torrance(roughness: f32) -> Self {
        let inverse_m2 = 1.0 / (roughness * roughness);
        Self::CookTorrance { inverse_m2, scale: inverse_m2 / (4.0 * PI) }
    }

    pub fn ward(roughness: f32) -> Self {
        let inverse_alpha2 = 1.0 / (roughness * roughness);
        Self::Ward { inverse_alpha2, scale: inverse_alpha2 / (4.0 * PI) }
    }

    pub fn ggx(roughness: f32) -> Self {
        let alpha2 = roughness * roughness;
        Self::Ggx { alpha2, scale: alpha2 / (2.0 * PI) }
    }

    /// The lobe's kind and constants as numbers; they are equal for equal lobes only.
    pub(crate) fn numbers(&self) -> [f32; 3] {
        match *self {
            Self::Lambertian => [0.0; 3],
            Self::BlinnPhong { half_exponent, scale } => [1.0, half_exponent, scale],
            Self::CookTorrance { inverse_m2, scale } => [2.0, inverse_m2, scale],
            Self::Ward { inverse_alpha2, scale } => [3.0, inverse_alpha2, scale],
            Self::Ggx { alpha2, scale } => [4.0, alpha2, scale],
        }
    }
}

/// The angles of one facet that lobes depend on. `n·h` and `|n×h|²` come from `|n-h|²`, which does not cancel near the
/// mirror direction and is quadratic in the rounding of the normal's length.
#[derive(Clone, Copy)]
struct LobeInput {
    n_dot_i: f32,
    n_dot_o: f32,
    n_dot_h: f32,
    sin2: f32,
}

#[inline(always)]
fn lobe_input(pair: &PairVectors, x: f32, y: f32, z: f32) -> LobeInput {
    let (i, o, h) = (pair.i, pair.o, pair.h);
    let (dx, dy, dz) = (x - h.x, y - h.y, z - h.z);
    let d2 = dx * dx + dy * dy + dz * dz;
    LobeInput {
        n_dot_i: (x * i.x + y * i.y + z * i.z).max(0.0),
        n_dot_o: (x * o.x + y * o.y + z * o.z).max(0.0),
        n_dot_h: (1.0 - 0.5 * d2).max(1e-6),
        sin2: (d2 * (1.0 - 0.25 * d2)).clamp(0.0, 1.0),
    }
}

impl LobeInput {
    #[inline(always)]
    fn is_lit(self) -> bool {
        self.n_dot_i * self.n_dot_o > 0.0
    }
}

/// The value of a lobe at one facet, `f_r (n·i)+ (n·o)+` without its tint; swapping `i` and `o` changes no bit.
///
/// This is a trait because a closure cannot be marked `inline(always)`, and one call per facet would keep the compiler
/// from vectorising the loop.
trait Value: Copy {
    fn at(self, n: LobeInput) -> f32;
}

/// (n·i)(n·o)/π
#[derive(Clone, Copy)]
struct Lambertian;

impl Value for Lambertian {
    #[inline(always)]
    fn at(self, n: LobeInput) -> f32 {
        n.n_dot_i * n.n_dot_o * (1.0 / PI)
    }
}

/// scale (n·h)^e (n·i)(n·o), with the power computed as exp(e/2 ln(1-sin²)).
#[derive(Clone, Copy)]
struct BlinnPhong {
    half_exponent: f32,
    scale: f32,
}

impl Value for BlinnPhong {
    #[inline(always)]
    fn at(self, n: LobeInput) -> f32 {
        let log = (self.half_exponent * ln_one_minus(n.sin2.min(0.999_999))).min(0.0);
        self.scale * exp_negative(log) * (n.n_dot_i * n.n_dot_o)
    }
}

/// D G / 4 with Beckmann's distribution and V-cavity masking; `masking` is 2/(i·h).
#[derive(Clone, Copy)]
struct CookTorrance {
    inverse_m2: f32,
    scale: f32,
    masking: f32,
}

impl Value for CookTorrance {
    #[inline(always)]
    fn at(self, n: LobeInput) -> f32 {
        let inverse_cos2 = 1.0 / (n.n_dot_h * n.n_dot_h);
        let d = exp_negative(-n.sin2 * inverse_cos2 * self.inverse_m2) * inverse_cos2 * inverse_cos2 * self.scale;
        d * (self.masking * n.n_dot_h * n.n_dot_i.min(n.n_dot_o)).min(1.0)
    }
}

/// exp(-tan²/α²) sqrt((n·i)(n·o)) / (4πα²)
#[derive(Clone, Copy)]
struct Ward {
    inverse_alpha2: f32,
    scale: f32,
}

impl Value for Ward {
    #[inline(always)]
    fn at(self, n: LobeInput) -> f32 {
        self.scale
            * exp_negative(-n.sin2 / (n.n_dot_h * n.n_dot_h) * self.inverse_alpha2)
            * (n.n_dot_i * n.n_dot_o).sqrt()
    }
}

/// D G2 / 4 with height-correlated Smith masking; the denominator of GGX is sin² + α² cos².
#[derive(Clone, Copy)]
struct Ggx {
    alpha2: f32,
    scale: f32,
}

impl Value for Ggx {
    #[inline(always)]
    fn at(self, n: LobeInput) -> f32 {
        let rest = 1.0 - self.alpha2;
        let t = n.sin2 + self.alpha2 * n.n_dot_h * n.n_dot_h;
        let smith_o = (self.alpha2 + rest * n.n_dot_i * n.n_dot_i).sqrt();
        let smith_i = (self.alpha2 + rest * n.n_dot_o * n.n_dot_o).sqrt();
        let smith = n.n_dot_o * smith_o + n.n_dot_i * smith_i;
        self.scale * (n.n_dot_i * n.n_dot_o) / (t * t * smith.max(1e-20))
    }
}

#[inline(always)]
fn masking(pair: &PairVectors) -> f32 {
    2.0 / pair.i_dot_h.max(1e-20)
}

/// Values of a lane of facets; 0 if a normal faces away from either direction, as the padding does.
#[inline(always)]
fn lobe_lane(pair: &PairVectors, normals: [&[f32]; 3], at: usize, value: impl Value) -> [f32; LANES] {
    let [x, y, z] = [lane(normals[0], at), lane(normals[1], at), lane(normals[2], at)];
    let mut values = [0.0_f32; LANES];
    for l in 0..LANES {
        let input = lobe_input(pair, x[l], y[l], z[l]);
        let f = value.at(input);
        values[l] = if input.is_lit() { f } else { 0.0 };
    }
    values
}

#[inline(always)]
fn sum<const C: usize>(
    pair: &PairVectors,
    normals: [&[f32]; 3],
    weights: [&[f32]; C],
    v_i: &[f32],
    v_o: &[f32],
    value: impl Value,
) -> [f64; C] {
    let mut totals = [0.0; C];
    for block in blocks(v_i.len()) {
        let mut lanes = [[0.0_f32; LANES]; C];
        for at in block {
            let values = lobe_lane(pair, normals, at, value);
            let (v_i, v_o) = (lane(v_i, at), lane(v_o, at));
            for c in 0..C {
                let w = lane(weights[c], at);
                for l in 0..LANES {
                    lanes[c][l] += values[l] * (v_i[l] * v_o[l]) * w[l];
                }
            }
        }
        for c in 0..C {
            totals[c] += total(&lanes[c]);
        }
    }
    totals
}

multiversion! {
    /// `Σ_s w_s[c] v_i[s] v_o[s] lobe(n_s, i, o)` for each weight column `c`; all slices have the length of `v_i`.
    pub fn lobe_sums<const C: usize>(
        lobe: Lobe,
        pair: &PairVectors,
        normals: [&[f32]; 3],
        weights: [&[f32]; C],
        v_i: &[f32],
        v_o: &[f32],
    ) -> [f64; C] {
        let masking = masking(pair);
        match lobe {
            Lobe::Lambertian => sum(pair, normals, weights, v_i, v_o, Lambertian),
            Lobe::BlinnPhong { half_exponent, scale } => {
                sum(pair, normals, weights, v_i, v_o, BlinnPhong { half_exponent, scale })
            }
            Lobe::CookTorrance { inverse_m2, scale } => {
                sum(pair, normals, weights, v_i, v_o, CookTorrance { inverse_m2, scale, masking })
            }
            Lobe::Ward { inverse_alpha2, scale } => {
                sum(pair, normals, weights, v_i, v_o, Ward { inverse_alpha2, scale })
            }
            Lobe::Ggx { alpha2, scale } => sum(pair, normals, weights, v_i, v_o, Ggx { alpha2, scale }),
        }
    }
}

#[inline(always)]
fn each(pair: &PairVectors, normals: [&[f32]; 3], out: &mut [f32], value: impl Value) {
    for (k, out) in out.chunks_mut(LANES).enumerate() {
        let values = lobe_lane(pair, normals, k * LANES, value);
        out.copy_from_slice(&values[..out.len()]);
    }
}

multiversion! {
    /// `out[s] = lobe(n_s, i, o)`: [`lobe_sums`] without the sum.
    pub fn lobe_values(lobe: Lobe, pair: &PairVectors, normals: [&[f32]; 3], out: &mut [f32]) {
        let masking = masking(pair);
        match lobe {
            Lobe::Lambertian => each(pair, normals, out, Lambertian),
            Lobe::BlinnPhong { half_exponent, scale } => each(pair, normals, out, BlinnPhong { half_exponent, scale }),
            Lobe::CookTorrance { inverse_m2, scale } => {
                each(pair, normals, out, CookTorrance { inverse_m2, scale, masking })
            }
            Lobe::Ward { inverse_alpha2, scale } => each(pair, normals, out, Ward { inverse_alpha2, scale }),
            Lobe::Ggx { alpha2, scale } => each(pair, normals, out, Ggx { alpha2, scale }),
        }
    }
}

#[inline(always)]
fn each_light<V: Value>(pairs: &LightPairs, n: Vec3, out: &mut [f32; LANES], value: impl Fn(f32) -> V) {
    let (o, count) = (pairs.o, pairs.padded());
    let [[ix, iy, iz], [hx, hy, hz]] = [pairs.i.each_ref(), pairs.h.each_ref()].map(|v| v.map(|x| &x[..count]));
    let (i_dot_h, out) = (&pairs.i_dot_h[..count], &mut out[..count]);
    for k in 0..count {
        let pair = PairVectors {
            i: Vec3::new(ix[k], iy[k], iz[k]),
            o,
            h: Vec3::new(hx[k], hy[k], hz[k]),
            i_dot_h: i_dot_h[k],
        };
        let input = lobe_input(&pair, n.x, n.y, n.z);
        let f = value(masking(&pair)).at(input);
        out[k] = if input.is_lit() { f } else { 0.0 };
    }
}

multiversion! {
    /// `out[k] = lobe(n, i_k, o)`: the same values as from [`lobe_values`], for one normal and many lights.
    pub fn light_lobes(lobe: Lobe, pairs: &LightPairs, normal: glam::Vec3, out: &mut [f32; super::LANES]) {
        match lobe {
            Lobe::Lambertian => each_light(pairs, normal, out, |_| Lambertian),
            Lobe::BlinnPhong { half_exponent, scale } => {
                each_light(pairs, normal, out, |_| BlinnPhong { half_exponent, scale })
            }
            Lobe::CookTorrance { inverse_m2, scale } => {
                each_light(pairs, normal, out, |masking| CookTorrance { inverse_m2, scale, masking })
            }
            Lobe::Ward { inverse_alpha2, scale } => each_light(pairs, normal, out, |_| Ward { inverse_alpha2, scale }),
            Lobe::Ggx { alpha2, scale } => each_light(pairs, normal, out, |_| Ggx { alpha2, scale }),
        }
    }
}

#[inline(always)]
fn around<const C: usize, V: Value>(
    vectors: [Vec3; 2],
    to: [&[f32]; 3],
    visibility: &[f32],
    tints: [[f32; 2]; C],
    out: &mut [f32],
    value: impl Fn(f32) -> V,
) {
    if tints.iter().all(|[facing, grazing]| facing == grazing) {
        tinted::<C, false, V>(vectors, to, visibility, tints, out, value);
    } else {
        tinted::<C, true, V>(vectors, to, visibility, tints, out, value);
    }
}

/// The loop of [`around`]. If no tint `CHANGES`, the compiler leaves out the half vectors that only tints need.
#[inline(always)]
fn tinted<const C: usize, const CHANGES: bool, V: Value>(
    [n, away]: [Vec3; 2],
    to: [&[f32]; 3],
    visibility: &[f32],
    tints: [[f32; 2]; C],
    out: &mut [f32],
    value: impl Fn(f32) -> V,
) {
    let count = visibility.len();
    let (to, mut rows) = (to.map(|x| &x[..count]), out.chunks_exact_mut(count));
    let mut rows: [&mut [f32]; C] = std::array::from_fn(|_| rows.next().unwrap_or_default());
    for start in (0..count).step_by(LANES) {
        let [x, y, z, v] = [lane(to[0], start), lane(to[1], start), lane(to[2], start), lane(visibility, start)];
        let (mut values, mut weights) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        for l in 0..LANES {
            let i = Vec3::new(x[l], y[l], z[l]);
            let (sx, sy, sz) = (i.x + away.x, i.y + away.y, i.z + away.z);
            let squared = (sx * sx + sy * sy + sz * sz).max(1e-12);
            let inverse = 1.0 / squared.sqrt();
            let i_dot_h = 0.5 * squared * inverse;
            let h = Vec3::new(sx * inverse, sy * inverse, sz * inverse);
            let pair = PairVectors { i, o: away, h, i_dot_h };
            let input = lobe_input(&pair, n.x, n.y, n.z);
            let f = value(masking(&pair)).at(input);
            values[l] = if input.is_lit() { f * v[l] } else { 0.0 };
            if CHANGES {
                let t = (1.0 - i_dot_h).max(0.0);
                weights[l] = t * t * t * t * t;
            }
        }
        for (row, [facing, grazing]) in rows.iter_mut().zip(tints) {
            let add = |l: usize, out: &mut f32| {
                let tint = if CHANGES { facing + (grazing - facing) * weights[l] } else { facing };
                *out += values[l] * tint;
            };
            match row[start..].first_chunk_mut::<LANES>() {
                Some(lane) => (0..LANES).for_each(|l| add(l, &mut lane[l])),
                None => row[start..].iter_mut().enumerate().for_each(|(l, out)| add(l, out)),
            }
        }
    }
}

multiversion! {
    /// `out[c][k] += tint_c(i·h) visibility[k] lobe(n, to_k, away)` for one normal, one direction `away`, and many
    /// others. A tint is linear in `(1 - i·h)^5`; `tints` holds its values at 0 and at 1. `out` has a row per channel.
    pub fn add_lobes_around<const C: usize>(
        lobe: Lobe,
        vectors: [glam::Vec3; 2],
        to: [&[f32]; 3],
        visibility: &[f32],
        tints: [[f32; 2]; C],
        out: &mut [f32],
    ) {
        match lobe {
            Lobe::Lambertian => around(vectors, to, visibility, tints, out, |_| Lambertian),
            Lobe::BlinnPhong { half_exponent, scale } => {
                around(vectors, to, visibility, tints, out, |_| BlinnPhong { half_exponent, scale })
            }
            Lobe::CookTorrance { inverse_m2, scale } => {
                around(vectors, to, visibility, tints, out, |masking| CookTorrance { inverse_m2, scale, masking })
            }
            Lobe::Ward { inverse_alpha2, scale } => {
                around(vectors, to, visibility, tints, out, |_| Ward { inverse_alpha2, scale })
            }
            Lobe::Ggx { alpha2, scale } => around(vectors, to, visibility, tints, out, |_| Ggx { alpha2, scale }),
        }
    }
}
