//! Light through two rough faces: refraction at many facets of the first, and the lobe of the second.

use super::math::exp_negative;
use super::{LANES, multiversion, total};

/// Rays inside a slab as columns of one length, a multiple of [`LANES`]. Vectors are η times the unit vector towards the
/// light, so that their z is positive.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RayColumns {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub z: Vec<f32>,
    pub weight: Vec<f32>,
}

/// Facets as columns of one length, a multiple of [`LANES`]; those without mass fill up the last lane.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FacetColumns {
    pub slope_x: Vec<f32>,
    pub slope_y: Vec<f32>,
    pub mass: Vec<f32>,
}

impl FacetColumns {
    /// Columns of facets, given as slopes and masses.
    pub fn new(facets: impl Iterator<Item = ([f32; 2], f32)>) -> Self {
        let mut columns = Self::default();
        for ([x, y], mass) in facets {
            columns.slope_x.push(x);
            columns.slope_y.push(y);
            columns.mass.push(mass);
        }
        let length = columns.mass.len().next_multiple_of(LANES);
        for column in [&mut columns.slope_x, &mut columns.slope_y, &mut columns.mass] {
            column.resize(length, 0.0);
        }
        columns
    }
}

/// Material between the faces: its index over that of the surroundings, and absorption times thickness.
#[derive(Debug, Clone, Copy)]
pub struct Interior {
    pub eta: f32,
    pub depth: f32,
}

/// Slopes of one family with the symmetric matrix xx, xy, yy: the inverse of the squared roughnesses for densities, the
/// squared roughnesses for masking.
pub type Quadratic = [f32; 3];

/// Family of slopes of a kernel: Beckmann or GGX.
pub const BECKMANN: usize = 0;
pub const GGX: usize = 1;

/// Smith's Λ for `kᵀ S k` with the squared roughnesses `S` and `k = w.xy / w.z`, to 2e-7 beside 1.
#[inline(always)]
pub(crate) fn smith_lambda<const FAMILY: usize>(square: f32) -> f32 {
    if FAMILY == GGX {
        return 0.5 * ((1.0 + square.max(0.0)).sqrt() - 1.0);
    }
    // The complementary error function to 1.5e-7 (Abramowitz and Stegun 1964, 7.1.26).
    let v = 1.0 / square.max(1e-8).sqrt();
    let t = 1.0 / (1.0 + 0.327_591_1 * v);
    let series = t * (0.254_829_6 + t * (-0.284_496_74 + t * (1.421_413_7 + t * (-1.453_152_1 + t * 1.061_405_4))));
    (0.5 * exp_negative(-v * v) * (0.564_189_6 / v - series)).max(0.0)
}

/// Smallest z of the unnormalised facet normal: steeper facets, beyond a slope of some 1e4, have no light in f32.
const LEAST_Z: f32 = 1e-4;

multiversion! {
    /// Refracts light from `i` (z above 0) at each facet. The weight is that of the light at the other face over the cosine
    /// there: mass, projected area, Fresnel transmittance and absorption, divided by η times the cosine inside.
    pub fn enter(facets: &FacetColumns, i: [f32; 3], interior: Interior, rays: &mut RayColumns) {
        let length = facets.mass.len();
        for column in [&mut rays.x, &mut rays.y, &mut rays.z, &mut rays.weight] {
            column.resize(length, 0.0);
        }
        let square = interior.eta * interior.eta;
        let depth = interior.depth * interior.eta;
        let mut out = rays.x.as_chunks_mut::<LANES>().0.iter_mut()
            .zip(rays.y.as_chunks_mut::<LANES>().0)
            .zip(rays.z.as_chunks_mut::<LANES>().0)
            .zip(rays.weight.as_chunks_mut::<LANES>().0);
        let lanes = facets.slope_x.as_chunks::<LANES>().0.iter()
            .zip(facets.slope_y.as_chunks::<LANES>().0)
            .zip(facets.mass.as_chunks::<LANES>().0);
        for ((slope_x, slope_y), mass) in lanes {
            let Some((((x, y), z), weight)) = out.next() else { return };
            for l in 0..LANES {
                let (mx, my) = (slope_x[l], slope_y[l]);
                let up = 1.0 / (1.0 + mx * mx + my * my).sqrt();
                let facing = i[0] * mx + i[1] * my + i[2];
                let c = facing * up;
                let behind = (square - 1.0 + c * c).max(0.0).sqrt();
                let turn = (behind - c) * up;
                let (tx, ty, tz) = (i[0] + turn * mx, i[1] + turn * my, i[2] + turn);
                let s = (c - behind) / (c + behind).max(1e-30);
                let p = (square * c - behind) / (square * c + behind).max(1e-30);
                let through = 1.0 - 0.5 * (s * s + p * p);
                let is_valid = (c > 0.0) & (tz > 0.0);
                let cosine = if is_valid { tz } else { 1.0 };
                let arriving = mass[l] * facing * through * exp_negative(-depth / cosine) / cosine;
                x[l] = if is_valid { tx } else { 0.0 };
                y[l] = if is_valid { ty } else { 0.0 };
                z[l] = cosine;
                weight[l] = if is_valid { arriving } else { 0.0 };
            }
        }
    }
}

multiversion! {
    /// Multiplies the weights of rays by Smith's masking `1 / (1 + mass Λ)` of a face.
    pub fn mask<const FAMILY: usize>(squares: Quadratic, mass: f32, rays: &mut RayColumns) {
        let lanes = rays.x.as_chunks::<LANES>().0.iter()
            .zip(rays.y.as_chunks::<LANES>().0)
            .zip(rays.z.as_chunks::<LANES>().0)
            .zip(rays.weight.as_chunks_mut::<LANES>().0);
        for (((x, y), z), weight) in lanes {
            for l in 0..LANES {
                let (kx, ky) = (x[l] / z[l], y[l] / z[l]);
                let square = squares[0] * kx * kx + 2.0 * squares[1] * kx * ky + squares[2] * ky * ky;
                let lambda = smith_lambda::<FAMILY>(square);
                weight[l] /= 1.0 + mass * lambda;
            }
        }
    }
}

/// The facet that refracts one ray to `o`: its slope, and its factor on the density of slopes, without `1 / |o.z|`. The
/// factor is 0 if no facet does.
#[inline(always)]
fn leaving([x, y, z]: [f32; 3], weight: f32, o: [f32; 3], square: f32) -> ([f32; 2], f32) {
    let (sx, sy, sz) = (x + o[0], y + o[1], z + o[2]);
    let inside = x * sx + y * sy + z * sz;
    let outside = -(o[0] * sx + o[1] * sy + o[2] * sz);
    let is_valid = (sz > LEAST_Z) & (inside > 0.0) & (outside > 0.0);
    let up = if is_valid { 1.0 / sz } else { 0.0 };
    let s = (inside - outside) / (inside + outside).max(1e-30);
    let p = (inside - square * outside) / (inside + square * outside).max(1e-30);
    let through = 1.0 - 0.5 * (s * s + p * p);
    let factor = weight * through * (inside * up * up) * (outside * up * up);
    ([sx * up, sy * up], if is_valid { factor } else { 0.0 })
}

multiversion! {
    /// Sum over rays of the lobe of a face towards `o` (z below 0), without `1 / |o.z|` and the peak of the density.
    /// `inverse` is the inverse of its squared roughnesses.
    pub fn leave<const FAMILY: usize>(rays: &RayColumns, o: [f32; 3], square: f32, inverse: Quadratic) -> f64 {
        let lanes = rays.x.as_chunks::<LANES>().0.iter()
            .zip(rays.y.as_chunks::<LANES>().0)
            .zip(rays.z.as_chunks::<LANES>().0)
            .zip(rays.weight.as_chunks::<LANES>().0);
        let mut sum = 0.0;
        for (((x, y), z), weight) in lanes {
            let mut values = [0.0_f32; LANES];
            for l in 0..LANES {
                let ([mx, my], factor) = leaving([x[l], y[l], z[l]], weight[l], o, square);
                let q = inverse[0] * mx * mx + 2.0 * inverse[1] * mx * my + inverse[2] * my * my;
                let density = if FAMILY == GGX {
                    let root = 1.0 / (1.0 + q);
                    root * root
                } else {
                    exp_negative(-q)
                };
                values[l] = factor * density;
            }
            sum += total(&values);
        }
        sum
    }
}

/// Slopes and factors of the facets that refract rays to one direction.
#[derive(Debug, Clone, Default)]
pub struct LeavingColumns {
    pub slope_x: Vec<f32>,
    pub slope_y: Vec<f32>,
    pub factor: Vec<f32>,
}

multiversion! {
    /// As [`leave`], but reports the facets for a density that has no formula.
    pub fn leaving_facets(rays: &RayColumns, o: [f32; 3], square: f32, facets: &mut LeavingColumns) {
        let length = rays.weight.len();
        for column in [&mut facets.slope_x, &mut facets.slope_y, &mut facets.factor] {
            column.resize(length, 0.0);
        }
        let lanes = rays.x.as_chunks::<LANES>().0.iter()
            .zip(rays.y.as_chunks::<LANES>().0)
            .zip(rays.z.as_chunks::<LANES>().0)
            .zip(rays.weight.as_chunks::<LANES>().0);
        let mut out = facets.slope_x.as_chunks_mut::<LANES>().0.iter_mut()
            .zip(facets.slope_y.as_chunks_mut::<LANES>().0)
            .zip(facets.factor.as_chunks_mut::<LANES>().0);
        for (((x, y), z), weight) in lanes {
            let Some(((slope_x, slope_y), factor)) = out.next() else { return };
            for l in 0..LANES {
                ([slope_x[l], slope_y[l]], factor[l]) = leaving([x[l], y[l], z[l]], weight[l], o, square);
            }
        }
    }
}
