//! Mirror planes of a tile. If there is one, the values at half of the directions determine those at the other half.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::PeriodicGrid;
use super::TileMesh;
use super::families::height_field_part::part_below;

/// Number of points that are compared with their mirror images.
const POINTS: usize = 256;
/// Maximum number of candidate planes per axis.
const MAX_PLANES: usize = 128;
/// Difference of heights, in tile sizes, up to which they count as equal.
const SAME_HEIGHT: f32 = 1e-4;
/// Difference of normals and colours per component up to which they count as equal.
const SAME_NORMAL: f32 = 1e-3;

/// Returns whether the tile is its own mirror image in a plane x = const, and in a plane y = const. Shape, slots and
/// colours of all layers are compared along vertical lines.
pub fn mirror_planes(mesh: &TileMesh) -> [bool; 2] {
    mirror_planes_in(mesh, None)
}

/// Computes [`mirror_planes`] with a grid of the mesh if the caller has one.
pub fn mirror_planes_in(mesh: &TileMesh, grid: Option<&PeriodicGrid>) -> [bool; 2] {
    if mesh.triangles.is_empty() {
        return [false; 2];
    }
    let sums = [0, 1].map(|axis| candidates(mesh, axis));
    let sums = if are_excluded(mesh, &sums) { [vec![], vec![]] } else { sums };
    match grid {
        _ if sums.iter().all(Vec::is_empty) => [false; 2],
        Some(grid) => any_mirror_plane(mesh, grid, &sums),
        None => any_mirror_plane(mesh, &PeriodicGrid::new(mesh), &sums),
    }
}

/// Returns whether a candidate of each axis is a mirror plane.
fn any_mirror_plane(mesh: &TileMesh, grid: &PeriodicGrid, sums: &[Vec<f32>; 2]) -> [bool; 2] {
    let columns = ColumnSampler { mesh, grid, bottom: mesh.z_range().0 };
    let samples = (0..POINTS).into_par_iter().with_min_len(POINTS / 8);
    let samples: Vec<(Vec2, Vec<ColumnHit>)> = samples.map(|k| columns.at(k)).collect();
    let has_plane = |axis: usize| sums[axis].iter().any(|sum| columns.is_mirrored(&samples, axis, *sum));
    rayon::join(|| has_plane(0), || has_plane(1)).into()
}

/// Number of points of a height field that are compared first.
const FIRST_POINTS: usize = 8;
/// Maximum number of candidate planes for the first comparison.
const MAX_FIRST_PLANES: usize = 16;

/// Returns whether a few points exclude all candidates. This test is for height fields, on which the triangles below a
/// point are known, so that a small grid replaces the slow grid of the whole mesh.
fn are_excluded(mesh: &TileMesh, sums: &[Vec<f32>; 2]) -> bool {
    if sums.iter().map(Vec::len).sum::<usize>() > MAX_FIRST_PLANES {
        return false;
    }
    let planes = || [0, 1].into_iter().flat_map(|axis| sums[axis].iter().map(move |sum| (axis, *sum)));
    let compared_points = |k| {
        let point = sample_point(k, mesh.size);
        planes().map(move |(axis, sum)| mirrored(point, axis, sum, mesh.size)).chain([point])
    };
    let Some((part, grid)) = part_below(mesh, (0..FIRST_POINTS).flat_map(compared_points)) else { return false };
    let columns = ColumnSampler { mesh: &part, grid: &grid, bottom: mesh.z_range().0 };
    let samples: Vec<(Vec2, Vec<ColumnHit>)> = (0..FIRST_POINTS).map(|k| columns.at(k)).collect();
    planes().all(|(axis, sum)| !columns.is_mirrored(&samples, axis, sum))
}

/// Point `k` of the R2 sequence, offset from round numbers, at which edges lie.
fn sample_point(k: usize, size: Vec2) -> Vec2 {
    let part = |step: f64| ((k as f64 + 0.317) * step).fract() as f32;
    Vec2::new(part(0.754_877_666_246_692_8), part(0.569_840_290_998_053_3)) * size
}

fn mirrored(mut point: Vec2, axis: usize, sum: f32, size: Vec2) -> Vec2 {
    point[axis] = (sum - point[axis]).rem_euclid(size[axis]);
    point
}

/// Candidate planes, as sums `x + x'` of mirrored coordinates: a highest vertex mirrors onto one of the same height.
fn candidates(mesh: &TileMesh, axis: usize) -> Vec<f32> {
    let top = mesh.z_range().1;
    let size = mesh.size[axis];
    let near = |z: f32| (z - top).abs() <= SAME_HEIGHT * mesh.size.max_element();
    let mut highest: Vec<f32> = mesh.positions.iter().filter(|p| near(p.z)).map(|p| p[axis].rem_euclid(size)).collect();
    highest.sort_by(f32::total_cmp);
    highest.dedup_by(|a, b| (*a - *b).abs() < 1e-5 * size);
    let Some(&first) = highest.first() else { return Vec::new() };
    highest.iter().take(MAX_PLANES).map(|x| first + x).collect()
}

struct ColumnSampler<'a> {
    mesh: &'a TileMesh,
    grid: &'a PeriodicGrid,
    bottom: f32,
}

/// Maximum number of layers that are compared.
const MAX_LAYERS: usize = 16;

/// A surface point on a vertical line.
#[derive(Debug, Clone, Copy)]
struct ColumnHit {
    height: f32,
    normal: Vec3,
    slot: u16,
    color: Vec3,
}

impl ColumnSampler<'_> {
    fn at(&self, k: usize) -> (Vec2, Vec<ColumnHit>) {
        let point = sample_point(k, self.mesh.size);
        (point, self.hits_below(point))
    }

    /// All surface points on a vertical line, from the top down.
    fn hits_below(&self, point: Vec2) -> Vec<ColumnHit> {
        let (mut layers, mut start) = (Vec::new(), self.grid.top() + 1.0);
        let step = SAME_HEIGHT * self.mesh.size.max_element();
        while let Some(hit) = self.grid.nearest(point.extend(start), Vec3::NEG_Z, self.bottom - 1.0) {
            let triangle = hit.triangle as usize;
            layers.push(ColumnHit {
                height: hit.position.z,
                normal: self.mesh.geometric_normal(triangle),
                slot: self.mesh.slot_at(triangle, point),
                color: self.mesh.color.at(hit.position, self.mesh.geometric_normal(triangle), self.mesh.size),
            });
            start = hit.position.z - step;
            if layers.len() == MAX_LAYERS {
                break;
            }
        }
        layers
    }

    fn is_mirrored(&self, samples: &[(Vec2, Vec<ColumnHit>)], axis: usize, sum: f32) -> bool {
        let size = self.mesh.size;
        let mut differ = 0;
        for (point, hits) in samples {
            let same = |a: &ColumnHit, b: &ColumnHit| {
                let mut normal = b.normal;
                normal[axis] = -normal[axis];
                (a.height - b.height).abs() <= SAME_HEIGHT * size.max_element()
                    && (a.normal - normal).abs().max_element() <= SAME_NORMAL
                    && a.slot == b.slot
                    && (a.color - b.color).abs().max_element() <= SAME_NORMAL
            };
            let other = self.hits_below(mirrored(*point, axis, sum, size));
            let same = hits.len() == other.len() && hits.iter().zip(&other).all(|(a, b)| same(a, b));
            // A ray on an edge may hit either side, so a few differences are allowed.
            differ += usize::from(!same);
            if differ > POINTS / 100 {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
#[path = "symmetry_tests.rs"]
mod tests;
