//! Visibility of many facets along one direction, and sums over visible areas.

use super::{BLOCK, LANES, blocks, lane, multiversion, total};

/// Soft visibility along one direction as a function of slopes (tangents of the elevation) of horizons.
///
/// It rises from 0 to 1 about the horizon and is linear in the slope between: `½ + (sin e - s cos e)/w` for elevation
/// `e`, slope `s` and transition width `w`.
#[derive(Debug, Clone, Copy)]
pub struct HorizonTaps {
    /// The azimuths before and after the direction.
    pub azimuths: [usize; 2],
    /// Fraction of the way from one azimuth to the other.
    pub blend: f32,
    /// `½ + sin e / w`, the value for slope 0.
    pub base: f32,
    /// `cos e / w`, the decrease per unit of slope.
    pub scale: f32,
    /// `scale` times the weights of the two azimuths.
    pub scales: [f32; 2],
}

impl HorizonTaps {
    /// Every facet is visible.
    pub const ABOVE_ALL: Self = Self { azimuths: [0, 0], blend: 0.0, base: 2.0, scale: 0.0, scales: [0.0; 2] };

    /// Soft visibility above the horizon that is interpolated between two slopes. Values outside `[0, 1]` count as 0
    /// and 1. It does not increase with either slope, also after rounding.
    #[inline(always)]
    pub fn between(&self, from: f32, to: f32) -> f32 {
        self.base - self.scales[0] * from - self.scales[1] * to
    }

    /// Soft visibility above one slope, in `[0, 1]`.
    #[inline(always)]
    fn above(&self, slope: f32) -> f32 {
        soft(self.base - self.scale * slope)
    }
}

#[inline(always)]
fn soft(x: f32) -> f32 {
    x.clamp(0.0, 1.0)
}

multiversion! {
    /// `out` is 1 above and 0 below the horizon that is interpolated between two azimuths, with a transition between.
    pub fn horizon_visibility(from: &[f32], to: &[f32], taps: &HorizonTaps, out: &mut [f32]) {
        for ((out, &from), &to) in out.iter_mut().zip(from).zip(to) {
            *out = soft(taps.between(from, to));
        }
    }
}

/// Two horizons belong to different parts of the surface, and are not interpolated, if the tangent of their difference is
/// above [`JUMP`], or above [`JUMP_PART`] of the higher slope where that is less. Far parts have low horizons: their
/// jumps are small, but at grazing angles they decide what is seen.
const JUMP: f32 = 0.1;
const JUMP_PART: f32 = 0.5;

/// Slope of the change from one azimuth's visibility to the next one's, per azimuth step, if their horizons differ.
pub const SWITCH_RATE: f32 = 6.0;

multiversion! {
    /// [`horizon_visibility`] without interpolation between horizons of different parts of the surface. There a facet
    /// takes the visibility of one azimuth and changes to that of the next at its own point `switch`, in `[0, 1]`
    /// between the azimuths. Interpolation would halve the shadow that a thin part casts along `i` and `o` at once.
    pub fn stepped_visibility(
        from: &[f32],
        to: &[f32],
        switch: &[f32],
        taps: &HorizonTaps,
        out: &mut [f32],
    ) {
        for (((out, &from), &to), &switch) in out.iter_mut().zip(from).zip(to).zip(switch) {
            let changed = ((taps.blend - switch) * SWITCH_RATE + 0.5).clamp(0.0, 1.0);
            let (before, after) = (taps.above(from), taps.above(to));
            let either = before + (after - before) * changed;
            // The tangent of the difference of two angles is the difference of their tangents over 1 + their product.
            let is_jump = (to - from).abs() > (1.0 + from * to) * JUMP.min(JUMP_PART * from.max(to));
            *out = if is_jump { either } else { soft(taps.between(from, to)) };
        }
    }
}

multiversion! {
    /// The visibility, in `[0, 1]`, that each interval `(low, high)` of slopes removes from its facet. The interval
    /// belongs to the azimuth before (`side` 0) or after (1), and its facet changes at `switch` as in
    /// [`stepped_visibility`].
    pub fn interval_cover(
        low: &[f32],
        high: &[f32],
        switch: &[f32],
        side: f32,
        taps: &HorizonTaps,
        out: &mut [f32],
    ) {
        for (((out, &low), &high), &switch) in out.iter_mut().zip(low).zip(high).zip(switch) {
            let changed = ((taps.blend - switch) * SWITCH_RATE + 0.5).clamp(0.0, 1.0);
            *out = (1.0 - (side - changed).abs()) * (taps.above(low) - taps.above(high));
        }
    }
}

multiversion! {
    /// Writes the weighted sum of the bits of four rows for facet `first + k` to `out[k]`.
    pub fn blend_bits(rows: [&[u32]; 4], weights: [f32; 4], first: usize, out: &mut [f32]) {
        let word_at = |row: &[u32], k: usize| -> u32 {
            // The bits of 32 facets from `first + k` on, which need not start at a word boundary.
            let (word, shift) = ((first + k) / 32, (first + k) % 32);
            let low = row[word] >> shift;
            if shift == 0 || word + 1 >= row.len() { low } else { low | row[word + 1] << (32 - shift) }
        };
        let mut k = 0;
        while k < out.len() {
            let words = rows.map(|row| word_at(row, k));
            let width = (out.len() - k).min(32);
            let mut values = [0.0_f32; 32];
            for (word, weight) in words.iter().zip(weights) {
                for (l, value) in values.iter_mut().enumerate() {
                    *value += if word >> l & 1 == 1 { weight } else { 0.0 };
                }
            }
            out[k..k + width].copy_from_slice(&values[..width]);
            k += 32;
        }
    }
}

/// Facets that sums of visible areas process at a time; few, because runs are short.
const WIDTH: usize = 16;

multiversion! {
    /// `Σ w a b` for each of the weight columns, with an f64 sum over blocks, such as the visible area of facets that share a
    /// normal.
    pub fn masked_sum<const C: usize>(weights: [&[f32]; C], a: &[f32], b: &[f32]) -> [f64; C] {
        let mut sums = [0.0; C];
        // A loop, because the closure of a map would not be compiled for the instructions of this version.
        for (sum, weights) in sums.iter_mut().zip(weights) {
            for ((w, a), b) in weights.chunks(BLOCK).zip(a.chunks(BLOCK)).zip(b.chunks(BLOCK)) {
                let mut lanes = [0.0_f32; WIDTH];
                let (w_head, w_tail) = w.as_chunks::<WIDTH>();
                let (a_head, a_tail) = a.as_chunks::<WIDTH>();
                let (b_head, b_tail) = b.as_chunks::<WIDTH>();
                for ((w, a), b) in w_head.iter().zip(a_head).zip(b_head) {
                    for l in 0..WIDTH {
                        lanes[l] += w[l] * (a[l] * b[l]);
                    }
                }
                for (((lane, w), a), b) in lanes.iter_mut().zip(w_tail).zip(a_tail).zip(b_tail) {
                    *lane += w * (a * b);
                }
                *sum += total(&lanes);
            }
        }
        sums
    }
}

multiversion! {
    /// `Σ w v` with `v` as from [`horizon_visibility`], which is not stored, and with an f64 sum over blocks.
    pub fn visible_sum(weights: &[f32], from: &[f32], to: &[f32], taps: &HorizonTaps) -> f64 {
        let mut sum = 0.0;
        for start in (0..weights.len()).step_by(BLOCK) {
            let end = (start + BLOCK).min(weights.len());
            let (w, from, to) = (&weights[start..end], &from[start..end], &to[start..end]);
            let mut lanes = [0.0_f32; WIDTH];
            let (w_head, w_tail) = w.as_chunks::<WIDTH>();
            let (from_head, from_tail) = from.as_chunks::<WIDTH>();
            let (to_head, to_tail) = to.as_chunks::<WIDTH>();
            for ((w, from), to) in w_head.iter().zip(from_head).zip(to_head) {
                for l in 0..WIDTH {
                    lanes[l] += w[l] * soft(taps.between(from[l], to[l]));
                }
            }
            // The remainder is summed as the end of the last whole vector: runs are short, so it must be vectorised,
            // too.
            let last = (w.last_chunk::<WIDTH>(), from.last_chunk::<WIDTH>(), to.last_chunk::<WIDTH>());
            if let (false, (Some(w), Some(from), Some(to))) = (w_tail.is_empty(), last) {
                let counted = WIDTH - w_tail.len();
                for l in 0..WIDTH {
                    let w = if l < counted { 0.0 } else { w[l] };
                    lanes[l] += w * soft(taps.between(from[l], to[l]));
                }
            } else {
                for (((lane, w), from), to) in lanes.iter_mut().zip(w_tail).zip(from_tail).zip(to_tail) {
                    *lane += w * soft(taps.between(*from, *to));
                }
            }
            sum += total(&lanes);
        }
        sum
    }
}

multiversion! {
    /// `Σ w v (n·d)+`: the visible projected area along `d` (Wu et al. 2011, Eq. 10), with an f64 sum over blocks.
    pub fn projected_area(normals: [&[f32]; 3], weights: &[f32], v: &[f32], d: glam::Vec3) -> f64 {
        let mut sum = 0.0;
        for block in blocks(v.len()) {
            let mut lanes = [0.0_f32; LANES];
            for at in block {
                let [x, y, z] = [lane(normals[0], at), lane(normals[1], at), lane(normals[2], at)];
                let (w, v) = (lane(weights, at), lane(v, at));
                for l in 0..LANES {
                    lanes[l] += w[l] * v[l] * (x[l] * d.x + y[l] * d.y + z[l] * d.z).max(0.0);
                }
            }
            sum += total(&lanes);
        }
        sum
    }
}
