//! A bounding-volume hierarchy over the object's triangles, for shadow rays.

use glam::Vec3;

use crate::render::ObjectMesh;

const BINS: usize = 16;
const LEAF_TRIANGLES: usize = 4;
/// Bounds the depth of the hierarchy and thereby the traversal's stack; nodes at this depth become leaves.
pub(crate) const MAX_DEPTH: usize = 60;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds3 {
    pub(crate) low: Vec3,
    pub(crate) high: Vec3,
}

impl Bounds3 {
    const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    fn with_point(self, point: Vec3) -> Self {
        Self { low: self.low.min(point), high: self.high.max(point) }
    }

    fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Returns whether a ray from `origin` meets the box, by the slab test.
    #[cfg(test)]
    fn is_entered(&self, origin: Vec3, inverse_direction: Vec3) -> bool {
        let (t_low, t_high) = ((self.low - origin) * inverse_direction, (self.high - origin) * inverse_direction);
        let enter = t_low.min(t_high).max_element().max(0.0);
        let leave = t_low.max(t_high).min_element();
        // Rounding must not miss flat boxes, and NaN (a ray in a slab's plane) counts as a hit.
        let misses = enter > leave * 1.000_001;
        !misses
    }

    pub(crate) fn half_area(&self) -> f32 {
        let d = (self.high - self.low).max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct BvhNode {
    pub(crate) bounds: Bounds3,
    /// The first triangle of a leaf, or the first child of an inner node; the second child follows the first.
    pub(crate) first: u32,
    /// Number of triangles of a leaf; 0 for an inner node.
    pub(crate) count: u32,
}

/// A triangle as a corner and two edges.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Blocker {
    pub(crate) corner: Vec3,
    pub(crate) edges: [Vec3; 2],
}

#[derive(Debug, Clone)]
pub struct Bvh {
    pub(crate) nodes: Vec<BvhNode>,
    pub(crate) blockers: Vec<Blocker>,
}

struct Item {
    bounds: Bounds3,
    center: Vec3,
    triangle: usize,
}

impl Bvh {
    /// Builds the hierarchy with the surface-area heuristic over 16 bins per node.
    pub fn new(mesh: &ObjectMesh) -> Self {
        let mut items: Vec<Item> = (0..mesh.triangles.len())
            .map(|triangle| {
                let bounds = mesh.corners(triangle).into_iter().fold(Bounds3::EMPTY, Bounds3::with_point);
                Item { bounds, center: 0.5 * bounds.low + 0.5 * bounds.high, triangle }
            })
            .collect();
        let mut nodes = vec![BvhNode { bounds: Bounds3::EMPTY, first: 0, count: 0 }];
        let mut open = vec![(0usize, 0usize, items.len(), 0usize)];
        while let Some((node, begin, end, depth)) = open.pop() {
            let slice = &mut items[begin..end];
            let bounds = slice.iter().fold(Bounds3::EMPTY, |sum, item| sum.with(item.bounds));
            nodes[node] = BvhNode { bounds, first: begin as u32, count: slice.len() as u32 };
            if slice.len() <= LEAF_TRIANGLES || depth >= MAX_DEPTH {
                continue;
            }
            let middle = begin + partition(slice);
            let child = nodes.len();
            nodes[node].first = child as u32;
            nodes[node].count = 0;
            nodes.extend([BvhNode { bounds, first: 0, count: 0 }; 2]);
            open.push((child, begin, middle, depth + 1));
            open.push((child + 1, middle, end, depth + 1));
        }
        let blocker = |item: &Item| {
            let [a, b, c] = mesh.corners(item.triangle);
            Blocker { corner: a, edges: [b - a, c - a] }
        };
        Self { nodes, blockers: items.iter().map(blocker).collect() }
    }

    /// Returns whether a ray from `origin` along the unit `direction` meets any triangle, from either side.
    #[cfg(test)]
    pub fn is_blocked(&self, origin: Vec3, direction: Vec3) -> bool {
        // Division by zero gives the infinities that the slab test needs.
        let inverse = direction.recip();
        let mut stack = [0u32; MAX_DEPTH + 4];
        let mut depth = usize::from(self.nodes[0].bounds.is_entered(origin, inverse));
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes[stack[depth] as usize];
            if node.count > 0 {
                let range = node.first as usize..(node.first + node.count) as usize;
                if self.blockers[range].iter().any(|blocker| blocker.is_hit(origin, direction)) {
                    return true;
                }
                continue;
            }
            for child in [node.first, node.first + 1] {
                if self.nodes[child as usize].bounds.is_entered(origin, inverse) {
                    stack[depth] = child;
                    depth += 1;
                }
            }
        }
        false
    }
}

impl Blocker {
    /// Intersects a ray with the triangle (Möller and Trumbore 1997).
    #[cfg(test)]
    fn is_hit(&self, origin: Vec3, direction: Vec3) -> bool {
        let p = direction.cross(self.edges[1]);
        let determinant = self.edges[0].dot(p);
        if determinant == 0.0 {
            return false;
        }
        let inverse = 1.0 / determinant;
        let offset = origin - self.corner;
        let u = offset.dot(p) * inverse;
        if !(0.0..=1.0).contains(&u) {
            return false;
        }
        let q = offset.cross(self.edges[0]);
        let v = direction.dot(q) * inverse;
        v >= 0.0 && u + v <= 1.0 && self.edges[1].dot(q) * inverse > 0.0
    }
}

/// Partitions the items at the cheapest cut and returns its index, which is strictly inside.
fn partition(items: &mut [Item]) -> usize {
    let centers = items.iter().fold(Bounds3::EMPTY, |sum, item| sum.with_point(item.center));
    let extent = centers.high - centers.low;
    let half = items.len() / 2;
    let Some((axis, cut)) = cheapest_cut(items, centers.low, extent) else {
        return half;
    };
    let bin_of = |item: &Item| bin(item.center[axis], centers.low[axis], extent[axis]);
    // A stable sort makes the order of triangles well defined.
    items.sort_by_key(|item| bin_of(item) >= cut);
    let middle = items.partition_point(|item| bin_of(item) < cut);
    if middle == 0 || middle == items.len() { half } else { middle }
}

fn bin(center: f32, low: f32, extent: f32) -> usize {
    (((center - low) / extent * BINS as f32) as usize).min(BINS - 1)
}

/// Returns the axis of the cheapest cut and the first bin of its right side.
fn cheapest_cut(items: &[Item], low: Vec3, extent: Vec3) -> Option<(usize, usize)> {
    let mut best = None;
    let mut best_cost = f32::INFINITY;
    for axis in (0..3).filter(|&axis| extent[axis] > 0.0) {
        let mut bins = [(Bounds3::EMPTY, 0u32); BINS];
        for item in items {
            let slot = &mut bins[bin(item.center[axis], low[axis], extent[axis])];
            *slot = (slot.0.with(item.bounds), slot.1 + 1);
        }
        let mut right_cost = [0.0; BINS];
        let mut sum = (Bounds3::EMPTY, 0);
        for k in (1..BINS).rev() {
            sum = (sum.0.with(bins[k].0), sum.1 + bins[k].1);
            right_cost[k] = sum.0.half_area() * sum.1 as f32;
        }
        let mut sum = (Bounds3::EMPTY, 0);
        for k in 1..BINS {
            sum = (sum.0.with(bins[k - 1].0), sum.1 + bins[k - 1].1);
            let cost = sum.0.half_area() * sum.1 as f32 + right_cost[k];
            if cost < best_cost && sum.1 > 0 && (sum.1 as usize) < items.len() {
                best_cost = cost;
                best = Some((axis, k));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::object;
    use rand::RngExt as _;
    use rand::SeedableRng as _;

    #[test]
    fn the_hierarchy_agrees_with_testing_every_triangle() {
        let object = crate::scene::Object { kind: "teapot".to_owned(), path: None };
        let mesh = object::build(&object, std::path::Path::new(".")).unwrap();
        let bvh = Bvh::new(&mesh);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut point =
            |scale: f32| Vec3::from_array(std::array::from_fn(|_| scale * (2.0 * rng.random::<f32>() - 1.0)));
        let mut blocked = 0;
        for k in 0..300 {
            let origin = point(2.0) + mesh.bounds.center;
            let direction = if k % 10 == 0 { Vec3::Y } else { point(1.0).try_normalize().unwrap() };
            let expected = bvh.blockers.iter().any(|blocker| blocker.is_hit(origin, direction));
            assert_eq!(bvh.is_blocked(origin, direction), expected);
            blocked += usize::from(expected);
        }
        assert!((20..280).contains(&blocked), "{blocked}");
    }

    #[test]
    fn identical_triangles_build_a_hierarchy() {
        let mesh = ObjectMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]; 100],
            ..ObjectMesh::default()
        };
        let bvh = Bvh::new(&mesh);
        assert!(
            bvh.is_blocked(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z) && !bvh.is_blocked(Vec3::new(0.2, 0.2, 1.0), Vec3::Z)
        );
    }
}
