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
#[path = "triangulate_tests.rs"]
mod tests;
