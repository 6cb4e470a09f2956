//! Test that a mesh closes the plane, by welding corners modulo the tile and counting edges.

use std::cmp::Ordering;
use std::collections::HashMap;

use glam::{DVec3, I64Vec3};

use super::TileMesh;

/// Distance, as a fraction of the tile, up to which corners are welded.
const WELD: f64 = 2e-6;

/// Returns whether the mesh is closed modulo the tile and covers the plane once. It is closed if triangles pass each
/// edge equally often in both directions. It covers the plane once if the signed projected area equals the base area.
/// Then each ray from above first meets a side that reflects.
pub fn is_closed_sheet(mesh: &TileMesh) -> bool {
    open_edges(mesh) == 0 && (signed_projected_area(mesh) / f64::from(mesh.base_area()) - 1.0).abs() < 1e-3
}

/// Computes the signed projected area `Σ A_t n_t·z`.
pub fn signed_projected_area(mesh: &TileMesh) -> f64 {
    let area = |triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
        0.5 * (b - a).cross(c - a).z
    };
    (0..mesh.triangles.len()).map(area).sum()
}

/// Counts the edges, after welding, that triangles pass more often in one direction than in the other. Edges between
/// the same corners that cross tile borders differently are different edges.
pub fn open_edges(mesh: &TileMesh) -> usize {
    let representatives = weld(mesh);
    let size = mesh.size.as_dvec2();
    let xy = |index: u32| mesh.positions[index as usize].as_dvec3().truncate();
    let mut balance: HashMap<(u32, u32, [i64; 2]), i32> = HashMap::new();
    for triangle in &mesh.triangles {
        for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (triangle[a], triangle[b])) {
            let (a, b) = (representatives[from as usize], representatives[to as usize]);
            let crossings = ((xy(to) - xy(from) - (xy(b) - xy(a))) / size).round();
            let crossings = [crossings.x as i64, crossings.y as i64];
            let forwards = (a, b, crossings);
            let backwards = (b, a, [-crossings[0], -crossings[1]]);
            *balance.entry(forwards.min(backwards)).or_default() += match forwards.cmp(&backwards) {
                Ordering::Less => 1,
                Ordering::Equal => 0,
                Ordering::Greater => -1,
            };
        }
    }
    balance.values().filter(|count| **count != 0).count()
}

/// For each vertex, the index of the first vertex at the same position modulo the tile.
fn weld(mesh: &TileMesh) -> Vec<u32> {
    let size = mesh.size.as_dvec2();
    let (low, high) = mesh.z_range();
    let scale = DVec3::new(size.x, size.y, size.max_element().max(f64::from(high - low)));
    let cells = (1.0 / WELD) as i64;
    let mut found: HashMap<I64Vec3, u32> = HashMap::new();
    let wrap = |cell: I64Vec3| I64Vec3::new(cell.x.rem_euclid(cells), cell.y.rem_euclid(cells), cell.z);
    let mut representative = |(index, position): (usize, &glam::Vec3)| {
        let cell = (position.as_dvec3() / scale * cells as f64).round().as_i64vec3();
        let around = (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| I64Vec3::new(x, y, z))));
        let known =
            std::iter::once(I64Vec3::ZERO).chain(around).find_map(|step| found.get(&wrap(cell + step)).copied());
        known.unwrap_or_else(|| {
            found.insert(wrap(cell), index as u32);
            index as u32
        })
    };
    mesh.positions.iter().enumerate().map(&mut representative).collect()
}

/// Asserts that a mesh of a closed family closes the plane.
#[cfg(test)]
pub fn assert_closes_plane(mesh: &TileMesh) {
    assert_eq!(open_edges(mesh), 0, "open edges");
    let ratio = signed_projected_area(mesh) / f64::from(mesh.base_area());
    assert!((ratio - 1.0).abs() < 1e-5, "projected area {ratio} of the base area");
    assert!(mesh.closes_plane);
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};

    use super::*;

    fn plane(far_edge: f32) -> TileMesh {
        TileMesh {
            size: Vec2::ONE,
            positions: vec![Vec3::ZERO, Vec3::new(far_edge, 0.0, 0.0), Vec3::new(far_edge, 1.0, 0.0), Vec3::Y],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            triangle_slot: vec![0, 0],
            slots: vec!["default".to_owned()],
            ..TileMesh::default()
        }
    }

    #[test]
    fn a_plane_closes_over_the_tiles_edge_and_a_gap_is_found() {
        assert!(is_closed_sheet(&plane(1.0)));
        assert!(is_closed_sheet(&plane(1.0 + 1e-7)));
        assert_eq!(open_edges(&plane(0.99)), 2);
        assert!(!is_closed_sheet(&plane(0.99)));
    }

    #[test]
    fn a_plane_that_faces_down_does_not_close() {
        let mut mesh = plane(1.0);
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        assert!(!is_closed_sheet(&mesh));
    }
}
