//! Rays through the endless tiling, by a hierarchy of boxes that tests eight boxes or triangles at once.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::TileHierarchy;
use super::build::{Child, MAX_DEPTH, Topology, WIDTH};
use super::copy_walk::CopyWalk;
use crate::geometry::grid::Hit;
use crate::geometry::grid::ray_cast::lies_on;
use crate::math::simd::{F32x8Array, SimdF32x8, SimdTask, with_simd_f32x8};

/// A node with the bounds of its children.
#[derive(Debug, Clone)]
pub(super) struct RayNode {
    low: [F32x8Array; 3],
    high: [F32x8Array; 3],
    children: [Link; WIDTH],
}

/// The index of a node, or of a leaf, in one word.
#[derive(Debug, Clone, Copy)]
struct Link(u32);

impl Link {
    const LEAF: u32 = 1 << 31;
    const ROOT: Self = Self(0);

    #[inline(always)]
    fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }

    #[inline(always)]
    fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }
}

/// Eight triangles. Lanes without a triangle repeat another one.
#[derive(Debug, Clone)]
pub(super) struct TrianglePacket {
    /// Coordinates by corner and axis.
    corners: [[F32x8Array; 3]; 3],
    triangles: [u32; WIDTH],
    /// Areas in projection up to which a point may lie outside of the edge opposite to each corner. They bound the rounding of
    /// corners that are moved by whole tiles, so that no ray passes between neighbours. They are in proportion to the edge:
    /// beside a long one, the same area would enlarge a short one by more than the thickness of a hair.
    slack: [F32x8Array; 3],
}

/// Nodes and leaves for rays.
#[derive(Debug, Default)]
pub(super) struct RayTree {
    nodes: Vec<RayNode>,
    leaves: Vec<TrianglePacket>,
}

impl RayTree {
    pub fn new(topology: &Topology, corners: &[[Vec3; 3]], tile_size: Vec2) -> Self {
        let leaf = |triangles: &Vec<u32>| TrianglePacket::new(triangles, corners, tile_size);
        let leaves = topology.leaves.par_iter().with_min_len(MIN_LEAVES_PER_TASK).map(leaf).collect();
        let nodes = topology.nodes.iter().zip(&topology.bounds).map(|(children, bounds)| {
            let axis = |value: &dyn Fn(usize) -> f32| F32x8Array::from(std::array::from_fn(value));
            let link = |child: &Child| match child {
                Child::None => Link::ROOT,
                Child::Node(index) => Link(*index),
                Child::Leaf(index) => Link(*index | Link::LEAF),
            };
            RayNode {
                low: std::array::from_fn(|k| axis(&|lane| bounds[lane].low[k])),
                high: std::array::from_fn(|k| axis(&|lane| bounds[lane].high[k])),
                children: std::array::from_fn(|lane| link(&children[lane])),
            }
        });
        Self { nodes: nodes.collect(), leaves }
    }
}

/// Smallest number of leaves that a thread fills.
const MIN_LEAVES_PER_TASK: usize = 256;

/// Rounding of corners that are moved by whole tiles, in units of the tile's diagonal.
const CORNER_ROUNDING: f32 = 5e-7;

impl TrianglePacket {
    fn new(triangles: &[u32], corners: &[[Vec3; 3]], tile_size: Vec2) -> Self {
        let of = |lane: usize| triangles[lane.min(triangles.len() - 1)];
        let opposite = |lane: usize, corner: usize| {
            let corners = corners[of(lane) as usize];
            (corners[(corner + 2) % 3] - corners[(corner + 1) % 3]).length()
        };
        let rounding = CORNER_ROUNDING * tile_size.length();
        Self {
            corners: std::array::from_fn(|corner| {
                std::array::from_fn(|axis| {
                    F32x8Array::from(std::array::from_fn(|lane| corners[of(lane) as usize][corner][axis]))
                })
            }),
            triangles: std::array::from_fn(of),
            slack: std::array::from_fn(|corner| {
                F32x8Array::from(std::array::from_fn(|lane| rounding * opposite(lane, corner)))
            }),
        }
    }

    /// The distances, in lengths of the direction, at which the ray meets the planes of the triangles, the weights of the
    /// second and third corners, and a bit mask of the triangles that it meets at a distance above 0 and up to `end`.
    ///
    /// The signs of edge functions of the sheared corners decide (Woop, Benthin and Wald 2013). Neighbours compute these
    /// from the same numbers.
    #[inline(always)]
    fn intersect<E: SimdF32x8>(&self, ray: &Ray, end: f32) -> (E, [E; 2], u32) {
        let (a, b, c) =
            (ray.sheared::<E>(&self.corners[0]), ray.sheared(&self.corners[1]), ray.sheared(&self.corners[2]));
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        let zero = E::splat(0.0);
        let determinant = u + v + w;
        let [su, sv, sw] = [E::of(&self.slack[0]), E::of(&self.slack[1]), E::of(&self.slack[2])];
        let area = determinant.max(zero - determinant);
        // Triangles that are seen edge-on are strict, because every point of their plane is close to all edges.
        let is_open = (E::splat(8.0) * su.max(sv.max(sw))).less(area);
        let (su, sv, sw) = (E::select(is_open, su, zero), E::select(is_open, sv, zero), E::select(is_open, sw, zero));
        let negative = E::either(u.less(zero - su), E::either(v.less(zero - sv), w.less(zero - sw)));
        let positive = E::either(su.less(u), E::either(sv.less(v), sw.less(w)));
        let inverse = E::splat(1.0) / determinant;
        let t = (u * a[2] + v * b[2] + w * c[2]) * inverse;
        let in_range = E::both(zero.less(t), t.up_to(E::splat(end)));
        let met = E::bits(in_range) & !E::bits(E::both(negative, positive));
        (t, [v * inverse, w * inverse], met)
    }
}

/// A ray in the coordinates of one copy of the tile.
#[derive(Debug, Clone, Copy)]
struct Ray {
    origin: Vec3,
    inverse: Vec3,
    /// The axes across the ray and, last, the axis that it follows most closely.
    axes: [usize; 3],
    /// Shear that makes the ray parallel to the last axis, and the inverse length of the direction along it.
    shear: [f32; 3],
}

/// Bounds the components of directions from below, so that their inverse is finite.
const MIN_COMPONENT: f32 = 1e-20;

impl Ray {
    fn new(origin: Vec3, to: Vec3) -> Self {
        let size = to.abs();
        let kz = if size.z >= size.x.max(size.y) { 2 } else { usize::from(size.y > size.x) };
        let axes = [(kz + 1) % 3, (kz + 2) % 3, kz];
        let along = to[kz];
        let inverse = to.to_array().map(|d| 1.0 / if d.abs() < MIN_COMPONENT { MIN_COMPONENT } else { d });
        Self { origin, inverse: inverse.into(), axes, shear: [to[axes[0]] / along, to[axes[1]] / along, 1.0 / along] }
    }

    /// Coordinates of eight corners in which the ray is the last axis, in units of its direction.
    #[inline(always)]
    fn sheared<E: SimdF32x8>(&self, corners: &[F32x8Array; 3]) -> [E; 3] {
        let [kx, ky, kz] = self.axes;
        let z = E::of(&corners[kz]) - E::splat(self.origin[kz]);
        let x = E::of(&corners[kx]) - E::splat(self.origin[kx]) - E::splat(self.shear[0]) * z;
        let y = E::of(&corners[ky]) - E::splat(self.origin[ky]) - E::splat(self.shear[1]) * z;
        [x, y, z * E::splat(self.shear[2])]
    }
}

/// Factor of the end of a box, so that rounding misses no flat box.
const BOX_SLACK: f32 = 1.000_001;

impl RayNode {
    /// The distances at which the ray enters the children, and a bit mask of those that it enters before `end`.
    #[inline(always)]
    fn entered<E: SimdF32x8>(&self, ray: &Ray, end: f32) -> (E, u32) {
        let (mut enter, mut leave) = (E::splat(0.0), E::splat(end));
        for axis in 0..3 {
            let (origin, inverse) = (E::splat(ray.origin[axis]), E::splat(ray.inverse[axis]));
            let (low, high) = if ray.inverse[axis] >= 0.0 { (&self.low, &self.high) } else { (&self.high, &self.low) };
            enter = enter.max((E::of(&low[axis]) - origin) * inverse);
            leave = leave.min((E::of(&high[axis]) - origin) * inverse);
        }
        (enter, E::bits(enter.less(leave * E::splat(BOX_SLACK))))
    }
}

/// Size of the stack of a walk down the hierarchy.
const STACK: usize = (WIDTH - 1) * MAX_DEPTH + WIDTH;

/// Nodes and leaves to visit, with the distance at which the ray enters them.
type Stack = [(f32, Link); STACK];

/// The end of a ray in the endless tiling, and what it ignores.
#[derive(Debug, Clone, Copy)]
struct Cast {
    origin: Vec3,
    to: Vec3,
    own: u32,
    max_distance: f32,
    /// Any hit will do.
    any: bool,
}

/// The nearest hit so far.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    distance: f32,
    triangle: u32,
    barycentric: [f32; 2],
}

/// Number of copies of the tile after which a ray counts as unblocked. It bounds the time of nearly horizontal rays.
const MAX_COPIES: usize = 4096;

struct CastTask<'a> {
    tiling: &'a TileHierarchy,
    cast: Cast,
}

impl SimdTask for CastTask<'_> {
    type Output = Option<Nearest>;

    #[inline(always)]
    fn with<E: SimdF32x8>(self) -> Option<Nearest> {
        let Self { tiling, cast } = self;
        if tiling.rays.nodes.is_empty() {
            return None;
        }
        let plane = cast.to.truncate();
        // A vertical ray stays in its column.
        let along =
            if plane.length_squared() < 1e-16 * cast.to.length_squared() { Vec2::new(1e-8, 0.0) } else { plane };
        let from = cast.origin.truncate();
        let mut walk = CopyWalk::new(tiling, from, along);
        let mut best = Nearest { distance: cast.max_distance, triangle: u32::MAX, barycentric: [0.0; 2] };
        let mut ray = Ray::new(cast.origin, cast.to);
        let mut copies = 0;
        let mut stack = [(0.0, Link::ROOT); STACK];
        while walk.entered < best.distance && copies < MAX_COPIES {
            for copy in walk.copies().take(MAX_COPIES) {
                copies += 1;
                ray.origin = cast.origin - (copy.as_vec2() * tiling.tile_size).extend(0.0);
                tiling.cast_in_copy::<E>(&ray, &cast, &mut best, &mut stack);
                if cast.any && best.triangle != u32::MAX {
                    return Some(best);
                }
            }
            walk.advance();
        }
        (best.triangle != u32::MAX).then_some(best)
    }
}

impl TileHierarchy {
    #[inline(always)]
    fn cast_in_copy<E: SimdF32x8>(&self, ray: &Ray, cast: &Cast, best: &mut Nearest, stack: &mut Stack) {
        stack[0] = (0.0, Link::ROOT);
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (entered, link) = stack[depth];
            if entered > best.distance {
                continue;
            }
            if link.is_leaf() {
                let packet = &self.rays.leaves[link.index()];
                let (t, [v, w], mut met) = packet.intersect::<E>(ray, best.distance);
                if met == 0 {
                    continue;
                }
                let (t, v, w) = (t.to_array(), v.to_array(), w.to_array());
                while met != 0 {
                    let lane = met.trailing_zeros() as usize;
                    met &= met - 1;
                    let triangle = packet.triangles[lane];
                    let corners = self.corners[triangle as usize];
                    let is_own = triangle == cast.own && lies_on(ray.origin, corners, self.tile_size);
                    // If two triangles share the point, the first one is hit, in any order of visits.
                    let is_nearer = t[lane] < best.distance || (t[lane] == best.distance && triangle < best.triangle);
                    if is_nearer && !is_own {
                        *best = Nearest { distance: t[lane], triangle, barycentric: [v[lane], w[lane]] };
                        if cast.any {
                            return;
                        }
                    }
                }
                continue;
            }
            let node = &self.rays.nodes[link.index()];
            let (enter, mut met) = node.entered::<E>(ray, best.distance);
            let enter = enter.to_array();
            let bottom = depth;
            while met != 0 {
                let lane = met.trailing_zeros() as usize;
                met &= met - 1;
                // The nearest child comes last, so that it is visited first.
                let mut at = depth;
                while at > bottom && stack[at - 1].0 < enter[lane] {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = (enter[lane], node.children[lane]);
                depth += 1;
            }
        }
    }

    /// Returns whether any triangle but `own` blocks the ray from `origin` along `to` before the distance `end`, in
    /// lengths of the direction. The triangle `own` blocks if the origin does not lie on it.
    pub fn is_blocked(&self, origin: Vec3, to: Vec3, own: u32, end: f32) -> bool {
        let cast = Cast { origin, to, own, max_distance: end, any: true };
        with_simd_f32x8(CastTask { tiling: self, cast }).is_some()
    }

    /// The first hit along `to` before the distance `end`, in lengths of the direction. `own` is as in
    /// [`TileHierarchy::is_blocked`].
    pub fn first_hit(&self, origin: Vec3, to: Vec3, own: u32, end: f32) -> Option<Hit> {
        let cast = Cast { origin, to, own, max_distance: end, any: false };
        with_simd_f32x8(CastTask { tiling: self, cast }).map(|nearest| Hit {
            triangle: nearest.triangle,
            position: origin + to * nearest.distance,
            barycentric: nearest.barycentric,
        })
    }
}
