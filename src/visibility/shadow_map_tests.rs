//! Shadow maps, on both routes, against exact ray casting.

use std::time::Instant;

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::{GpuShadowMaps, PackedVisibility, visibility_maps_cpu, visibility_maps_gpu};
use crate::geometry::{Facets, TileMesh};
use crate::gpu::Gpu;

mod meshes {
    use super::*;

    fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> TileMesh {
        let slots = vec![0; triangles.len()];
        TileMesh { size: Vec2::ONE, positions, triangles, triangle_slot: slots, slots: vec!["default".into()], ..TileMesh::default() }
    }

    /// A height-field of n x n samples as two triangles a cell, the last row and column joined to the next tile.
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

    /// Steeper than the egg-crate, with no symmetry.
    pub fn dunes(n: u32) -> TileMesh {
        let tau = std::f32::consts::TAU;
        height_field(n, move |x, y| {
            0.12 * (tau * (x + 2.0 * y)).sin() + 0.08 * (tau * (3.0 * x - y) + 1.0).sin() + 0.03 * (tau * (5.0 * y + 4.0 * x)).cos()
        })
    }

    /// Four V-grooves of 45° along y: triangles as long as the tile.
    pub fn v_grooves() -> TileMesh {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for k in 0..8u32 {
            let (x0, x1) = (k as f32 / 8.0, (k + 1) as f32 / 8.0);
            let (z0, z1) = if k % 2 == 0 { (0.0, 0.125) } else { (0.125, 0.0) };
            let base = positions.len() as u32;
            positions.extend([Vec3::new(x0, 0.0, z0), Vec3::new(x1, 0.0, z1), Vec3::new(x1, 1.0, z1), Vec3::new(x0, 1.0, z0)]);
            triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        }
        mesh(positions, triangles)
    }

    /// Nine leaning, closed, twelve-sided rods over a floor of two triangles; they overhang and cross the tile's edge.
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
                    let turn = std::f32::consts::TAU * side as f32 / 12.0;
                    end + 0.06 * Vec3::new(turn.cos(), turn.sin(), 0.0)
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
}

/// n samples of the mesh: systematic over the area, an R2 point in each triangle.
fn sample(mesh: &TileMesh, n: usize) -> Facets {
    let areas: Vec<f64> = (0..mesh.triangles.len()).map(|k| mesh.triangle_area(k)).collect();
    let total: f64 = areas.iter().sum();
    let (mut facets, mut triangle, mut before) = (Facets::default(), 0, 0.0);
    for k in 0..n {
        let target = (k as f64 + 0.5) / n as f64 * total;
        while before + areas[triangle] < target {
            before += areas[triangle];
            triangle += 1;
        }
        let (u, v) = ((0.5 + 0.754_877_67 * k as f64).fract(), (0.5 + 0.569_840_29 * k as f64).fract());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let [a, b, c] = mesh.corners(triangle);
        let p = a + u as f32 * (b - a) + v as f32 * (c - a);
        facets.positions.push(Vec3::new(p.x.rem_euclid(mesh.size.x), p.y.rem_euclid(mesh.size.y), p.z));
        let normal = mesh.geometric_normal(triangle);
        facets.normals.push(normal);
        facets.geometric_normals.push(normal);
        facets.areas.push((total / n as f64) as f32);
        facets.triangles.push(triangle as u32);
    }
    facets
}

/// Directions of a polar grid, `θ = (a + ½) 90° / rings`, up to a zenith angle.
fn polar_directions(rings: usize, azimuths: usize, up_to_deg: f32) -> Vec<Vec3> {
    let thetas = (0..rings).map(|a| (a as f32 + 0.5) * 90.0 / rings as f32).filter(|&theta| theta <= up_to_deg);
    thetas.flat_map(|theta| (0..azimuths).map(move |b| direction(theta, 360.0 * (b as f32 + 0.37) / azimuths as f32))).collect()
}

fn direction(theta_deg: f32, phi_deg: f32) -> Vec3 {
    let (theta, phi) = (theta_deg.to_radians(), phi_deg.to_radians());
    Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

/// Exact ray casting through explicit copies of the tile, in f64: a grid over the tile lists the triangles above each
/// cell, and the ray walks its cells from tile to tile until it is above everything.
struct RayCaster<'a> {
    mesh: &'a TileMesh,
    cells: i64,
    /// Per cell: triangle and the tile copy of it that overlaps.
    lists: Vec<Vec<(u32, [i64; 2])>>,
}

impl<'a> RayCaster<'a> {
    fn new(mesh: &'a TileMesh, cells: i64) -> Self {
        let mut lists = vec![Vec::new(); (cells * cells) as usize];
        for k in 0..mesh.triangles.len() {
            let corners = mesh.corners(k).map(|p| p.truncate().as_dvec2() / mesh.size.as_dvec2() * cells as f64);
            let lo = corners.iter().fold(DVec2::INFINITY, |m, p| m.min(*p)).floor();
            let hi = corners.iter().fold(DVec2::NEG_INFINITY, |m, p| m.max(*p)).floor();
            for y in lo.y as i64 - 1..=hi.y as i64 + 1 {
                for x in lo.x as i64 - 1..=hi.x as i64 + 1 {
                    let cell = y.rem_euclid(cells) * cells + x.rem_euclid(cells);
                    lists[cell as usize].push((k as u32, [-x.div_euclid(cells), -y.div_euclid(cells)]));
                }
            }
        }
        Self { mesh, cells, lists }
    }

    fn is_blocked(&self, p: Vec3, own: u32, direction: Vec3) -> bool {
        let (p, w) = (p.as_dvec3(), direction.as_dvec3().normalize());
        let top = f64::from(self.mesh.z_range().1);
        let cell_size = self.mesh.size.as_dvec2() / self.cells as f64;
        let end = (top - p.z) / w.z;
        let mut t = 0.0;
        let mut cell = (p.truncate() / cell_size).floor();
        loop {
            let (cx, cy) = (cell.x as i64, cell.y as i64);
            let tile = [cx.div_euclid(self.cells), cy.div_euclid(self.cells)];
            let list = cy.rem_euclid(self.cells) * self.cells + cx.rem_euclid(self.cells);
            for &(k, copy) in &self.lists[list as usize] {
                let shift = [tile[0] + copy[0], tile[1] + copy[1]];
                let offset = (DVec2::new(shift[0] as f64, shift[1] as f64) * self.mesh.size.as_dvec2()).extend(0.0);
                let [a, b, c] = self.mesh.corners(k as usize).map(|corner| corner.as_dvec3() + offset);
                if let Some(hit) = moller_trumbore(p, w, a, b, c) {
                    // The facet's own triangle, but not the copies of it further on, lies at distance 0 up to rounding.
                    let is_own = k == own && hit < 1e-5;
                    
                    if hit > 1e-7 && !is_own {
                        return true;
                    }
                }
            }
            let next = DVec2::select(w.truncate().cmpgt(DVec2::ZERO), cell + 1.0, cell) * cell_size;
            let until = (next - p.truncate()) / w.truncate();
            let until = DVec2::select(w.truncate().cmpeq(DVec2::ZERO), DVec2::INFINITY, until);
            if until.x <= until.y {
                cell.x += w.x.signum();
                t = until.x.max(t);
            } else {
                cell.y += w.y.signum();
                t = until.y.max(t);
            }
            if t > end {
                return false;
            }
        }
    }

    fn visibility(&self, facets: &Facets, directions: &[Vec3]) -> PackedVisibility {
        use rayon::prelude::*;
        let mut visibility = PackedVisibility::new(facets.len(), directions.len());
        let words = visibility.words_per_row();
        visibility.words.par_chunks_mut(words).zip(directions).for_each(|(row, &w)| {
            for s in 0..facets.len() {
                if facets.geometric_normals[s].dot(w) > 0.0 && !self.is_blocked(facets.positions[s], facets.triangles[s], w) {
                    row[s / 32] |= 1 << (s % 32);
                }
            }
        });
        visibility
    }
}

/// Distance along `w` at which the ray from `p` meets the triangle, from either side.
fn moller_trumbore(p: DVec3, w: DVec3, a: DVec3, b: DVec3, c: DVec3) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let h = w.cross(ac);
    let det = ab.dot(h);
    if det == 0.0 {
        return None;
    }
    let s = (p - a) / det;
    let u = s.dot(h);
    let q = s.cross(ab);
    let v = w.dot(q);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| ac.dot(q))
}

/// Cosine-weighted share of the facet-direction pairs that face each other in which two routes disagree.
fn disagreement(facets: &Facets, directions: &[Vec3], a: &PackedVisibility, b: &PackedVisibility) -> f64 {
    let (mut differ, mut all) = (0.0, 0.0);
    for (d, &w) in directions.iter().enumerate() {
        for s in 0..facets.len() {
            let weight = f64::from(facets.geometric_normals[s].dot(w).max(0.0) * facets.areas[s]);
            all += weight;
            differ += weight * f64::from(a.is_visible(d, s) != b.is_visible(d, s));
        }
    }
    differ / all
}

/// `a_v(ω) / (A cos θ)` of one direction.
fn projected_area_ratio(mesh: &TileMesh, facets: &Facets, w: Vec3, d: usize, v: &PackedVisibility) -> f64 {
    let seen = (0..facets.len()).filter(|&s| v.is_visible(d, s));
    let area: f64 = seen.map(|s| f64::from(facets.geometric_normals[s].dot(w).max(0.0) * facets.areas[s])).sum();
    area / f64::from(mesh.base_area() * w.z)
}

#[test]
#[ignore = "a table of error and time against resolution; run with --ignored --nocapture"]
fn resolution_against_error() {
    let directions = polar_directions(18, 24, 85.0);
    let bands = [(0.0, 60.0), (60.0, 80.0), (80.0, 85.0)];
    println!("{:<10} {:>9} {:>5} | {:>7} | {:>7} {:>7} {:>7} | {:>8} {:>8}", "tile", "triangles", "res", "all %", "<60", "60-80", "80-85", "ms/dir", "Mtri/s");
    for (name, mesh) in [
        ("egg-crate", meshes::egg_crate(128)),
        ("dunes", meshes::dunes(128)),
        ("V-grooves", meshes::v_grooves()),
        ("rods", meshes::rods()),
        ("pillar", meshes::pillar()),
    ] {
        let facets = sample(&mesh, 4000);
        let exact = RayCaster::new(&mesh, if mesh.triangles.len() > 10_000 { 128 } else { 32 }).visibility(&facets, &directions);
        for resolution in [128, 256, 512, 1024, 2048] {
            let start = Instant::now();
            let maps = visibility_maps_cpu(&mesh, &facets, &directions, resolution);
            let seconds = start.elapsed().as_secs_f64();
            let of = |keep: &dyn Fn(f32) -> bool| {
                let (mut differ, mut all) = (0.0, 0.0);
                for (d, &w) in directions.iter().enumerate().filter(|(_, w)| keep(w.z.acos().to_degrees())) {
                    for s in 0..facets.len() {
                        let weight = f64::from(facets.geometric_normals[s].dot(w).max(0.0));
                        all += weight;
                        differ += weight * f64::from(maps.is_visible(d, s) != exact.is_visible(d, s));
                    }
                }
                100.0 * differ / all
            };
            let [a, b, c] = bands.map(|(lo, hi)| of(&|theta| theta >= lo && theta < hi));
            let all = 100.0 * disagreement(&facets, &directions, &maps, &exact);
            let per_direction = seconds / directions.len() as f64;
            println!(
                "{name:<10} {:>9} {resolution:>5} | {all:>7.3} | {a:>7.3} {b:>7.3} {c:>7.3} | {:>8.3} {:>8.2}",
                mesh.triangles.len(),
                1e3 * per_direction,
                1e-6 * mesh.triangles.len() as f64 / per_direction
            );
        }
        let worst = (0..directions.len()).map(|d| (projected_area_ratio(&mesh, &facets, directions[d], d, &exact) - 1.0).abs());
        println!("{name}: exact a_v / (A cos θ) is off by at most {:.2} % with these facets", 100.0 * worst.fold(0.0, f64::max));
    }
}

/// The device, or a loud word that its tests are skipped.
fn open_gpu() -> Option<Gpu> {
    Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok()
}

fn all_meshes() -> [(&'static str, TileMesh, u32); 5] {
    [
        ("egg-crate", meshes::egg_crate(64), 256),
        ("dunes", meshes::dunes(64), 256),
        ("V-grooves", meshes::v_grooves(), 256),
        ("rods", meshes::rods(), 512),
        ("pillar", meshes::pillar(), 256),
    ]
}

#[test]
fn maps_agree_with_exact_rays_within_three_in_a_thousand_up_to_85_degrees() {
    let directions = polar_directions(9, 5, 85.0);
    for (name, mesh, resolution) in all_meshes() {
        let facets = sample(&mesh, 1200);
        let exact = RayCaster::new(&mesh, 32).visibility(&facets, &directions);
        let maps = visibility_maps_cpu(&mesh, &facets, &directions, resolution);
        let error = disagreement(&facets, &directions, &maps, &exact);
        assert!(error < 3e-3, "{name}: {:.3} %", 100.0 * error);
    }
}

#[test]
fn the_gpu_answers_as_the_cpu_does() {
    let Some(gpu) = open_gpu() else { return };
    let pipelines = GpuShadowMaps::new(&gpu).unwrap();
    let mut directions = polar_directions(9, 5, 85.0);
    directions.extend([direction(89.9, 40.0), Vec3::X, Vec3::NEG_Z, Vec3::NAN, Vec3::Z]);
    for (name, mesh, _) in all_meshes() {
        let facets = sample(&mesh, 1201);
        let cpu = visibility_maps_cpu(&mesh, &facets, &directions, 128);
        let gpu = pipelines.visibility(&gpu, &mesh, &facets, &directions, 128).unwrap();
        let differ = disagreement(&facets, &directions[..45], &gpu, &cpu);
        // Texels whose centre lies on an edge up to rounding, and ties in height.
        assert!(differ < 3e-4, "{name}: {:.4} %", 100.0 * differ);
        assert!(gpu.row(46).iter().chain(gpu.row(47)).chain(gpu.row(48)).all(|&word| word == 0), "{name}");
    }
}

#[test]
fn projected_area_is_base_area_times_cosine_up_to_grazing() {
    let mesh = meshes::egg_crate(64);
    let facets = sample(&mesh, 40_000);
    for (theta, tolerance) in [(0.0, 0.002), (45.0, 0.003), (75.0, 0.005), (85.0, 0.01), (89.0, 0.05)] {
        let directions: Vec<Vec3> = (0..4).map(|k| direction(theta, 13.0 + 90.0 * k as f32 / 4.0)).collect();
        let maps = visibility_maps_cpu(&mesh, &facets, &directions, 512);
        for (d, &w) in directions.iter().enumerate() {
            let ratio = projected_area_ratio(&mesh, &facets, w, d, &maps);
            assert!((ratio - 1.0).abs() < tolerance, "{theta}°, {d}: {ratio}");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mesh = meshes::rods();
    let (facets, directions) = (sample(&mesh, 500), polar_directions(5, 6, 90.0));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| visibility_maps_cpu(&mesh, &facets, &directions, 100))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn broken_meshes_and_no_facets_do_not_panic() {
    let directions = polar_directions(3, 3, 90.0);
    let whole = meshes::pillar();
    let facets = sample(&whole, 10);
    let mut broken = whole.clone();
    broken.positions[3] = Vec3::new(f32::NAN, 0.0, f32::INFINITY);
    broken.positions[9] = Vec3::new(-3.0, 5.0, -2.0);
    assert_eq!(visibility_maps_cpu(&broken, &facets, &directions, 50).direction_count, 9);
    let empty = TileMesh { size: Vec2::ONE, ..TileMesh::default() };
    assert_eq!(visibility_maps_cpu(&empty, &Facets::default(), &directions, 50).facet_count, 0);
    assert!(visibility_maps_cpu(&empty, &facets, &[Vec3::Z], 50).is_visible(0, 0));
    let Some(gpu) = open_gpu() else { return };
    visibility_maps_gpu(&gpu, &broken, &facets, &directions, 50).unwrap();
    assert!(visibility_maps_gpu(&gpu, &empty, &facets, &[Vec3::Z], 50).unwrap().is_visible(0, 0));
}

#[test]
#[ignore = "a table of speed on both routes; run with --ignored --nocapture"]
fn speed_of_both_routes() {
    let Some(gpu) = open_gpu() else { return };
    println!("{}, tier {:?}", gpu.description(), gpu.tier);
    let pipelines = GpuShadowMaps::new(&gpu).unwrap();
    let directions = polar_directions(9, 32, 85.0);
    for (name, mesh) in [("egg-crate 128", meshes::egg_crate(128)), ("rods", meshes::rods()), ("V-grooves", meshes::v_grooves())] {
        let facets = sample(&mesh, 8000);
        for resolution in [256, 512, 1024] {
            let time = |run: &dyn Fn() -> PackedVisibility| {
                run();
                let mut times: Vec<f64> = (0..3)
                    .map(|_| {
                        let start = Instant::now();
                        run();
                        start.elapsed().as_secs_f64()
                    })
                    .collect();
                times.sort_by(f64::total_cmp);
                times[1]
            };
            let cpu = time(&|| visibility_maps_cpu(&mesh, &facets, &directions, resolution));
            let device = time(&|| pipelines.visibility(&gpu, &mesh, &facets, &directions, resolution).unwrap());
            let triangles = 1e-6 * (mesh.triangles.len() * directions.len()) as f64;
            let pairs = 1e-6 * (facets.len() * directions.len()) as f64;
            for (route, seconds) in [("cpu", cpu), ("gpu", device)] {
                println!(
                    "{name:<14} {resolution:>5} {route}: {:>8.2} ms/direction, {:>8.3} Mtriangles/s, {:>7.2} M facet-direction pairs/s",
                    1e3 * seconds / directions.len() as f64,
                    triangles / seconds,
                    pairs / seconds
                );
            }
        }
    }
}
