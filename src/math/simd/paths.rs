//! Paths of one viewer through a slab, a lane at a time: refraction at given facets of both faces.

use super::math::ln_positive;
use super::refraction::{Quadratic, smith_lambda};
use super::{LANES, multiversion};

/// Unit directions of travel with weights.
#[derive(Debug, Clone)]
pub struct RayLane {
    pub x: [f32; LANES],
    pub y: [f32; LANES],
    pub z: [f32; LANES],
    pub weight: [f32; LANES],
    /// Weight of the light that was on its way before masking, or that turned back; it is lost.
    pub lost: [f32; LANES],
}

impl RayLane {
    /// Rays without light.
    pub const EMPTY: Self =
        Self { x: [0.0; LANES], y: [0.0; LANES], z: [-1.0; LANES], weight: [0.0; LANES], lost: [0.0; LANES] };
}

multiversion! {
    /// Refracts light that travels along `d` (z below 0) at each facet of the top. The weight is the part that enters, for
    /// facets of area 1 over `scale`. Light that would go up is lost.
    pub fn enter_lane(slope_x: &[f32; LANES], slope_y: &[f32; LANES], d: [f32; 3], scale: f32, eta: f32, rays: &mut RayLane) {
        let square = eta * eta;
        for l in 0..LANES {
            let (mx, my) = (slope_x[l], slope_y[l]);
            let up = 1.0 / (1.0 + mx * mx + my * my).sqrt();
            let facing = -(d[0] * mx + d[1] * my + d[2]);
            let c = (facing * up).clamp(0.0, 1.0);
            let behind = (square - 1.0 + c * c).max(0.0).sqrt();
            let turn = (c - behind) * up;
            let (tx, ty, tz) = ((d[0] + turn * mx) / eta, (d[1] + turn * my) / eta, (d[2] + turn) / eta);
            let s = (c - behind) / (c + behind).max(1e-30);
            let p = (square * c - behind) / (square * c + behind).max(1e-30);
            let weight = scale * facing.max(0.0) * (1.0 - 0.5 * (s * s + p * p));
            let is_down = tz < 0.0;
            rays.x[l] = tx;
            rays.y[l] = ty;
            rays.z[l] = if is_down { tz } else { -1.0 };
            rays.weight[l] = if is_down { weight } else { 0.0 };
            rays.lost[l] = if is_down { 0.0 } else { weight };
        }
    }
}

multiversion! {
    /// Refracts light inside, on its way down, at one facet of the bottom each. `areas` is `(1 + Λ) |d.z|` of each ray at
    /// the bottom. Light that would go up is lost; light that is reflected totally, or meets no facet, has no weight.
    /// `reflected` gets the weights of the light that the facets reflect.
    pub fn leave_lane(slopes: [&[f32; LANES]; 2], areas: &[f32; LANES], eta: f32, rays: &RayLane, out: &mut RayLane, reflected: &mut [f32; LANES]) {
        let [slope_x, slope_y] = slopes;
        let square = eta * eta;
        for l in 0..LANES {
            let (mx, my) = (slope_x[l], slope_y[l]);
            let (x, y, z) = (rays.x[l], rays.y[l], rays.z[l]);
            let up = 1.0 / (1.0 + mx * mx + my * my).sqrt();
            let facing = (-(x * mx + y * my + z)).max(0.0);
            let c = (facing * up).min(1.0);
            let behind_square = 1.0 - (1.0 - c * c) * square;
            let behind = behind_square.max(0.0).sqrt();
            let turn = (c * eta - behind) * up;
            let (tx, ty, tz) = (x * eta + turn * mx, y * eta + turn * my, z * eta + turn);
            // The index behind over that before is 1 / η.
            let s = (eta * c - behind) / (eta * c + behind).max(1e-30);
            let p = (c - eta * behind) / (c + eta * behind).max(1e-30);
            let through = if behind_square > 0.0 { 1.0 - 0.5 * (s * s + p * p) } else { 0.0 };
            let arriving = rays.weight[l] * facing / areas[l];
            let weight = arriving * through;
            reflected[l] = arriving - weight;
            let is_down = tz < 0.0;
            out.x[l] = tx;
            out.y[l] = ty;
            out.z[l] = if is_down { tz } else { -1.0 };
            out.weight[l] = if is_down { weight } else { 0.0 };
            out.lost[l] = if is_down { 0.0 } else { weight };
        }
    }
}

multiversion! {
    /// `(1 + mass Λ) |w.z|` of each ray, for a face of analytic slopes.
    pub fn facing_lane<const FAMILY: usize>(squares: Quadratic, mass: f32, rays: &RayLane, areas: &mut [f32; LANES]) {
        for (l, area) in areas.iter_mut().enumerate() {
            let (x, y, z) = (rays.x[l], rays.y[l], rays.z[l].abs().max(1e-9));
            let square = (squares[0] * x * x + 2.0 * squares[1] * x * y + squares[2] * y * y) / (z * z);
            *area = (1.0 + mass * smith_lambda::<FAMILY>(square)) * z;
        }
    }
}

multiversion! {
    /// Masks rays: their weights are multiplied by `|w.z| / area`, at most 1, and what this removes is lost.
    pub fn mask_lane(areas: &[f32; LANES], rays: &mut RayLane) {
        for (l, area) in areas.iter().enumerate() {
            let kept = rays.weight[l] * (rays.z[l].abs() / area).min(1.0);
            rays.lost[l] += rays.weight[l] - kept;
            rays.weight[l] = kept;
        }
    }
}

multiversion! {
    /// Sum of the areas of facets as `o` sees them.
    pub fn facing_sum(slope_x: &[f32], slope_y: &[f32], o: [f32; 3]) -> f32 {
        let mut sums = [0.0_f32; 16];
        let (x, y) = (slope_x.as_chunks::<16>(), slope_y.as_chunks::<16>());
        for (x, y) in x.0.iter().zip(y.0) {
            for l in 0..16 {
                sums[l] += (o[0] * x[l] + o[1] * y[l] + o[2]).max(0.0);
            }
        }
        let rest: f32 = x.1.iter().zip(y.1).map(|(x, y)| (o[0] * x + o[1] * y + o[2]).max(0.0)).sum();
        sums.iter().sum::<f32>() + rest
    }
}

multiversion! {
    /// Weighted sums of columns of one length, at least `least`, and their logarithms.
    pub fn ln_of_sum(columns: &[(&[f32], f32)], least: f32, sums: &mut [f32], logarithms: &mut [f32]) {
        sums.fill(0.0);
        for (column, weight) in columns {
            for (sum, value) in sums.iter_mut().zip(*column) {
                *sum += weight * value;
            }
        }
        for (sum, ln) in sums.iter_mut().zip(logarithms) {
            *sum = sum.max(least);
            *ln = ln_positive(*sum);
        }
    }
}
