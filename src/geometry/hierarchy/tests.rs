//! Tests of rays against every triangle of explicit copies, and of rays through edges and corners.

use glam::{DVec2, DVec3, Vec2, Vec3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::TileHierarchy;
use crate::geometry::{PeriodicGrid, TileMesh};

const SIZE: Vec2 = Vec2::new(1.0, 0.7);

/// A closed sheet of `2 n²` triangles with hills. The lean of the hills makes overhangs, and reaches over the tile's edge.
fn sheet(n: u32, lean: f32) -> TileMesh {
    let at = |i: u32, j: u32| {
        let p = Vec2::new(i as f32, j as f32) / n as f32;
        let (x, y) = ((6.283_185_5 * p.x).sin(), (12.566_371 * p.y).cos());
        let z = 0.2 * x * y + 0.03 * (31.4 * p.x * p.y).sin() * (1.0 - p.x) * p.x * (1.0 - p.y) * p.y;
        (p * SIZE).extend(z) + Vec3::new(lean * z, 0.4 * lean * z, 0.0)
    };
    let mut mesh = TileMesh { size: SIZE, ..TileMesh::default() };
    for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

/// Triangles anywhere, of any size, some beyond the tile's edge and some that block nothing.
fn soup(count: usize, seed: u64) -> TileMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut mesh = TileMesh { size: SIZE, ..TileMesh::default() };
    for k in 0..count {
        let mut random = || Vec3::new(rng.random(), rng.random(), rng.random());
        let (at, side) = (2.0 * random() - 0.5, if k % 7 == 0 { 0.8 } else { 0.15 });
        let first = mesh.positions.len() as u32;
        let mut corners = [at, at + side * (random() - 0.5), at + side * (random() - 0.5)];
        match k % 23 {
            3 => corners[1].y = f32::NAN,
            5 => corners[2] = corners[0],
            _ => {}
        }
        mesh.positions.extend(corners);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

fn hierarchy(mesh: &TileMesh) -> TileHierarchy {
    let corners: Vec<[Vec3; 3]> = (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle)).collect();
    TileHierarchy::new(&corners, mesh.size)
}

/// Distance at which a ray meets a triangle, and how far inside of all edges the point lies.
fn meets(origin: DVec3, to: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, f64)> {
    let (ab, ac) = (b - a, c - a);
    let p = to.cross(ac);
    let determinant = ab.dot(p);
    let offset = origin - a;
    let (v, q) = (offset.dot(p) / determinant, offset.cross(ab));
    let (w, t) = (to.dot(q) / determinant, ac.dot(q) / determinant);
    let inside = v.min(w).min(1.0 - v - w);
    (inside > -1e-3 && t > -1e-3).then_some((t, inside))
}

/// The first hit among all copies within some tiles, as distance and triangle; `None` also if edges, the start or the end of the
/// ray are so close that rounding decides.
fn brute_force(mesh: &TileMesh, origin: Vec3, to: Vec3, own: u32, end: f64) -> Option<Option<(f64, u32)>> {
    const COPIES: i32 = 5;
    let mut best: Option<(f64, u32)> = None;
    for triangle in 0..mesh.triangles.len() {
        for (i, j) in (-COPIES..=COPIES).flat_map(|j| (-COPIES..=COPIES).map(move |i| (i, j))) {
            let shift = (DVec2::new(f64::from(i), f64::from(j)) * SIZE.as_dvec2()).extend(0.0);
            let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3() + shift);
            let Some((t, inside)) = meets(origin.as_dvec3(), to.as_dvec3(), corners) else { continue };
            if t > end || (triangle as u32 == own && (i, j) == (0, 0)) {
                continue;
            }
            if inside < 1e-3 || t < 1e-3 {
                return None;
            }
            best = Some((t, triangle as u32)).filter(|hit| best.is_none_or(|best| hit.0 < best.0)).or(best);
        }
    }
    Some(best)
}

#[test]
fn rays_hit_what_a_loop_over_all_triangles_and_copies_hits() {
    for (mesh, seed) in [(soup(90, 3), 1), (soup(5, 4), 2), (sheet(6, 0.0), 3), (sheet(6, 2.5), 4)] {
        let rays = hierarchy(&mesh);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (mut compared, mut hits) = (0, 0);
        for k in 0..600 {
            let mut random = || rng.random::<f32>();
            let origin = Vec3::new(random() * SIZE.x, random() * SIZE.y, 1.4 * random() - 0.4);
            let mut to = 2.0 * Vec3::new(random(), random(), random()) - Vec3::ONE;
            match k % 10 {
                0 => to = Vec3::Z,
                1 => to.x = 0.0,
                2 => to = Vec3::Y,
                _ => {}
            }
            // Longer rays could leave the copies.
            let Some(to) = to.try_normalize() else { continue };
            let end = 2.0;
            let Some(expected) = brute_force(&mesh, origin, to, u32::MAX, f64::from(end)) else { continue };
            let found = rays.first_hit(origin, to, u32::MAX, end);
            let found = found.map(|hit| (f64::from((hit.position - origin).length()), hit.triangle));
            assert_eq!(found.map(|hit| hit.1), expected.map(|hit| hit.1), "ray {k} of {seed}: {origin} {to}");
            assert!(found.zip(expected).is_none_or(|(a, b)| (a.0 - b.0).abs() < 1e-4), "{found:?} {expected:?}");
            assert_eq!(rays.is_blocked(origin, to, u32::MAX, end), expected.is_some());
            compared += 1;
            hits += u32::from(expected.is_some());
        }
        assert!(compared > 300 && (15..compared - 15).contains(&hits), "{seed}: {hits} of {compared}");
    }
}

#[test]
fn a_ray_ignores_its_own_triangle_but_not_the_copies_of_it() {
    let positions = vec![Vec3::new(0.3, 0.1, 0.0), Vec3::new(0.3, 0.6, 0.0), Vec3::new(0.3, 0.35, 0.5)];
    let mesh = TileMesh { size: SIZE, positions, triangles: vec![[0, 1, 2]], ..TileMesh::default() };
    let rays = hierarchy(&mesh);
    let on = Vec3::new(0.3, 0.35, 0.2);
    for to in [Vec3::X, Vec3::NEG_X] {
        let hit = rays.first_hit(on, to, 0, 10.0).unwrap();
        assert!((hit.position - on - to * SIZE.x).length() < 1e-5, "{}", hit.position);
        assert!(!rays.is_blocked(on, to, 0, 0.9) && rays.is_blocked(on - 0.2 * to, to, 0, 0.9));
    }
}

#[test]
fn an_empty_tile_blocks_nothing() {
    let mesh = TileMesh { size: SIZE, ..TileMesh::default() };
    let grid = PeriodicGrid::new(&mesh);
    assert!(!grid.is_blocked(Vec3::ZERO, Vec3::Z, 0));
    assert!(grid.first_hit(Vec3::ZERO, Vec3::new(0.6, 0.0, -0.8), 0, -1.0).is_none());
    assert!(grid.nearest(Vec3::Z, Vec3::new(0.6, 0.0, -0.8), -1.0).is_none());
}

/// Shoots rays at points of edges and at corners of closed sheets, and returns how many pass.
fn leaks(count: u64) -> u64 {
    let sheets = [sheet(5, 0.0), sheet(16, 0.0), sheet(16, 2.5)].map(|mesh| (PeriodicGrid::new(&mesh), mesh));
    const RAYS_PER_TASK: u64 = 10_000;
    let task = |task: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(task);
        let (grid, mesh) = &sheets[task as usize % sheets.len()];
        let (bottom, top) = mesh.z_range();
        let ray = |k: u64| {
            let corners = mesh.corners(rng.random_range(0..mesh.triangles.len()));
            let (a, b) = (corners[k as usize % 3], corners[(k as usize + 1) % 3]);
            let at = if k.is_multiple_of(4) { a } else { a + (b - a) * rng.random::<f32>() };
            let cosine = 0.05 + 0.95 * rng.random::<f32>();
            let azimuth = 6.283_185_5 * rng.random::<f32>();
            let to = (Vec2::from_angle(azimuth) * (1.0 - cosine * cosine).max(0.0).sqrt()).extend(-cosine);
            let origin = at - to * ((top - at.z + 0.1) / cosine);
            u64::from(grid.nearest(origin, to, bottom).is_none())
        };
        (0..RAYS_PER_TASK).map(ray).sum::<u64>()
    };
    (0..count / RAYS_PER_TASK).into_par_iter().map(task).sum()
}

#[test]
fn no_ray_of_a_million_passes_through_an_edge_or_a_corner_of_a_closed_tile() {
    assert_eq!(leaks(1_000_000), 0);
}

#[test]
#[ignore = "a minute on two cores"]
fn no_ray_of_a_hundred_million_passes_through_an_edge_or_a_corner_of_a_closed_tile() {
    assert_eq!(leaks(100_000_000), 0);
}

#[test]
fn long_triangles_do_not_enlarge_the_short_ones_that_share_their_packet() {
    let mut mesh = TileMesh { size: Vec2::ONE, ..TileMesh::default() };
    let (low, high) = (0.498, 0.502);
    mesh.positions.extend([Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
    mesh.positions.extend([Vec3::new(low, low, 0.3), Vec3::new(high, low, 0.3), Vec3::new(0.5, high, 0.3)]);
    mesh.triangles.extend([[0, 1, 2], [0, 2, 3], [4, 5, 6]]);
    let hierarchy = hierarchy(&mesh);
    let is_blocked = |y: f32| hierarchy.is_blocked(Vec3::new(0.5, y, 0.1), Vec3::new(0.0, 1e-4, 1.0), 0, 10.0);
    assert!(is_blocked(low + 2e-5) && !is_blocked(low - 6e-5));
}
