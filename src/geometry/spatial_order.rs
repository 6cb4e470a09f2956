//! An order of triangles in which neighbours in the list are neighbours on the tile.

use glam::Vec2;

use super::TileMesh;
use super::facets::wrap;

/// Triangle numbers along a Hilbert curve through the tile.
pub fn spatial_order(mesh: &TileMesh) -> Vec<u32> {
    let key = |triangle: u32| {
        let [a, b, c] = mesh.corners(triangle as usize);
        hilbert_index(wrap((a + b + c) / 3.0, mesh.size).truncate() / mesh.size)
    };
    // The triangle's number decides between equals: the order is the same everywhere.
    let mut keyed: Vec<(u32, u32)> = (0..mesh.triangles.len() as u32)
        .map(|triangle| (key(triangle), triangle))
        .collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, triangle)| triangle).collect()
}

/// Position along a Hilbert curve of 2^24 cells of a point of the unit square.
fn hilbert_index(point: Vec2) -> u32 {
    const BITS: u32 = 12;
    let side = 1u32 << BITS;
    let cell = |x: f32| ((x * side as f32) as u32).min(side - 1);
    let (mut x, mut y) = (cell(point.x), cell(point.y));
    let mut index = 0;
    let mut s = side / 2;
    while s > 0 {
        let (right, upper) = (u32::from(x & s > 0), u32::from(y & s > 0));
        index += s * s * ((3 * right) ^ upper);
        if upper == 0 {
            if right == 1 {
                (x, y) = (side - 1 - x, side - 1 - y);
            }
            (x, y) = (y, x);
        }
        s /= 2;
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_along_the_curve_are_steps_to_a_neighbouring_cell() {
        // On the 8 x 8 cells that the curve's first 64th parts fill.
        let mut cells: Vec<(u32, (i32, i32))> = (0..64)
            .map(|k| (k % 8, k / 8))
            .map(|(x, y)| {
                (
                    hilbert_index(Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / 8.0),
                    (x, y),
                )
            })
            .collect();
        cells.sort_unstable();
        for pair in cells.windows(2) {
            let ((_, a), (_, b)) = (pair[0], pair[1]);
            assert_eq!((a.0 - b.0).abs() + (a.1 - b.1).abs(), 1, "{a:?} {b:?}");
        }
    }
}
