//! Readings of a table over pairs of directions: many pairs at once, of eight rows four nodes each.

use glam::Vec4;

use super::{LANES, cubic_weights, multiversion};

/// The axes of a table: `[θ_h][φ_h][φ_d][θ_d][four]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowGrid {
    /// θ_h, both ends included.
    pub rings: usize,
    /// φ_h, all round.
    pub azimuths: usize,
    /// φ_d, all round.
    pub turn: usize,
    /// θ_d, with one more at either end than it has.
    pub stored: usize,
    /// F32x8Array of columns a node.
    pub fours: usize,
}

/// Of each pair, where its eight rows start and what they weigh, and what the four nodes along them weigh.
struct Taps {
    starts: [[u32; LANES]; 8],
    corners: [[f32; LANES]; 8],
    along: [[f32; LANES]; 4],
}

/// The two nodes around a place on an axis that goes all round, and how far it is from the first.
#[inline(always)]
fn around(at: f32, count: i32) -> ([i32; 2], f32) {
    let low = (at as i32).clamp(0, count - 1);
    let next = low + 1;
    ([low, if next == count { 0 } else { next }], at - low as f32)
}

#[inline(always)]
fn taps(grid: RowGrid, places: &[[f32; LANES]; 5], count: usize, cubic: bool) -> Taps {
    let mut taps = Taps { starts: [[0; LANES]; 8], corners: [[0.0; LANES]; 8], along: [[0.0; LANES]; 4] };
    let [rings, azimuths, turns, stored, fours] =
        [grid.rings, grid.azimuths, grid.turn, grid.stored, grid.fours].map(|n| n as i32);
    let [on_rings, on_azimuths, on_turns, on_steps, _] = places;
    for k in 0..count.min(LANES) {
        let [ring, azimuth, turn, step] = [on_rings[k], on_azimuths[k], on_turns[k], on_steps[k]];
        let low_ring = (ring as i32).clamp(0, rings - 2);
        let t = ring - low_ring as f32;
        let (azimuth, a) = around(azimuth, azimuths);
        let (turn, d) = around(turn, turns);
        let low = (step as i32).clamp(0, stored - 4);
        let (rings, azimuth_weights, turn_weights) = ([1.0 - t, t], [1.0 - a, a], [1.0 - d, d]);
        for corner in 0..8 {
            let [p, q, r] = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
            let row = ((low_ring + p as i32) * azimuths + azimuth[q]) * turns + turn[r];
            taps.starts[corner][k] = ((row * stored + low) * fours) as u32;
            taps.corners[corner][k] = rings[p] * azimuth_weights[q] * turn_weights[r];
        }
        let t = step - low as f32;
        let curve = cubic_weights(t);
        let line = [0.0, 1.0 - t, t, 0.0];
        for node in 0..4 {
            taps.along[node][k] = if cubic { curve[node] } else { line[node] };
        }
    }
    taps
}

/// One pair's sums of `F` fours of columns, which are all there are.
#[inline(always)]
fn read<const F: usize>(values: &[Vec4], taps: &Taps, k: usize, out: &mut [Vec4]) {
    let mut nodes = [[[0.0_f32; 4]; F]; 4];
    for corner in 0..8 {
        let start = taps.starts[corner][k] as usize;
        let weight = taps.corners[corner][k];
        let row = &values[start..start + 4 * F];
        for node in 0..4 {
            for four in 0..F {
                let value: &[f32; 4] = row[node * F + four].as_ref();
                for c in 0..4 {
                    nodes[node][four][c] += weight * value[c];
                }
            }
        }
    }
    for (four, out) in out[..F].iter_mut().enumerate() {
        let mut sums = [0.0_f32; 4];
        for (node, along) in nodes.iter().zip(&taps.along) {
            for c in 0..4 {
                sums[c] += along[k] * node[four][c];
            }
        }
        *out = Vec4::from_array(sums);
    }
}

/// One pair's sums of any number of fours.
#[inline(always)]
fn read_each(values: &[Vec4], fours: usize, taps: &Taps, k: usize, out: &mut [Vec4]) {
    for (four, out) in out[..fours].iter_mut().enumerate() {
        let mut sums = [0.0_f32; 4];
        for corner in 0..8 {
            let start = taps.starts[corner][k] as usize + four;
            let row = &values[start..start + 3 * fours + 1];
            for node in 0..4 {
                let weight = taps.corners[corner][k] * taps.along[node][k];
                let value: &[f32; 4] = row[node * fours].as_ref();
                for c in 0..4 {
                    sums[c] += weight * value[c];
                }
            }
        }
        *out = Vec4::from_array(sums);
    }
}

multiversion! {
    /// All columns of `count` pairs, `[pair][four]`: linear between half vectors and in φ_d; along θ_d cubic (Catmull and Rom
    /// 1974) or linear. `places` are those of [`HemispherePairGrid::places`](crate::math::directions::HemispherePairGrid::places), in steps.
    pub fn row_sums(values: &[Vec4], grid: RowGrid, places: &[[f32; LANES]; 5], count: usize, cubic: bool, out: &mut [Vec4]) {
        let taps = taps(grid, places, count, cubic);
        for (k, out) in out.chunks_mut(grid.fours.max(1)).enumerate().take(count.min(LANES)) {
            match grid.fours {
                1 => read::<1>(values, &taps, k, out),
                2 => read::<2>(values, &taps, k, out),
                fours => read_each(values, fours, &taps, k, out),
            }
        }
    }
}
