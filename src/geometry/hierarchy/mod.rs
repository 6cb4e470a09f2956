//! A hierarchy of boxes over the triangles of one period, for rays through the endless tiling.

mod build;
mod copy_walk;
mod rays;
#[cfg(test)]
mod tests;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use self::build::{Bounds, Item, Topology};
use self::rays::RayTree;
use super::grid::cell_lists::MIN_ITEMS_PER_TASK;

/// A bounding-volume hierarchy over the triangles of one period.
#[derive(Debug)]
pub(crate) struct TileHierarchy {
    tile_size: Vec2,
    /// Bounds of all triangles.
    bounds: Bounds,
    /// Corners of each triangle, moved by whole tiles so that the centre of its bounds is in the tile.
    corners: Vec<[Vec3; 3]>,
    rays: RayTree,
}

impl TileHierarchy {
    /// Builds the hierarchy of triangles, given by their corners. Triangles with corners that are not finite, or without
    /// area, block nothing.
    pub fn new(corners: &[[Vec3; 3]], tile_size: Vec2) -> Self {
        let in_tile = |corners: &[Vec3; 3]| in_tile(*corners, tile_size);
        let corners: Vec<[Vec3; 3]> = corners.par_iter().with_min_len(MIN_ITEMS_PER_TASK).map(in_tile).collect();
        let item = |(triangle, corners): (usize, &[Vec3; 3])| {
            is_solid(corners).then(|| Item { bounds: Bounds::of(corners), triangle: triangle as u32 })
        };
        let items =
            corners.par_iter().enumerate().with_min_len(MIN_ITEMS_PER_TASK).filter_map(item).collect::<Vec<_>>();
        let bounds = items.iter().fold(Bounds::EMPTY, |sum, item| sum.with(item.bounds));
        let rays = RayTree::new(&Topology::new(items), &corners, tile_size);
        Self { tile_size, bounds, corners, rays }
    }
}

fn is_solid(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    corners.iter().all(|corner| corner.is_finite()) && (b - a).cross(c - a).length_squared() > 0.0
}

fn in_tile(corners: [Vec3; 3], size: Vec2) -> [Vec3; 3] {
    let shift = (Bounds::of(&corners).center().truncate() / size).floor() * size;
    corners.map(|corner| corner - shift.extend(0.0))
}
