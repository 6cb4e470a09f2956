//! Small periodic tiles with slopes, edges and overhangs.

use glam::{Vec2, Vec3};

use crate::geometry::TileMesh;

fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> TileMesh {
    let slots = vec![0; triangles.len()];
    TileMesh {
        size: Vec2::ONE,
        positions,
        triangles,
        triangle_slot: slots,
        slots: vec!["default".into()],
        ..TileMesh::default()
    }
}

/// A height field of n x n samples with two triangles per cell. The last row and column join the next tile.
fn height_field(n: u32, height: impl Fn(f32, f32) -> f32) -> TileMesh {
    let at = |k: u32| (k as f32 + 0.5) / n as f32;
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
    let positions = positions.map(|(i, j)| Vec3::new(at(i), at(j), height(at(i % n), at(j % n)))).collect();
    let triangles = (0..n).flat_map(|j| (0..n).map(move |i| j * (n + 1) + i));
    let triangles = triangles.flat_map(|k| [[k, k + 1, k + n + 2], [k, k + n + 2, k + n + 1]]).collect();
    mesh(positions, triangles)
}

pub fn egg_crate(n: u32) -> TileMesh {
    let wave = |x: f32| (std::f32::consts::TAU * x).sin();
    height_field(n, move |x, y| 0.15 * wave(x) * wave(y))
}

/// A height field without symmetry, steeper than the egg-crate.
pub fn dunes(n: u32) -> TileMesh {
    let tau = std::f32::consts::TAU;
    height_field(n, move |x, y| {
        0.12 * (tau * (x + 2.0 * y)).sin()
            + 0.08 * (tau * (3.0 * x - y) + 1.0).sin()
            + 0.03 * (tau * (5.0 * y + 4.0 * x)).cos()
    })
}

/// Four V-grooves of 45° along y, with triangles as long as the tile.
pub fn v_grooves() -> TileMesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for k in 0..8u32 {
        let (x0, x1) = (k as f32 / 8.0, (k + 1) as f32 / 8.0);
        let (z0, z1) = if k % 2 == 0 { (0.0, 0.125) } else { (0.125, 0.0) };
        let base = positions.len() as u32;
        positions.extend([
            Vec3::new(x0, 0.0, z0),
            Vec3::new(x1, 0.0, z1),
            Vec3::new(x1, 1.0, z1),
            Vec3::new(x0, 1.0, z0),
        ]);
        triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }
    mesh(positions, triangles)
}

/// Nine leaning, closed rods with twelve sides over a floor of two triangles. The rods overhang and cross the tile's
/// edge.
pub fn rods() -> TileMesh {
    let mut positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
    for k in 0..9u32 {
        let foot = Vec3::new((k % 3) as f32 / 3.0 + 0.05, (k / 3) as f32 / 3.0 + 0.1, 0.0);
        let lean = 0.6 * k as f32;
        let top = foot + Vec3::new(0.3 * lean.cos(), 0.3 * lean.sin(), 0.4);
        let base = positions.len() as u32;
        for end in [foot, top] {
            positions.extend((0..12).map(|side| {
                let angle = std::f32::consts::TAU * side as f32 / 12.0;
                end + 0.06 * Vec3::new(angle.cos(), angle.sin(), 0.0)
            }));
        }
        positions.push(top);
        for side in 0..12 {
            let (a, b) = (base + side, base + (side + 1) % 12);
            triangles.extend([[a, b, b + 12], [a, b + 12, a + 12], [a + 12, b + 12, base + 24]]);
        }
    }
    mesh(positions, triangles)
}

/// A square pillar with vertical walls on a floor.
pub fn pillar() -> TileMesh {
    let ring = |half: f32, z: f32| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(0.5 + half * x, 0.5 + half * y, z))
    };
    let positions = [ring(0.5, 0.0), ring(0.2, 0.0), ring(0.2, 0.3)].concat();
    let mut triangles = vec![[8, 9, 10], [8, 10, 11]];
    for side in 0..4 {
        let next = (side + 1) % 4;
        for low in [0, 4] {
            let (a, b) = (low + side, low + next);
            triangles.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
        }
    }
    mesh(positions, triangles)
}

/// [`pillar`] with one vertex that is not finite and one far outside the tile.
pub fn broken_pillar() -> TileMesh {
    let mut mesh = pillar();
    mesh.positions[3] = Vec3::new(f32::NAN, 0.0, f32::INFINITY);
    mesh.positions[9] = Vec3::new(-3.0, 5.0, -2.0);
    mesh
}
