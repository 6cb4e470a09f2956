//! Visibility of many facets along one direction, and sums over what is visible.

use super::{BLOCK, LANES, multiversion};

#[inline(always)]
fn soft_step(x: f32) -> f32 {
    (x + 0.5).clamp(0.0, 1.0)
}

multiversion! {
    /// `out = 1` above the horizon interpolated between two azimuths, 0 below, with a ramp of `1/sharpness` radians.
    pub fn ground_visibility(from: &[f32], to: &[f32], blend: f32, elevation: f32, sharpness: f32, out: &mut [f32]) {
        for ((out, &from), &to) in out.iter_mut().zip(from).zip(to) {
            let horizon = from + (to - from) * blend;
            *out = soft_step((elevation - horizon) * sharpness);
        }
    }
}

multiversion! {
    /// Multiplies `out` by what one layer of blocked intervals (`[low, high]`) leaves, blended between two azimuths.
    pub fn floating_visibility(
        from: [&[f32]; 2],
        to: [&[f32]; 2],
        blend: f32,
        elevation: f32,
        sharpness: f32,
        out: &mut [f32],
    ) {
        let [from_low, from_high] = from;
        let [to_low, to_high] = to;
        let inside = |low: f32, high: f32| soft_step((elevation - low) * sharpness) - soft_step((elevation - high) * sharpness);
        let n = out.len();
        let (from_low, from_high, to_low, to_high) = (&from_low[..n], &from_high[..n], &to_low[..n], &to_high[..n]);
        for s in 0..n {
            let blocked = inside(from_low[s], from_high[s]) * (1.0 - blend) + inside(to_low[s], to_high[s]) * blend;
            out[s] *= 1.0 - blocked;
        }
    }
}

multiversion! {
    /// `Σ w a b`, f64 between blocks, for each of the weight columns: the visible area of facets that share a normal.
    pub fn masked_sum<const C: usize>(weights: [&[f32]; C], a: &[f32], b: &[f32]) -> [f64; C] {
        let n = a.len().min(b.len());
        let mut totals = [0.0; C];
        let mut start = 0;
        while start < n {
            let end = (start + BLOCK).min(n);
            let mut lanes = [[0.0_f32; LANES]; C];
            let mut s = start;
            while s + LANES <= end {
                for l in 0..LANES {
                    let seen = a[s + l] * b[s + l];
                    for c in 0..C {
                        lanes[c][l] += weights[c][s + l] * seen;
                    }
                }
                s += LANES;
            }
            while s < end {
                for c in 0..C {
                    lanes[c][0] += weights[c][s] * a[s] * b[s];
                }
                s += 1;
            }
            for c in 0..C {
                totals[c] += lanes[c].iter().map(|&x| f64::from(x)).sum::<f64>();
            }
            start = end;
        }
        totals
    }
}

multiversion! {
    /// `Σ w v (n·d)+`: the visible projected area along `d` (Wu et al. 2011, Eq. 10), f64 between blocks.
    pub fn projected_area(normals: [&[f32]; 3], weights: &[f32], v: &[f32], d: glam::Vec3) -> f64 {
        let n = v.len();
        let [nx, ny, nz] = normals.map(|x| &x[..n]);
        let weights = &weights[..n];
        let mut total = 0.0;
        let mut start = 0;
        while start < n {
            let end = (start + BLOCK).min(n);
            let mut lanes = [0.0_f32; LANES];
            let one = |s: usize| weights[s] * v[s] * (nx[s] * d.x + ny[s] * d.y + nz[s] * d.z).max(0.0);
            let mut s = start;
            while s + LANES <= end {
                for (l, lane) in lanes.iter_mut().enumerate() {
                    *lane += one(s + l);
                }
                s += LANES;
            }
            for s in s..end {
                lanes[0] += one(s);
            }
            total += lanes.iter().map(|&x| f64::from(x)).sum::<f64>();
            start = end;
        }
        total
    }
}
