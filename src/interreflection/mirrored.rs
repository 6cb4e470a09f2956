//! Nodes of a polar grid under the mirror planes of a tile. One of each set of mirror images is computed; the others
//! follow.

use crate::math::directions::ReducedGrid;

/// Largest number of reflections that map a tile to itself, with the identity.
pub(super) const MOST_IMAGES: usize = 4;

/// For each node, the node that is computed in its place and the reflection that maps one to the other.
#[derive(Debug, Clone)]
pub(super) struct MirroredNodes {
    /// Nodes that are computed.
    pub computed: Vec<usize>,
    /// Position in `computed`, and the index of the reflection, of each node.
    originals: Vec<(usize, usize)>,
    /// The image of each node under each reflection, the identity first.
    pub images: Vec<Vec<usize>>,
}

/// Reflections in a plane x = const and in a plane y = const.
type Reflection = [bool; 2];

impl MirroredNodes {
    pub fn new(grid: ReducedGrid, planes: [bool; 2]) -> Self {
        let group: Vec<Reflection> = [[false, false], [true, false], [false, true], [true, true]]
            .into_iter()
            .filter(|[x, y]| (!x || planes[0]) && (!y || planes[1]))
            .collect();
        let images: Vec<Vec<usize>> = group
            .iter()
            .map(|reflection| (0..grid.len()).map(|node| image(grid, node, *reflection)).collect())
            .collect();
        let mut computed = Vec::new();
        let mut originals = Vec::with_capacity(grid.len());
        for node in 0..grid.len() {
            // The order of the group breaks ties; the identity is its first element.
            let of_node = images.iter().map(|images| images[node]).enumerate();
            let (reflection, lowest) = of_node.fold((0, usize::MAX), |best, of| if of.1 < best.1 { of } else { best });
            if lowest == node {
                computed.push(node);
            }
            // `lowest` is at most `node`, so it was visited and `computed` contains it.
            let at = computed.binary_search(&lowest).unwrap_or(0);
            originals.push((at, reflection));
        }
        Self { computed, originals, images }
    }

    /// The number of nodes that each node of `computed` stands for.
    pub fn image_counts(&self) -> Vec<f32> {
        let mut counts = vec![0.0; self.computed.len()];
        self.originals.iter().for_each(|(at, _)| counts[*at] += 1.0);
        counts
    }

    /// The entry that has the value of `(row, column)`: a position in `computed`, and a column.
    pub fn original_of(&self, row: usize, column: usize) -> (usize, usize) {
        let (at, reflection) = self.originals[row];
        (at, self.images[reflection][column])
    }
}

/// One of several images, drawn by a number in `[0, 1)` with a probability in proportion to the root of its power, and its
/// weight: the inverse of the probability over the number of images. `None` if no image has a power.
pub(super) fn draw_image(powers: &[f64], number: f64) -> Option<(usize, f32)> {
    let roots = powers.iter().map(|power| power.sqrt());
    let total: f64 = roots.clone().sum();
    let mut left = number * total;
    let mut drawn = None;
    for (image, root) in roots.enumerate().filter(|(_, root)| *root > 0.0) {
        drawn = Some((image, (total / (root * powers.len() as f64)) as f32));
        if left < root {
            break;
        }
        left -= root;
    }
    drawn
}

/// The mirror image of a node.
fn image(grid: ReducedGrid, node: usize, [x, y]: Reflection) -> usize {
    let (ring, mut azimuth) = grid.ring_and_azimuth(node);
    let n = grid.azimuths_of(ring);
    if x {
        azimuth = (n + n / 2 - azimuth) % n;
    }
    if y {
        azimuth = (n - azimuth) % n;
    }
    grid.first_node(ring) + azimuth
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn images_are_mirrored_directions_and_a_plane_halves_the_work() {
        let grid = ReducedGrid::new(4);
        for node in 0..grid.len() {
            let d = grid.direction(node);
            for (planes, mirrored) in
                [([true, false], Vec3::new(-d.x, d.y, d.z)), ([false, true], Vec3::new(d.x, -d.y, d.z))]
            {
                assert!((grid.direction(image(grid, node, planes)) - mirrored).length() < 1e-5);
            }
        }
        let counts =
            [[false; 2], [true, false], [true, true]].map(|planes| MirroredNodes::new(grid, planes).computed.len());
        assert_eq!(counts, [88, 49, 27]);
    }

    #[test]
    fn drawn_images_count_each_image_with_a_power_once_in_the_mean() {
        const NUMBERS: usize = 4000;
        let powers = [4.0, 0.0, 1.0, 0.25];
        let mut means = [0.0; 4];
        for number in 0..NUMBERS {
            let (image, weight) = draw_image(&powers, (number as f64 + 0.5) / NUMBERS as f64).unwrap();
            means[image] += 4.0 * f64::from(weight) / NUMBERS as f64;
        }
        for (mean, expected) in means.into_iter().zip([1.0, 0.0, 1.0, 1.0]) {
            assert!((mean - expected).abs() < 2e-3, "{means:?}");
        }
        assert_eq!(draw_image(&[1.0, 0.0], 1.0).unwrap().0, 0, "an image without a power is never drawn");
        assert_eq!(draw_image(&[0.0; 4], 0.5), None);
        assert_eq!(draw_image(&[9.0], 0.7), Some((0, 1.0)));
    }

    #[test]
    fn a_symmetric_function_is_rebuilt_from_its_computed_values() {
        let grid = ReducedGrid::new(3);
        // Invariant when both directions are mirrored together.
        let f = |o: Vec3, i: Vec3| o.x * i.x + 0.3 * o.y * i.y + 0.1 * o.z * i.z * i.z;
        for planes in [[false; 2], [true, false], [false, true], [true, true]] {
            let mirrored = MirroredNodes::new(grid, planes);
            for row in 0..grid.len() {
                for column in 0..grid.len() {
                    let (at, image) = mirrored.original_of(row, column);
                    let rebuilt = f(grid.direction(mirrored.computed[at]), grid.direction(image));
                    assert!((rebuilt - f(grid.direction(row), grid.direction(column))).abs() < 1e-5);
                }
            }
        }
    }
}
