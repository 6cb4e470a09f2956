//! Rays per second through the endless tilings of five tiles.

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use biscale::geometry::{self, Facets, PeriodicGrid, TileMesh, lifted_origins};
use biscale::scene;
use glam::{Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const RAYS: usize = 1 << 16;
/// Repetitions, of which the fastest counts: other programs disturb the others.
const REPEATS: usize = 15;
const TAU: f32 = std::f32::consts::TAU;

/// The origins, directions and triangles of rays.
type Rays = Vec<(Vec3, Vec3, u32)>;

/// Prints millions of rays per second on one thread. With a folder, also writes the tiles and the rays there, for
/// `benches/embree_rays.py`.
///
/// # Errors
/// A scene cannot be opened, or a file cannot be written.
pub fn rays(folder: Option<&str>, print: &mut dyn FnMut(String)) -> Result<(), String> {
    print("| tile | triangles | hierarchy | blocked: one direction | any direction | first hit: one direction | any direction |".to_owned());
    print("|---|---|---|---|---|---|---|".to_owned());
    for (name, mesh) in tiles()? {
        let grid = PeriodicGrid::new(&mesh);
        let start = Instant::now();
        black_box(grid.is_blocked(Vec3::ZERO, Vec3::Z, 0));
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        let bottom = mesh.z_range().0;
        let facets = Facets::sample(&mesh, RAYS, 1);
        let blocked = [along_one_direction(&mesh, &facets), upwards(&mesh, &facets)];
        let hits = [from_a_camera(&mesh, grid.top()), reflected(&mesh, &facets)];
        let mut row = format!("| {name} | {} | {build_ms:.1} ms", mesh.triangles.len());
        for rays in &blocked {
            let speed = speed(rays, |(origin, to, own)| grid.is_blocked(origin, to, own));
            let _ = write!(row, " | {speed:.1}");
        }
        for rays in &hits {
            let speed = speed(rays, |(origin, to, own)| grid.first_hit(origin, to, own, bottom).is_some());
            let _ = write!(row, " | {speed:.1}");
        }
        print(format!("{row} |"));
        if let Some(folder) = folder {
            let kinds = ["blocked_one", "blocked_any", "hit_one", "hit_any"];
            write_files(Path::new(folder), name, &mesh, kinds.into_iter().zip(blocked.iter().chain(&hits)))
                .map_err(|error| format!("{folder}: {error}"))?;
        }
    }
    Ok(())
}

/// Millions of rays per second.
fn speed(rays: &Rays, cast: impl Fn((Vec3, Vec3, u32)) -> bool) -> f64 {
    let mut shortest = f64::INFINITY;
    for _ in 0..REPEATS {
        let start = Instant::now();
        black_box(rays.iter().filter(|ray| cast(**ray)).count());
        shortest = shortest.min(start.elapsed().as_secs_f64());
    }
    rays.len() as f64 / shortest * 1e-6
}

fn tiles() -> Result<Vec<(&'static str, TileMesh)>, String> {
    let shipped = |name: &str| {
        let loaded = scene::open(name, &[]).map_err(|error| error.to_string())?;
        geometry::build(&loaded.scene.tile, &loaded.base_dir).map_err(|error| error.to_string())
    };
    Ok(vec![
        ("weave", shipped("fig7a_shot_silk")?),
        ("velvet", shipped("fig6a_velvet_spread")?),
        ("caps", caps(4)),
        ("perforated sheet", perforated(8)),
        ("scan", scan(224)),
    ])
}

fn mesh_of(quads: impl IntoIterator<Item = [Vec3; 4]>) -> TileMesh {
    let mut mesh = TileMesh { size: Vec2::ONE, slots: vec!["default".to_owned()], ..TileMesh::default() };
    for corners in quads {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh.triangle_slot = vec![0; mesh.triangles.len()];
    mesh
}

fn level(low: Vec2, high: Vec2, z: f32) -> [Vec3; 4] {
    [low.extend(z), Vec3::new(high.x, low.y, z), high.extend(z), Vec3::new(low.x, high.y, z)]
}

/// Stems with caps over a floor, `count` by `count`: each a profile that turns about its axis.
fn caps(count: usize) -> TileMesh {
    const SIDES: usize = 12;
    const PROFILE: [(f32, f32); 6] = [(0.1, 0.0), (0.1, 0.5), (0.42, 0.5), (0.38, 0.66), (0.24, 0.8), (0.0, 0.85)];
    let pitch = 1.0 / count as f32;
    let mut quads = vec![level(Vec2::ZERO, Vec2::ONE, 0.0)];
    for k in 0..count * count {
        let center = (Vec2::new((k % count) as f32, (k / count) as f32) + 0.5) * pitch;
        let at = |side: usize, (radius, z): (f32, f32)| {
            (center + Vec2::from_angle(TAU * side as f32 / SIDES as f32) * radius * pitch).extend(z * pitch)
        };
        for (side, rows) in (0..SIDES).flat_map(|side| PROFILE.windows(2).map(move |rows| (side, rows))) {
            quads.push([at(side, rows[0]), at(side + 1, rows[0]), at(side + 1, rows[1]), at(side, rows[1])]);
        }
    }
    mesh_of(quads)
}

/// A sheet with `count` by `count` square holes, over a floor.
fn perforated(count: usize) -> TileMesh {
    const THICKNESS: f32 = 0.03;
    const GAP: f32 = 0.06;
    let pitch = 1.0 / count as f32;
    let mut quads = vec![level(Vec2::ZERO, Vec2::ONE, 0.0)];
    for k in 0..count * count {
        let corner = Vec2::new((k % count) as f32, (k / count) as f32) * pitch;
        let square = |inset: f32| level(corner + inset * pitch, corner + (1.0 - inset) * pitch, GAP);
        let (outer, inner) = (square(0.0), square(0.25));
        let up = |point: Vec3| point + Vec3::Z * THICKNESS;
        for side in 0..4 {
            let (a, b, c, d) = (outer[side], outer[(side + 1) % 4], inner[(side + 1) % 4], inner[side]);
            quads.push([up(a), up(b), up(c), up(d)]);
            quads.push([d, c, b, a]);
            quads.push([up(d), up(c), c, d]);
        }
    }
    mesh_of(quads)
}

/// A sheet of `2 side²` triangles with random hills that lean over.
fn scan(side: usize) -> TileMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let waves: Vec<[f32; 4]> = (0..40)
        .map(|k| {
            let octave = 1.0 + (k / 4) as f32;
            let turn = Vec2::from_angle(TAU * rng.random::<f32>()) * octave * 1.5;
            [turn.x.round(), turn.y.round(), TAU * rng.random::<f32>(), 0.06 / octave]
        })
        .collect();
    let height = |p: Vec2| -> f32 {
        waves.iter().map(|[kx, ky, phase, height]| height * (TAU * (kx * p.x + ky * p.y) + phase).sin()).sum()
    };
    let at = |i: usize, j: usize| {
        let p = Vec2::new(i as f32, j as f32) / side as f32;
        let z = height(p);
        (p + Vec2::new(1.2, 0.5) * z).extend(z)
    };
    mesh_of((0..side * side).map(|k| {
        let (i, j) = (k % side, k / side);
        [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
    }))
}

/// From all facets that face it, along one direction.
fn along_one_direction(mesh: &TileMesh, facets: &Facets) -> Rays {
    let to = Vec3::new(0.5, 0.2, 0.6).normalize_or(Vec3::Z);
    let origins = lifted_origins(facets, mesh.size);
    let faces = |s: &usize| facets.normals[*s].dot(to) > 0.0;
    (0..facets.len()).filter(faces).map(|s| (origins[s], to, facets.triangles[s])).collect()
}

/// From all facets in random directions, by the cosine with the normal.
fn reflected(mesh: &TileMesh, facets: &Facets) -> Rays {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let origins = lifted_origins(facets, mesh.size);
    let ray = |s: usize| {
        let (x, y) = facets.normals[s].any_orthonormal_pair();
        let (radius, turn) = (rng.random::<f32>().sqrt(), Vec2::from_angle(TAU * rng.random::<f32>()));
        let up = (1.0 - radius * radius).sqrt();
        let to = (x * turn.x + y * turn.y) * radius + facets.normals[s] * up;
        (origins[s], to.normalize_or(Vec3::Z), facets.triangles[s])
    };
    (0..facets.len()).map(ray).collect()
}

/// Those of [`reflected`] that lead upwards.
fn upwards(mesh: &TileMesh, facets: &Facets) -> Rays {
    reflected(mesh, facets).into_iter().filter(|ray| ray.1.z > 0.01).collect()
}

/// Parallel rays from above, row by row.
fn from_a_camera(mesh: &TileMesh, top: f32) -> Rays {
    let to = Vec3::new(0.6, 0.3, -0.5).normalize_or(Vec3::NEG_Z);
    let side = RAYS.isqrt();
    let at = |k: usize| (Vec2::new((k % side) as f32, (k / side) as f32) + 0.5) / side as f32 * mesh.size;
    (0..side * side).map(|k| (at(k).extend(top) - 1e-3 * to, to, u32::MAX)).collect()
}

/// Writes a tile as OBJ and rays as rows of six little-endian f32: origin and direction.
fn write_files<'a>(
    folder: &Path,
    name: &str,
    mesh: &TileMesh,
    rays: impl Iterator<Item = (&'static str, &'a Rays)>,
) -> std::io::Result<()> {
    let name = name.replace(' ', "_");
    std::fs::create_dir_all(folder)?;
    let mut text = String::new();
    for p in &mesh.positions {
        let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
    }
    for [a, b, c] in &mesh.triangles {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    std::fs::write(folder.join(format!("{name}.obj")), text)?;
    for (kind, rays) in rays {
        let values = rays.iter().flat_map(|(origin, to, _)| origin.to_array().into_iter().chain(to.to_array()));
        let bytes: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
        std::fs::write(folder.join(format!("{name}.{kind}.rays")), bytes)?;
    }
    Ok(())
}
