//! Builds a hierarchy of boxes over triangles by the surface-area heuristic (Wald 2007, "On fast construction of SAH-based
//! bounding volume hierarchies").

use glam::Vec3;
use rayon::prelude::*;

/// Number of children per node, and of triangles per leaf: the values of one vector.
pub(crate) const WIDTH: usize = 8;

const BINS: usize = 16;
/// Subtrees of fewer triangles are built by one thread.
const MIN_PARALLEL_ITEMS: usize = 2048;
/// Depth from which on a node splits its triangles into halves, which bounds the depth of the whole hierarchy.
const MAX_SPLIT_DEPTH: usize = 20;
/// Bounds the depth of a hierarchy over fewer than 2³² triangles: halves divide them by eight per level.
pub(crate) const MAX_DEPTH: usize = MAX_SPLIT_DEPTH + 12;

/// A box with sides along the axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
}

impl Bounds {
    pub const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    pub fn of(corners: &[Vec3; 3]) -> Self {
        let [a, b, c] = *corners;
        Self { low: a.min(b).min(c), high: a.max(b).max(c) }
    }

    pub fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub fn center(&self) -> Vec3 {
        0.5 * self.low + 0.5 * self.high
    }

    fn half_area(&self) -> f32 {
        let d = (self.high - self.low).max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// A triangle by its bounds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Item {
    pub bounds: Bounds,
    pub triangle: u32,
}

/// A child of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Child {
    None,
    /// The index of a node, larger than that of its parent.
    Node(u32),
    /// The index of a leaf.
    Leaf(u32),
}

/// Nodes and leaves of a hierarchy. Node 0 is the root if there is any triangle.
#[derive(Debug, Clone, Default)]
pub(crate) struct Topology {
    pub nodes: Vec<[Child; WIDTH]>,
    /// Bounds of the children of each node.
    pub bounds: Vec<[Bounds; WIDTH]>,
    /// Triangles of each leaf, at least one.
    pub leaves: Vec<Vec<u32>>,
}

impl Topology {
    /// Builds the hierarchy, the same with any number of threads.
    pub fn new(mut items: Vec<Item>) -> Self {
        let mut topology = Self::default();
        if !items.is_empty() {
            let bounds = bounds_of(&items);
            let children = match subtree(&mut items, 0) {
                Subtree::Node(children) => children,
                leaf @ Subtree::Leaf(_) => vec![(bounds, leaf)],
            };
            topology.add(children);
        }
        topology
    }

    /// Adds a node with its descendants and returns its index.
    fn add(&mut self, children: Vec<(Bounds, Subtree)>) -> u32 {
        let index = self.nodes.len();
        self.nodes.push([Child::None; WIDTH]);
        self.bounds.push([Bounds::EMPTY; WIDTH]);
        for (k, (bounds, child)) in children.into_iter().enumerate() {
            self.bounds[index][k] = bounds;
            self.nodes[index][k] = match child {
                Subtree::Node(children) => Child::Node(self.add(children)),
                Subtree::Leaf(triangles) => {
                    self.leaves.push(triangles);
                    Child::Leaf(self.leaves.len() as u32 - 1)
                }
            };
        }
        index as u32
    }
}

enum Subtree {
    Node(Vec<(Bounds, Subtree)>),
    Leaf(Vec<u32>),
}

fn subtree(items: &mut [Item], depth: usize) -> Subtree {
    if items.len() <= WIDTH {
        return Subtree::Leaf(items.iter().map(|item| item.triangle).collect());
    }
    // The part that costs most is split until there are eight.
    let mut parts = vec![(f32::INFINITY, items)];
    while parts.len() < WIDTH {
        let splittable = (0..parts.len()).filter(|&k| parts[k].1.len() > WIDTH);
        let Some(most) = splittable.max_by(|&a, &b| parts[a].0.total_cmp(&parts[b].0)) else { break };
        let (_, part) = parts.swap_remove(most);
        let cut = split(part, depth);
        let (left, right) = part.split_at_mut(cut);
        parts.extend([left, right].map(|part| (cost(bounds_of(part).half_area(), part.len()), part)));
    }
    let child = |(_, part): (f32, &mut [Item])| (bounds_of(part), subtree(part, depth + 1));
    let is_large = parts.iter().map(|(_, part)| part.len()).sum::<usize>() > MIN_PARALLEL_ITEMS;
    Subtree::Node(if is_large {
        parts.into_par_iter().map(child).collect()
    } else {
        parts.into_iter().map(child).collect()
    })
}

fn bounds_of(items: &[Item]) -> Bounds {
    items.iter().fold(Bounds::EMPTY, |sum, item| sum.with(item.bounds))
}

/// The expected cost of a part: the probability that a ray meets it, times its leaves.
fn cost(half_area: f32, count: usize) -> f32 {
    half_area * count.div_ceil(WIDTH) as f32
}

/// Partitions the items at the cheapest cut and returns its index, which is strictly inside.
fn split(items: &mut [Item], depth: usize) -> usize {
    let half = items.len() / 2;
    if depth >= MAX_SPLIT_DEPTH {
        return half;
    }
    let centers = items.iter().fold(Bounds::EMPTY, |sum, item| {
        let center = item.bounds.center();
        Bounds { low: sum.low.min(center), high: sum.high.max(center) }
    });
    let extent = centers.high - centers.low;
    let per_unit = Vec3::from_array(extent.to_array().map(|side| if side > 0.0 { BINS as f32 / side } else { 0.0 }));
    let bins_of = |item: &Item| {
        let at = (item.bounds.center() - centers.low) * per_unit;
        at.to_array().map(|at| (at as usize).min(BINS - 1))
    };
    let mut bins = [[(Bounds::EMPTY, 0_usize); BINS]; 3];
    for item in items.iter() {
        for (axis, bin) in bins_of(item).into_iter().enumerate() {
            let (bounds, count) = &mut bins[axis][bin];
            *bounds = bounds.with(item.bounds);
            *count += 1;
        }
    }
    let Some((axis, cut)) = cheapest_cut(&bins, items.len()) else { return half };
    partition(items, |item| bins_of(item)[axis] < cut)
}

/// The axis of the cheapest cut and the first bin of its right side; `None` if all centres are equal.
fn cheapest_cut(bins: &[[(Bounds, usize); BINS]; 3], total: usize) -> Option<(usize, usize)> {
    let (mut best, mut best_cost) = (None, f32::INFINITY);
    for (axis, bins) in bins.iter().enumerate() {
        let mut right_cost = [0.0; BINS];
        let mut sum = (Bounds::EMPTY, 0);
        for k in (1..BINS).rev() {
            sum = (sum.0.with(bins[k].0), sum.1 + bins[k].1);
            right_cost[k] = cost(sum.0.half_area(), sum.1);
        }
        let mut sum = (Bounds::EMPTY, 0);
        for k in 1..BINS {
            sum = (sum.0.with(bins[k - 1].0), sum.1 + bins[k - 1].1);
            let cost = cost(sum.0.half_area(), sum.1) + right_cost[k];
            if cost < best_cost && sum.1 > 0 && sum.1 < total {
                (best, best_cost) = (Some((axis, k)), cost);
            }
        }
    }
    best
}

/// Moves the items that are on the left before the others and returns their number.
fn partition(items: &mut [Item], is_left: impl Fn(&Item) -> bool) -> usize {
    let mut left = 0;
    for k in 0..items.len() {
        if is_left(&items[k]) {
            items.swap(left, k);
            left += 1;
        }
    }
    left
}
