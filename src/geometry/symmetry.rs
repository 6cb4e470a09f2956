//! Mirror planes of a tile: then half of the directions tell the other half.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::PeriodicGrid;
use super::TileMesh;
use super::families::part::below;

/// GridCoordinates that are compared, and planes that are tried along each axis.
const PLACES: usize = 256;
const MAX_PLANES: usize = 128;
/// Heights, in tile sizes, and normals that differ by less are the same.
const SAME_HEIGHT: f32 = 1e-4;
const SAME_NORMAL: f32 = 1e-3;

/// Is the tile its own mirror image in a plane x = const, and in one y = const? Shape, slots and colours are compared along
/// vertical lines, through all that lies above each other.
pub fn mirror_planes(mesh: &TileMesh) -> [bool; 2] {
    mirror_planes_in(mesh, None)
}

/// The same where a grid of the mesh is at hand.
pub fn mirror_planes_in(mesh: &TileMesh, grid: Option<&PeriodicGrid>) -> [bool; 2] {
    if mesh.triangles.is_empty() {
        return [false; 2];
    }
    let sums = [0, 1].map(|axis| candidates(mesh, axis));
    let sums = if is_refused(mesh, &sums) { [vec![], vec![]] } else { sums };
    match grid {
        _ if sums.iter().all(Vec::is_empty) => [false; 2],
        Some(grid) => among(mesh, grid, &sums),
        None => among(mesh, &PeriodicGrid::new(mesh), &sums),
    }
}

/// Are there planes among the candidates?
fn among(mesh: &TileMesh, grid: &PeriodicGrid, sums: &[Vec<f32>; 2]) -> [bool; 2] {
    let looks = ColumnSamples { mesh, grid, bottom: mesh.z_range().0 };
    let places = (0..PLACES).into_par_iter().with_min_len(PLACES / 8);
    let places: Vec<(Vec2, Vec<SampledColumn>)> = places.map(|k| looks.at(k)).collect();
    let has_plane = |axis: usize| sums[axis].iter().any(|sum| looks.is_mirrored(&places, axis, *sum));
    rayon::join(|| has_plane(0), || has_plane(1)).into()
}

/// GridCoordinates and planes of height-fields that are compared before all are.
const FEW_PLACES: usize = 8;
const FEW_PLANES: usize = 16;

/// Do a few places already refuse all candidates? Asked of height-fields, where the triangles below a place are known: most of
/// the time goes into a grid of all.
fn is_refused(mesh: &TileMesh, sums: &[Vec<f32>; 2]) -> bool {
    if sums.iter().map(Vec::len).sum::<usize>() > FEW_PLANES {
        return false;
    }
    let planes = || [0, 1].into_iter().flat_map(|axis| sums[axis].iter().map(move |sum| (axis, *sum)));
    let seen_from = |k| {
        let place = place(k, mesh.size);
        planes().map(move |(axis, sum)| mirrored(place, axis, sum, mesh.size)).chain([place])
    };
    let Some((part, grid)) = below(mesh, (0..FEW_PLACES).flat_map(seen_from)) else { return false };
    let looks = ColumnSamples { mesh: &part, grid: &grid, bottom: mesh.z_range().0 };
    let places: Vec<(Vec2, Vec<SampledColumn>)> = (0..FEW_PLACES).map(|k| looks.at(k)).collect();
    planes().all(|(axis, sum)| !looks.is_mirrored(&places, axis, sum))
}

fn place(k: usize, size: Vec2) -> Vec2 {
    // The R2 sequence, away from round numbers where edges lie.
    let part = |step: f64| ((k as f64 + 0.317) * step).fract() as f32;
    Vec2::new(part(0.754_877_666_246_692_8), part(0.569_840_290_998_053_3)) * size
}

fn mirrored(mut place: Vec2, axis: usize, sum: f32, size: Vec2) -> Vec2 {
    place[axis] = (sum - place[axis]).rem_euclid(size[axis]);
    place
}

/// Sums `x + x'` that planes could have: a highest vertex mirrors onto one of the same height.
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

struct ColumnSamples<'a> {
    mesh: &'a TileMesh,
    grid: &'a PeriodicGrid,
    bottom: f32,
}

/// Surfaces above each other that are compared.
const MAX_LAYERS: usize = 16;

/// What a vertical line meets.
#[derive(Debug, Clone, Copy)]
struct SampledColumn {
    height: f32,
    normal: Vec3,
    slot: u16,
    color: Vec3,
}

impl ColumnSamples<'_> {
    fn at(&self, k: usize) -> (Vec2, Vec<SampledColumn>) {
        let place = place(k, self.mesh.size);
        (place, self.down(place))
    }

    /// All that the vertical line meets, from the top down.
    fn down(&self, place: Vec2) -> Vec<SampledColumn> {
        let (mut layers, mut start) = (Vec::new(), self.grid.top() + 1.0);
        let step = SAME_HEIGHT * self.mesh.size.max_element();
        while let Some(hit) = self.grid.nearest(place.extend(start), Vec3::NEG_Z, self.bottom - 1.0) {
            let triangle = hit.triangle as usize;
            layers.push(SampledColumn {
                height: hit.position.z,
                normal: self.mesh.geometric_normal(triangle),
                slot: self.mesh.slot_at(triangle, place),
                color: self.mesh.color.at(place, self.mesh.size),
            });
            start = hit.position.z - step;
            if layers.len() == MAX_LAYERS {
                break;
            }
        }
        layers
    }

    fn is_mirrored(&self, places: &[(Vec2, Vec<SampledColumn>)], axis: usize, sum: f32) -> bool {
        let size = self.mesh.size;
        let mut differ = 0;
        for (place, seen) in places {
            let same = |a: &SampledColumn, b: &SampledColumn| {
                let mut normal = b.normal;
                normal[axis] = -normal[axis];
                (a.height - b.height).abs() <= SAME_HEIGHT * size.max_element()
                    && (a.normal - normal).abs().max_element() <= SAME_NORMAL
                    && a.slot == b.slot
                    && (a.color - b.color).abs().max_element() <= SAME_NORMAL
            };
            let other = self.down(mirrored(*place, axis, sum, size));
            let same = seen.len() == other.len() && seen.iter().zip(&other).all(|(a, b)| same(a, b));
            // A ray that falls on an edge may take either side.
            differ += usize::from(!same);
            if differ > PLACES / 100 {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
#[path = "symmetry_tests.rs"]
mod tests;
