//! Interpolation in a table over direction pairs, for many pairs at once. Each pair reads four nodes of each of eight
//! rows.

use glam::Vec4;

use super::{LANES, cubic_weights, multiversion};

/// The axes of a table: `[θ_h][φ_h][φ_d][θ_d][vec4]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowGrid {
    /// Nodes of θ_h, both ends included.
    pub rings: usize,
    /// Nodes of φ_h over the full circle.
    pub azimuths: usize,
    /// Nodes of φ_d over its period.
    pub phi_d: usize,
    /// Stored nodes of θ_d: those of the grid, and one more at either end.
    pub stored: usize,
    /// Groups of four columns per node.
    pub vec4s: usize,
}

/// For each pair, the starts and weights of its eight rows, and the weights of the four nodes along them.
struct Taps {
    starts: [[u32; LANES]; 8],
    corners: [[f32; LANES]; 8],
    along: [[f32; LANES]; 4],
}

/// The two nodes around a coordinate on a periodic axis, and the coordinate's distance from the first.
#[inline(always)]
fn around(at: f32, count: i32) -> ([i32; 2], f32) {
    let low = (at as i32).clamp(0, count - 1);
    let next = low + 1;
    ([low, if next == count { 0 } else { next }], at - low as f32)
}

#[inline(always)]
fn taps(grid: RowGrid, coordinates: &[[f32; LANES]; 5], count: usize, cubic: bool) -> Taps {
    let mut taps = Taps { starts: [[0; LANES]; 8], corners: [[0.0; LANES]; 8], along: [[0.0; LANES]; 4] };
    let [rings, azimuths, phi_ds, stored, vec4s] =
        [grid.rings, grid.azimuths, grid.phi_d, grid.stored, grid.vec4s].map(|n| n as i32);
    let [on_rings, on_azimuths, on_phi_d, on_steps, _] = coordinates;
    for k in 0..count.min(LANES) {
        let [ring, azimuth, phi_d, step] = [on_rings[k], on_azimuths[k], on_phi_d[k], on_steps[k]];
        let low_ring = (ring as i32).clamp(0, rings - 2);
        let t = ring - low_ring as f32;
        let (azimuth, a) = around(azimuth, azimuths);
        let (phi_d, d) = around(phi_d, phi_ds);
        let low = (step as i32).clamp(0, stored - 4);
        let (rings, azimuth_weights, phi_d_weights) = ([1.0 - t, t], [1.0 - a, a], [1.0 - d, d]);
        for corner in 0..8 {
            let [p, q, r] = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
            let row = ((low_ring + p as i32) * azimuths + azimuth[q]) * phi_ds + phi_d[r];
            taps.starts[corner][k] = ((row * stored + low) * vec4s) as u32;
            taps.corners[corner][k] = rings[p] * azimuth_weights[q] * phi_d_weights[r];
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

/// One pair's sums of all columns, for a table with `F` groups of four columns.
#[inline(always)]
fn read<const F: usize>(values: &[Vec4], taps: &Taps, k: usize, out: &mut [Vec4]) {
    let mut nodes = [[[0.0_f32; 4]; F]; 4];
    for corner in 0..8 {
        let start = taps.starts[corner][k] as usize;
        let weight = taps.corners[corner][k];
        let row = &values[start..start + 4 * F];
        for node in 0..4 {
            for vec4 in 0..F {
                let value: &[f32; 4] = row[node * F + vec4].as_ref();
                for c in 0..4 {
                    nodes[node][vec4][c] += weight * value[c];
                }
            }
        }
    }
    for (vec4, out) in out[..F].iter_mut().enumerate() {
        let mut sums = [0.0_f32; 4];
        for (node, along) in nodes.iter().zip(&taps.along) {
            for c in 0..4 {
                sums[c] += along[k] * node[vec4][c];
            }
        }
        *out = Vec4::from_array(sums);
    }
}

/// One pair's sums for any number of columns.
#[inline(always)]
fn read_each(values: &[Vec4], vec4s: usize, taps: &Taps, k: usize, out: &mut [Vec4]) {
    for (vec4, out) in out[..vec4s].iter_mut().enumerate() {
        let mut sums = [0.0_f32; 4];
        for corner in 0..8 {
            let start = taps.starts[corner][k] as usize + vec4;
            let row = &values[start..start + 3 * vec4s + 1];
            for node in 0..4 {
                let weight = taps.corners[corner][k] * taps.along[node][k];
                let value: &[f32; 4] = row[node * vec4s].as_ref();
                for c in 0..4 {
                    sums[c] += weight * value[c];
                }
            }
        }
        *out = Vec4::from_array(sums);
    }
}

multiversion! {
    /// Interpolates all columns for `count` pairs, `[pair][vec4]`: linearly over half vectors and φ_d, and along θ_d
    /// with cubics (Catmull and Rom 1974) or linearly. `coordinates` come from
    /// [`HemispherePairGrid::coordinates`](crate::math::directions::HemispherePairGrid::coordinates), in steps.
    pub fn row_sums(
        values: &[Vec4],
        grid: RowGrid,
        coordinates: &[[f32; LANES]; 5],
        count: usize,
        cubic: bool,
        out: &mut [Vec4],
    ) {
        let taps = taps(grid, coordinates, count, cubic);
        for (k, out) in out.chunks_mut(grid.vec4s.max(1)).enumerate().take(count.min(LANES)) {
            match grid.vec4s {
                1 => read::<1>(values, &taps, k, out),
                2 => read::<2>(values, &taps, k, out),
                vec4s => read_each(values, vec4s, &taps, k, out),
            }
        }
    }
}
