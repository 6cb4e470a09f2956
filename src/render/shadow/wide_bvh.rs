//! The hierarchy that the CPU traverses: each step tests four boxes or four triangles at once.

use glam::{Vec3, Vec4};

use super::bvh::{Blocker, Bvh, MAX_DEPTH};

/// Boxes or triangles per test.
const WIDTH: usize = 4;

/// Up to four boxes, each with its child.
#[derive(Debug, Clone)]
struct WideNode {
    low: [Vec4; 3],
    high: [Vec4; 3],
    /// Index of the child node of a box, or of a leaf's first packet of triangles.
    first: [u32; WIDTH],
    /// Number of packets of a leaf; 0 for an inner node.
    packets: [u32; WIDTH],
    /// One bit per used box.
    used: u32,
}

/// Four triangles as corners and edges. Missing triangles have edges of length 0, which no ray hits.
#[derive(Debug, Clone, Copy)]
struct TrianglePacket {
    corner: [Vec4; 3],
    edges: [[Vec4; 3]; 2],
}

/// A hierarchy with four children per node, built from a [`Bvh`] of the same triangles; its results equal those of the
/// [`Bvh`].
#[derive(Debug, Clone)]
pub(crate) struct WideBvh {
    nodes: Vec<WideNode>,
    packets: Vec<TrianglePacket>,
}

/// Bounds the components of directions from below, so that their inverse is finite. Otherwise a product of zero and
/// infinity could make a ray miss a box.
const MIN_COMPONENT: f32 = 1e-20;

impl WideBvh {
    pub(crate) fn new(bvh: &Bvh) -> Self {
        let mut wide = Self { nodes: Vec::new(), packets: Vec::new() };
        if !bvh.blockers.is_empty() {
            wide.add(bvh, 0);
        }
        wide
    }

    /// Adds a node with its descendants and returns its index.
    fn add(&mut self, bvh: &Bvh, node: u32) -> u32 {
        let is_leaf = |node: u32| bvh.nodes[node as usize].count > 0;
        // The largest inner node is replaced by its children until there are four nodes.
        let mut children = vec![node];
        while children.len() < WIDTH {
            let area = |node: u32| bvh.nodes[node as usize].bounds.half_area();
            let largest = (0..children.len())
                .filter(|&k| !is_leaf(children[k]))
                .max_by(|&a, &b| area(children[a]).total_cmp(&area(children[b])));
            let Some(largest) = largest else { break };
            let first = bvh.nodes[children[largest] as usize].first;
            children[largest] = first;
            children.push(first + 1);
        }
        let index = self.nodes.len();
        let bounds: [_; WIDTH] =
            std::array::from_fn(|k| bvh.nodes[children[k.min(children.len() - 1)] as usize].bounds);
        let four = |value_of: &dyn Fn(usize) -> f32| Vec4::from_array(std::array::from_fn(value_of));
        self.nodes.push(WideNode {
            low: std::array::from_fn(|axis| four(&|k| bounds[k].low[axis])),
            high: std::array::from_fn(|axis| four(&|k| bounds[k].high[axis])),
            first: [0; WIDTH],
            packets: [0; WIDTH],
            used: (1 << children.len()) - 1,
        });
        for (k, child) in children.into_iter().enumerate() {
            let (first, packets) = if is_leaf(child) { self.add_leaf(bvh, child) } else { (self.add(bvh, child), 0) };
            self.nodes[index].first[k] = first;
            self.nodes[index].packets[k] = packets;
        }
        index as u32
    }

    fn add_leaf(&mut self, bvh: &Bvh, node: u32) -> (u32, u32) {
        let first = self.packets.len();
        let node = &bvh.nodes[node as usize];
        let blockers = &bvh.blockers[node.first as usize..(node.first + node.count) as usize];
        self.packets.extend(blockers.chunks(WIDTH).map(TrianglePacket::new));
        (first as u32, (self.packets.len() - first) as u32)
    }

    /// Returns whether a ray from `origin` along the unit `direction` meets any triangle, from either side. The packet
    /// that blocked the previous ray is tested first, because it often blocks neighbouring rays, too. `last` stores its
    /// index; the result does not depend on `last`.
    pub(crate) fn is_blocked(&self, origin: Vec3, direction: Vec3, last: &mut u32) -> bool {
        if self.packets.get(*last as usize).is_some_and(|packet| packet.is_hit(origin, direction)) {
            return true;
        }
        let axes = [origin.x, origin.y, origin.z].map(Vec4::splat);
        let inverse =
            direction.to_array().map(|d| Vec4::splat(1.0 / if d.abs() < MIN_COMPONENT { MIN_COMPONENT } else { d }));
        let mut stack = [0_u32; (WIDTH - 1) * (MAX_DEPTH + 4)];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes[stack[depth] as usize];
            let (mut enter, mut leave) = (Vec4::ZERO, Vec4::splat(f32::MAX));
            for axis in 0..3 {
                let (a, b) =
                    ((node.low[axis] - axes[axis]) * inverse[axis], (node.high[axis] - axes[axis]) * inverse[axis]);
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
            // Rounding must not miss flat boxes.
            let mut entered = node.used & !enter.cmpgt(leave * 1.000_001).bitmask();
            while entered != 0 {
                let k = entered.trailing_zeros() as usize;
                entered &= entered - 1;
                if node.packets[k] == 0 {
                    stack[depth] = node.first[k];
                    depth += 1;
                    continue;
                }
                for packet in node.first[k]..node.first[k] + node.packets[k] {
                    if self.packets[packet as usize].is_hit(origin, direction) {
                        *last = packet;
                        return true;
                    }
                }
            }
        }
        false
    }
}

impl TrianglePacket {
    fn new(blockers: &[Blocker]) -> Self {
        let pack = |vector_of: &dyn Fn(&Blocker) -> Vec3| {
            [0, 1, 2].map(|axis| {
                let component = |k: usize| blockers.get(k).map_or(0.0, |blocker| vector_of(blocker)[axis]);
                Vec4::from_array(std::array::from_fn(component))
            })
        };
        Self {
            corner: pack(&|blocker| blocker.corner),
            edges: [pack(&|blocker| blocker.edges[0]), pack(&|blocker| blocker.edges[1])],
        }
    }

    /// Intersects a ray with the triangles (Möller and Trumbore 1997), with the same operations as [`Blocker::is_hit`].
    fn is_hit(&self, origin: Vec3, direction: Vec3) -> bool {
        let direction = direction.to_array().map(Vec4::splat);
        let p = cross(direction, self.edges[1]);
        let determinant = dot(self.edges[0], p);
        let inverse = determinant.recip();
        let offset: [Vec4; 3] = std::array::from_fn(|axis| Vec4::splat(origin[axis]) - self.corner[axis]);
        let u = dot(offset, p) * inverse;
        let q = cross(offset, self.edges[0]);
        let v = dot(direction, q) * inverse;
        let t = dot(self.edges[1], q) * inverse;
        let inside = u.cmpge(Vec4::ZERO) & v.cmpge(Vec4::ZERO) & (u + v).cmple(Vec4::ONE);
        (inside & t.cmpgt(Vec4::ZERO) & determinant.cmpne(Vec4::ZERO)).any()
    }
}

fn cross(a: [Vec4; 3], b: [Vec4; 3]) -> [Vec4; 3] {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

fn dot(a: [Vec4; 3], b: [Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rand::{RngExt as _, SeedableRng as _};

    use super::*;
    use crate::render::{ObjectMesh, object};
    use crate::scene;

    /// Compares both hierarchies over rays near the object, some along the axes, with and without a previous packet.
    /// Returns the number of blocked rays.
    fn assert_same(mesh: &ObjectMesh) -> usize {
        let bvh = Bvh::new(mesh);
        let wide = WideBvh::new(&bvh);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut point =
            |scale: f32| Vec3::from_array(std::array::from_fn(|_| scale * (2.0 * rng.random::<f32>() - 1.0)));
        let (mut last, mut blocked) = (0, 0);
        for k in 0..4000 {
            let origin = point(1.3 * mesh.bounds.radius) + mesh.bounds.center;
            let direction = if k % 10 == 0 { Vec3::AXES[k / 10 % 3] } else { point(1.0).normalize_or(Vec3::X) };
            let expected = bvh.is_blocked(origin, direction);
            assert_eq!(wide.is_blocked(origin, direction, &mut last), expected, "ray {k}");
            let mut unknown = u32::MAX;
            assert_eq!(wide.is_blocked(origin, direction, &mut unknown), expected, "ray {k}, no previous packet");
            blocked += usize::from(expected);
        }
        blocked
    }

    #[test]
    fn tests_of_four_at_once_agree_with_tests_of_one() {
        for kind in ["teapot", "cup", "skirt", "plate", "sphere"] {
            let object = scene::Object { kind: kind.to_owned(), path: None };
            let blocked = assert_same(&object::build(&object, Path::new(".")).unwrap());
            assert!((200..3800).contains(&blocked), "{kind}: {blocked}");
        }
    }

    #[test]
    fn no_triangle_one_triangle_and_identical_triangles_build_hierarchies() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        for count in [0, 1, 3, 100] {
            let triangles = vec![[0, 1, 2]; count];
            let mesh = ObjectMesh { positions: positions.clone(), triangles, ..ObjectMesh::default() };
            let wide = WideBvh::new(&Bvh::new(&mesh));
            let origin = Vec3::new(0.2, 0.2, 1.0);
            assert_eq!(wide.is_blocked(origin, Vec3::NEG_Z, &mut 0), count > 0, "{count}");
            assert!(!wide.is_blocked(origin, Vec3::Z, &mut 0));
        }
    }
}
