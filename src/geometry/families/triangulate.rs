//! Triangulation of polygons by ear clipping, in O(n log n) for usual outlines of n corners.

use std::collections::BTreeSet;

use glam::{DVec2, Vec3};

/// Triangulates a polygon by ear clipping. The first ear after the first corner is clipped, so that convex polygons
/// become the fan about their first corner. If no ear is left (folded or degenerate outlines), the second corner is cut
/// off.
pub(super) fn triangulate(outline: &[Vec3]) -> Vec<[usize; 3]> {
    let count = outline.len();
    if count == 3 {
        return vec![[0, 1, 2]];
    }
    let mut polygon = Polygon::new(outline);
    let mut ears: BTreeSet<usize> = (0..count).filter(|&corner| polygon.is_ear(corner)).collect();
    let mut triangles = Vec::with_capacity(count - 2);
    let mut first = 0;
    while triangles.len() + 3 < count {
        let after_first = ears.iter().copied().find(|&corner| corner != first);
        let ear = after_first.or_else(|| ears.first().copied()).unwrap_or(polygon.next[first]);
        let [before, after] = [polygon.previous[ear], polygon.next[ear]];
        triangles.push([before, ear, after]);
        polygon.remove(ear);
        ears.remove(&ear);
        if ear == first {
            first = after;
        }
        // Clipping a corner of a simple polygon does not change which of the other corners are ears.
        for corner in [before, after] {
            if polygon.is_ear(corner) {
                ears.insert(corner);
            } else {
                ears.remove(&corner);
            }
        }
    }
    let second = polygon.next[first];
    triangles.push([first, second, polygon.next[second]]);
    triangles
}

/// The corners that remain, projected along the axis that is nearest to the polygon's normal.
struct Polygon {
    corners: Vec<DVec2>,
    previous: Vec<usize>,
    next: Vec<usize>,
    remaining: CornerTree,
}

impl Polygon {
    fn new(outline: &[Vec3]) -> Self {
        let count = outline.len();
        let at = |corner: usize| outline[corner % count].as_dvec3();
        // Newell's normal is twice the area vector of a closed outline.
        let normal = (0..count).map(|k| (at(k) - at(0)).cross(at(k + 1) - at(0))).sum::<glam::DVec3>();
        let axis = normal.abs().max_position();
        // Differences and products of f32 coordinates are exact or nearly so in f64. A polygon without area has no ears.
        let project = |corner: usize| {
            let [u, v] = [at(corner)[(axis + 1) % 3], at(corner)[(axis + 2) % 3]];
            DVec2::new(u * normal[axis].signum(), v) * f64::from(u8::from(normal[axis] != 0.0))
        };
        let corners: Vec<DVec2> = (0..count).map(project).collect();
        let remaining = CornerTree::new(&corners);
        let previous = (0..count).map(|k| (k + count - 1) % count).collect();
        Self { corners, previous, next: (0..count).map(|k| (k + 1) % count).collect(), remaining }
    }

    /// Returns true if the corner is convex and its triangle contains no other corner.
    fn is_ear(&self, corner: usize) -> bool {
        let ear = [self.previous[corner], corner, self.next[corner]];
        let [a, b, c] = ear.map(|k| self.corners[k]);
        (b - a).perp_dot(c - a) > 0.0 && !self.remaining.has_corner_in([a, b, c], ear)
    }

    fn remove(&mut self, corner: usize) {
        let [before, after] = [self.previous[corner], self.next[corner]];
        (self.next[before], self.previous[after]) = (after, before);
        self.remaining.remove(corner);
    }
}

/// A kd-tree over corners. The node of a range of `order` is the range's middle.
struct CornerTree {
    order: Vec<usize>,
    /// The place of each corner in `order`.
    places: Vec<usize>,
    nodes: Vec<Node>,
}

#[derive(Clone, Copy)]
struct Node {
    corner: DVec2,
    /// Bounds of all corners of the range.
    low: DVec2,
    high: DVec2,
    /// Number of corners of the range that remain.
    remaining: usize,
    is_removed: bool,
}

impl CornerTree {
    fn new(corners: &[DVec2]) -> Self {
        let count = corners.len();
        let empty = Node { corner: DVec2::ZERO, low: DVec2::ZERO, high: DVec2::ZERO, remaining: 0, is_removed: false };
        let (mut order, mut nodes): (Vec<usize>, _) = ((0..count).collect(), vec![empty; count]);
        arrange(corners, &mut order, &mut nodes);
        let mut places = vec![0; count];
        order.iter().enumerate().for_each(|(place, corner)| places[*corner] = place);
        Self { order, places, nodes }
    }

    fn remove(&mut self, corner: usize) {
        let (place, mut range) = (self.places[corner], 0..self.nodes.len());
        loop {
            let middle = range.start + range.len() / 2;
            self.nodes[middle].remaining -= 1;
            match place.cmp(&middle) {
                std::cmp::Ordering::Less => range.end = middle,
                std::cmp::Ordering::Equal => break,
                std::cmp::Ordering::Greater => range.start = middle + 1,
            }
        }
        self.nodes[place].is_removed = true;
    }

    /// Returns true if a counterclockwise triangle or its boundary contains a corner besides its own.
    fn has_corner_in(&self, triangle: [DVec2; 3], own: [usize; 3]) -> bool {
        let [a, b, c] = triangle;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let edges = [(a, b - a), (b, c - b), (c, a - c)];
        let mut stack = vec![(0, self.nodes.len())];
        while let Some((start, end)) = stack.pop() {
            if start == end {
                continue;
            }
            let middle = start + (end - start) / 2;
            let node = &self.nodes[middle];
            // The corner of the bounds that lies farthest to the left of an edge.
            let farthest =
                |edge: DVec2| DVec2::select(DVec2::new(-edge.y, edge.x).cmpge(DVec2::ZERO), node.high, node.low);
            let is_apart = node.remaining == 0
                || node.low.cmpgt(high).any()
                || node.high.cmplt(low).any()
                || edges.iter().any(|&(from, edge)| edge.perp_dot(farthest(edge) - from) < 0.0);
            if is_apart {
                continue;
            }
            let is_inside = || edges.iter().all(|&(from, edge)| edge.perp_dot(node.corner - from) >= 0.0);
            if !node.is_removed && !own.contains(&self.order[middle]) && is_inside() {
                return true;
            }
            stack.push((start, middle));
            stack.push((middle + 1, end));
        }
        false
    }
}

/// Sorts a range of corners as a kd-tree that splits the longer side of the bounds.
fn arrange(corners: &[DVec2], order: &mut [usize], nodes: &mut [Node]) {
    let Some(first) = order.first() else { return };
    let (mut low, mut high) = (corners[*first], corners[*first]);
    for corner in order.iter().map(|k| corners[*k]) {
        (low, high) = (low.min(corner), high.max(corner));
    }
    let axis = usize::from((high - low).y > (high - low).x);
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |a, b| corners[*a][axis].total_cmp(&corners[*b][axis]));
    nodes[middle] = Node { corner: corners[order[middle]], low, high, remaining: order.len(), is_removed: false };
    arrange(corners, &mut order[..middle], &mut nodes[..middle]);
    arrange(corners, &mut order[middle + 1..], &mut nodes[middle + 1..]);
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;
    use std::time::Instant;

    use glam::Vec2;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Ear clipping that tests every corner anew at each step.
    fn brute_force(outline: &[Vec3]) -> Vec<[usize; 3]> {
        let cross = |a: usize, b: usize, c: usize| {
            let [a, b, c] = [a, b, c].map(|k| outline[k].truncate().as_dvec2());
            (b - a).perp_dot(c - a)
        };
        let mut remaining: Vec<usize> = (0..outline.len()).collect();
        let mut triangles = Vec::new();
        while remaining.len() > 3 {
            let size = remaining.len();
            let is_ear = |k: &usize| {
                let [a, b, c] = [remaining[(k + size - 1) % size], remaining[*k], remaining[(k + 1) % size]];
                let contains = |p: usize| cross(a, b, p) >= 0.0 && cross(b, c, p) >= 0.0 && cross(c, a, p) >= 0.0;
                cross(a, b, c) > 0.0 && !remaining.iter().any(|&p| p != a && p != b && p != c && contains(p))
            };
            let ear = (1..size).chain([0]).find(is_ear).unwrap_or(1);
            triangles.push([remaining[(ear + size - 1) % size], remaining[ear], remaining[(ear + 1) % size]]);
            remaining.remove(ear);
        }
        triangles.push([remaining[0], remaining[1], remaining[2]]);
        triangles
    }

    /// A polygon around the origin with radii from `radius`.
    fn around(count: usize, mut radius: impl FnMut(usize) -> f32) -> Vec<Vec3> {
        (0..count).map(|k| (radius(k) * Vec2::from_angle(TAU * k as f32 / count as f32)).extend(0.0)).collect()
    }

    /// Asserts that all triangles are counterclockwise and together have the area of the outline.
    fn assert_covers(outline: &[Vec3], triangles: &[[usize; 3]]) {
        let at = |k: usize| outline[k % outline.len()].truncate().as_dvec2();
        let areas = triangles.iter().map(|&[a, b, c]| (at(b) - at(a)).perp_dot(at(c) - at(a)));
        let expected: f64 = (0..outline.len()).map(|k| at(k).perp_dot(at(k + 1))).sum();
        assert_eq!(triangles.len(), outline.len() - 2);
        assert!(areas.clone().all(|area| area > 0.0));
        assert!((areas.sum::<f64>() / expected - 1.0).abs() < 1e-9);
    }

    #[test]
    fn simple_polygons_have_the_triangles_of_a_search_without_a_tree() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for count in 4..60 {
            let outline = around(count, |_| 0.1 + random.random::<f32>());
            let triangles = triangulate(&outline);
            assert_eq!(triangles, brute_force(&outline), "{count} corners");
            assert_covers(&outline, &triangles);
        }
    }

    #[test]
    fn folded_polygons_and_those_without_area_give_triangles_of_all_corners() {
        let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.5, 2.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
        for outline in [bow, [Vec3::ONE; 5], [0.0, 3.0, 1.0, 4.0, 2.0].map(Vec3::splat)] {
            let triangles = triangulate(&outline);
            assert_eq!(triangles.len(), 3);
            assert!((0..5).all(|corner| triangles.iter().flatten().any(|k| *k == corner)), "{triangles:?}");
        }
    }

    #[test]
    fn a_polygon_in_any_plane_keeps_its_area_vector() {
        let outline = around(40, |k| if k % 2 == 0 { 1.0 } else { 0.4 });
        for normal in [Vec3::X, -Vec3::Y, Vec3::NEG_Z, Vec3::new(0.3, -0.5, 0.2)] {
            let turn = glam::Quat::from_rotation_arc(Vec3::Z, normal.normalize_or_zero());
            let turned: Vec<Vec3> = outline.iter().map(|&corner| turn * corner).collect();
            let areas = triangulate(&turned)
                .into_iter()
                .map(|[a, b, c]| (turned[b] - turned[a]).cross(turned[c] - turned[a]).dot(turn * Vec3::Z));
            assert!(areas.clone().all(|area| area > 0.0), "{normal}");
            let expected = (0..40).map(|k| outline[k].cross(outline[(k + 1) % 40]).z).sum::<f32>();
            assert!((areas.sum::<f32>() / expected - 1.0).abs() < 1e-5, "{normal}");
        }
    }

    /// A circle, a star, random radii, a comb, a spiral and a saw under a straight edge.
    #[test]
    fn a_hundred_thousand_corners_take_seconds_at_most() {
        const COUNT: usize = 100_000;
        // One outline takes 0.1 to 0.3 s. The bound leaves room for a busy machine; n² steps take longer.
        const MAX_SECONDS: f64 = 10.0;
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let comb = |k: usize| {
            let x = k as f32;
            if k + 1 == COUNT { Vec3::new(x, -9.0, 0.0) } else { Vec3::new(x, (k % 2) as f32 * 1e5, 0.0) }
        };
        let spiral = |k: usize| {
            let (turn, radius) = if k < COUNT / 2 { (k, 0.0) } else { (COUNT - 1 - k, 0.4) };
            let angle = 200.0 * turn as f32 / COUNT as f32 * TAU;
            ((1.0 + angle / TAU + radius) * Vec2::from_angle(angle)).extend(0.0)
        };
        let outlines = [
            around(COUNT, |_| 1000.0),
            around(COUNT, |k| if k % 2 == 0 { 1000.0 } else { 500.0 }),
            around(COUNT, |_| 1000.0 + random.random::<f32>()),
            (0..COUNT).map(|k| comb(COUNT - 1 - k)).collect(),
            (0..COUNT).map(spiral).rev().collect::<Vec<_>>(),
            (0..COUNT).map(|_| Vec3::new(random.random(), random.random(), 0.0)).collect(),
        ];
        for (k, outline) in outlines.iter().enumerate() {
            let start = Instant::now();
            assert_eq!(triangulate(outline).len(), COUNT - 2);
            let seconds = start.elapsed().as_secs_f64();
            eprintln!("outline {k}: {seconds:.2} s");
            assert!(seconds < MAX_SECONDS, "outline {k}: {seconds} s");
        }
    }
}
