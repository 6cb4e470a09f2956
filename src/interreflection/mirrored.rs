//! Nodes of a polar grid under the mirror planes of a tile: one of each set of images is computed, the others follow.

use crate::math::directions::PolarGrid;

/// For each node the one that is computed in its place, and the reflection that takes the one to the other.
#[derive(Debug, Clone)]
pub(super) struct Images {
    /// Nodes that are computed.
    pub computed: Vec<usize>,
    /// Position in `computed`, and the reflection, of each node.
    place: Vec<(usize, Reflection)>,
    grid: PolarGrid,
}

/// Mirrored in a plane x = const, in a plane y = const.
type Reflection = [bool; 2];

impl Images {
    pub fn new(grid: PolarGrid, planes: [bool; 2]) -> Self {
        let group: Vec<Reflection> = [[false, false], [true, false], [false, true], [true, true]]
            .into_iter()
            .filter(|[x, y]| (!x || planes[0]) && (!y || planes[1]))
            .collect();
        let mut computed = Vec::new();
        let mut place = Vec::with_capacity(grid.len());
        for node in 0..grid.len() {
            let images = group.iter().map(|reflection| (image(grid, node, *reflection), *reflection));
            // Ties are broken by the order of the group: the identity comes first.
            let (lowest, reflection) =
                images.fold((usize::MAX, [false; 2]), |best, found| if found.0 < best.0 { found } else { best });
            if lowest == node {
                computed.push(node);
            }
            // Images of a node come after it.
            let at = computed.binary_search(&lowest).unwrap_or(0);
            place.push((at, reflection));
        }
        Self { computed, place, grid }
    }

    /// Where the value of `(row, column)` was computed: a position in `computed`, and a column.
    pub fn of(&self, row: usize, column: usize) -> (usize, usize) {
        let (at, reflection) = self.place[row];
        (at, image(self.grid, column, reflection))
    }
}

fn image(grid: PolarGrid, node: usize, [x, y]: Reflection) -> usize {
    let n = grid.azimuths;
    let (ring, mut azimuth) = (node / n, node % n);
    if x {
        azimuth = (n + n / 2 - azimuth) % n;
    }
    if y {
        azimuth = (n - azimuth) % n;
    }
    ring * n + azimuth
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn images_are_mirrored_directions_and_a_plane_halves_the_work() {
        let grid = PolarGrid::new(4, 12);
        for node in 0..grid.len() {
            let d = grid.direction(node);
            for (planes, mirrored) in
                [([true, false], Vec3::new(-d.x, d.y, d.z)), ([false, true], Vec3::new(d.x, -d.y, d.z))]
            {
                assert!((grid.direction(image(grid, node, planes)) - mirrored).length() < 1e-5);
            }
        }
        let counts = [[false; 2], [true, false], [true, true]].map(|planes| Images::new(grid, planes).computed.len());
        assert_eq!(counts, [60, 5 * 7, 5 * 4]);
    }

    #[test]
    fn a_function_with_the_symmetry_is_rebuilt_from_what_was_computed() {
        let grid = PolarGrid::new(3, 8);
        // Unchanged when both directions are mirrored together.
        let f = |o: Vec3, i: Vec3| o.x * i.x + 0.3 * o.y * i.y + 0.1 * o.z * i.z * i.z;
        for planes in [[false; 2], [true, false], [false, true], [true, true]] {
            let images = Images::new(grid, planes);
            for row in 0..grid.len() {
                for column in 0..grid.len() {
                    let (at, image) = images.of(row, column);
                    let made = f(grid.direction(images.computed[at]), grid.direction(image));
                    assert!((made - f(grid.direction(row), grid.direction(column))).abs() < 1e-5);
                }
            }
        }
    }
}
