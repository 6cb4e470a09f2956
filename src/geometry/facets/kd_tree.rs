//! A kd-tree for nearest neighbours among points of the periodic tile.

use glam::{Vec2, Vec3};

/// A balanced tree over points. The median of each range splits it, along an axis that depends on the depth.
pub struct KdTree {
    /// Points and their indices, in tree order.
    nodes: Vec<(Vec3, u32)>,
    size: Vec2,
}

impl KdTree {
    /// Builds the tree. Points must lie in the tile; `size` is the period in x and y.
    pub fn new(points: &[Vec3], size: Vec2) -> Self {
        let mut nodes: Vec<(Vec3, u32)> = points.iter().copied().zip(0..).collect();
        arrange(&mut nodes, 0);
        Self { nodes, size }
    }

    /// Index of the point nearest to `query` modulo the tile. Of two points at the same distance, the lower index is
    /// returned.
    pub fn nearest(&self, query: Vec3) -> Option<u32> {
        self.nearest_by(query, |_| 0.0)
    }

    /// As [`KdTree::nearest`], with a penalty (at least 0) that is added to the squared distance of each point.
    pub fn nearest_by(&self, query: Vec3, penalty: impl Fn(u32) -> f32) -> Option<u32> {
        let mut best = (f32::INFINITY, u32::MAX);
        search(&self.nodes, query, 0, &penalty, &mut best);
        for step in [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1)] {
            let moved = query + (Vec2::new(step.0 as f32, step.1 as f32) * self.size).extend(0.0);
            // A copy of the query is at least as far from all points as from the tile, because points lie in the tile.
            let nearest_in_tile = moved.truncate().clamp(Vec2::ZERO, self.size);
            if moved.truncate().distance_squared(nearest_in_tile) <= best.0 {
                search(&self.nodes, moved, 0, &penalty, &mut best);
            }
        }
        (best.1 != u32::MAX).then_some(best.1)
    }
}

fn arrange(nodes: &mut [(Vec3, u32)], depth: usize) {
    if nodes.len() < 2 {
        return;
    }
    let axis = depth % 3;
    let middle = nodes.len() / 2;
    nodes.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let (lower, upper) = nodes.split_at_mut(middle);
    arrange(lower, depth + 1);
    arrange(&mut upper[1..], depth + 1);
}

fn search(nodes: &[(Vec3, u32)], query: Vec3, depth: usize, penalty: &impl Fn(u32) -> f32, best: &mut (f32, u32)) {
    let middle = nodes.len() / 2;
    let Some(&(point, number)) = nodes.get(middle) else {
        return;
    };
    let distance = point.distance_squared(query) + penalty(number);
    if distance < best.0 || (distance == best.0 && number < best.1) {
        *best = (distance, number);
    }
    let (lower, upper) = (&nodes[..middle], &nodes[middle + 1..]);
    let across = query[depth % 3] - point[depth % 3];
    let (near, far) = if across < 0.0 { (lower, upper) } else { (upper, lower) };
    search(near, query, depth + 1, penalty, best);
    if across * across <= best.0 {
        search(far, query, depth + 1, penalty, best);
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn the_nearest_point_is_that_of_a_search_through_all_copies() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let size = Vec2::new(1.0, 0.5);
        let mut point = || {
            Vec3::new(random.random::<f32>() * size.x, random.random::<f32>() * size.y, random.random::<f32>() * 0.3)
        };
        let points: Vec<Vec3> = (0..200).map(|_| point()).collect();
        let tree = KdTree::new(&points, size);
        for _ in 0..500 {
            let query = point();
            let periodic = |p: &Vec3| {
                let d = *p - query;
                let wrapped = d.truncate() - size * (d.truncate() / size).round();
                wrapped.extend(d.z).length_squared()
            };
            let brute = points.iter().map(periodic).fold(f32::INFINITY, f32::min);
            let found = tree.nearest(query).unwrap();
            assert!(periodic(&points[found as usize]) <= brute * (1.0 + 1e-4));
        }
        assert_eq!(KdTree::new(&[], size).nearest(Vec3::ZERO), None);
    }
}
