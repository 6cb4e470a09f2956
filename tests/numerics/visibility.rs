//! Algorithms of visibility: against each other, against brute force, and the invariants of any tile.

use std::f32::consts::{FRAC_PI_2, TAU};

use biscale::brdf::{Brdf, Material, Term};
use biscale::effective::{Direct, EffectiveBrdf, FacetSum, Representation};
use biscale::geometry::families::heightfield;
use biscale::geometry::{
    FacetSampler, Facets, HeightGrid, PeriodicGrid, SampleShift, TileMesh, is_facet_visible, lifted_origins,
};
use biscale::math::directions::{PolarGrid, from_angles};
use biscale::metrics::mirror_biased_pairs;
use biscale::visibility::ray_cast;
use biscale::visibility::{HorizonMap, OcclusionIntervals, PackedVisibility, Visibility, visibility_maps_cpu};
use glam::{DVec3, UVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

fn mesh(size: Vec2, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> TileMesh {
    let triangle_slot = vec![0; triangles.len()];
    TileMesh {
        size,
        positions,
        triangles,
        triangle_slot,
        slots: vec!["default".into()],
        closes_plane: true,
        ..TileMesh::default()
    }
}

/// Returns a height field with its samples, whose cells are split along their lower diagonals.
fn height_field([w, h]: [u32; 2], height: impl Fn(f32, f32) -> f32) -> TileMesh {
    let at = |i: u32, j: u32| Vec2::new((i as f32 + 0.5) / w as f32, (j as f32 + 0.5) / h as f32);
    let heights: Vec<f32> = (0..w * h).map(|k| at(k % w, k / w)).map(|point| height(point.x, point.y)).collect();
    let sample = |i: u32, j: u32| at(i, j).extend(heights[(j % h * w + i % w) as usize]);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (i, j) in (0..h).flat_map(|j| (0..w).map(move |i| (i, j))) {
        let corners = [sample(i, j), sample(i + 1, j), sample(i + 1, j + 1), sample(i, j + 1)];
        let turn = u32::from(corners[0].z + corners[2].z > corners[1].z + corners[3].z);
        let corner = |k: u32| positions.len() as u32 + (k + turn) % 4;
        triangles.extend([[corner(0), corner(1), corner(2)], [corner(0), corner(2), corner(3)]]);
        positions.extend(corners);
    }
    TileMesh {
        height_grid: Some(HeightGrid { size: UVec2::new(w, h), heights }),
        ..mesh(Vec2::ONE, positions, triangles)
    }
}

fn dunes(n: u32) -> TileMesh {
    height_field([n, n], |x, y| {
        0.1 * (TAU * (x + 2.0 * y)).sin()
            + 0.06 * (TAU * (3.0 * x - y) + 1.0).sin()
            + 0.02 * (TAU * (5.0 * y + 4.0 * x)).cos()
    })
}

/// Returns a height field of independent random heights. On 12 x 12 samples, the root mean square of the slopes between
/// neighbours is 0.4.
fn noise(samples: [u32; 2]) -> TileMesh {
    let random = |x: f32, y: f32| {
        let seed = ((x * 4096.0) as u32) << 16 | (y * 4096.0) as u32;
        let bits = (seed ^ seed >> 15).wrapping_mul(0x2c1b_3c6d);
        ((bits ^ bits >> 12).wrapping_mul(0x297a_2d39) >> 8) as f32 / (1 << 24) as f32
    };
    height_field(samples, |x, y| 0.0816 * random(x, y))
}

/// Returns a slab on a leg over a floor. The slab overhangs the floor and crosses the edge of the tile.
fn tables() -> TileMesh {
    let mut positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
    let mut block = |low: Vec3, high: Vec3| {
        let base = positions.len() as u32;
        positions.extend((0..8).map(|k| Vec3::select(glam::BVec3::new(k & 1 == 1, k & 2 == 2, k & 4 == 4), high, low)));
        for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            triangles.extend([[base + a, base + b, base + c], [base + a, base + c, base + d]]);
        }
    };
    block(Vec3::new(0.55, 0.3, 0.25), Vec3::new(1.15, 0.8, 0.32));
    block(Vec3::new(0.8, 0.5, 0.0), Vec3::new(0.86, 0.56, 0.25));
    mesh(Vec2::ONE, positions, triangles)
}

/// Returns a flat floor with one wall that is eight times as high as the tile is wide.
fn wall() -> TileMesh {
    let positions = vec![
        Vec3::ZERO,
        Vec3::X,
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::Y,
        Vec3::new(0.5, 0.0, 0.0),
        Vec3::new(0.5, 1.0, 0.0),
        Vec3::new(0.5, 1.0, 8.0),
        Vec3::new(0.5, 0.0, 8.0),
    ];
    mesh(Vec2::ONE, positions, vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
}

fn sample(mesh: &TileMesh, count: usize) -> Facets {
    FacetSampler::new(mesh).sample(mesh, count, SampleShift::from_seed(3))
}

/// Returns directions up to 85° that lie on no grid.
fn directions(count: usize) -> Vec<Vec3> {
    (0..count)
        .map(|k| {
            from_angles(85_f32.to_radians() * ((k as f32 + 0.5) / count as f32), TAU * (0.618_034 * k as f32).fract())
        })
        .collect()
}

/// Returns the share of the projected area that is visible by one algorithm and not by the other.
fn disagreement(
    facets: &Facets,
    directions: &[Vec3],
    one: &PackedVisibility,
    other: impl Fn(usize, usize) -> bool,
) -> f64 {
    let (mut differ, mut all) = (0.0, 0.0);
    for (d, direction) in directions.iter().enumerate() {
        for s in 0..facets.len() {
            let weight = f64::from(facets.areas[s] * facets.normals[s].dot(*direction).max(0.0));
            all += weight;
            if one.is_visible(d, s) != other(d, s) {
                differ += weight;
            }
        }
    }
    differ / all
}

/// Returns the soft visibility of all facets, one row per direction.
fn visibility_rows(visibility: &Visibility, directions: &[Vec3]) -> Vec<Vec<f32>> {
    directions
        .iter()
        .map(|&direction| {
            let mut row = vec![0.0; visibility.facets()];
            visibility.fill(direction, 0..visibility.facets(), &mut row);
            row
        })
        .collect()
}

const AZIMUTHS: usize = 24;

/// Returns directions up to 85° on the azimuths of the horizon maps.
fn on_azimuths() -> Vec<Vec3> {
    (0..AZIMUTHS)
        .flat_map(|b| {
            (0..6).map(move |a| from_angles((7.0 + 15.6 * a as f32).to_radians(), TAU * b as f32 / AZIMUTHS as f32))
        })
        .collect()
}

#[test]
fn all_algorithms_agree_on_a_height_field_up_to_85_degrees() {
    let mesh = dunes(40);
    let facets = sample(&mesh, 1500);
    let grid = PeriodicGrid::new(&mesh);
    let directions = on_azimuths();
    let exact = ray_cast(&grid, &facets, &directions);
    let sharp = 1e-6;
    let heights = mesh.height_grid.as_ref().unwrap();
    let march = visibility_rows(
        &Visibility::HorizonMap(HorizonMap::march(heights, mesh.size, &facets, AZIMUTHS, sharp)),
        &directions,
    );
    let scan = visibility_rows(&Visibility::HorizonMap(HorizonMap::scan(&grid, &facets, AZIMUTHS, sharp)), &directions);
    let maps = visibility_maps_cpu(&mesh, &facets, &directions, 512);
    let marched = disagreement(&facets, &directions, &exact, |d, s| march[d][s] > 0.5);
    let scanned = disagreement(&facets, &directions, &exact, |d, s| scan[d][s] > 0.5);
    let mapped = disagreement(&facets, &directions, &exact, |d, s| maps.is_visible(d, s));
    eprintln!("height field: march {marched:.5}, scan {scanned:.5}, maps {mapped:.5}");
    assert!(marched < 0.003 && scanned < 0.003 && mapped < 0.003, "{marched} {scanned} {mapped}");
}

#[test]
fn all_algorithms_agree_under_overhangs_up_to_85_degrees() {
    let mesh = tables();
    let facets = sample(&mesh, 1500);
    let grid = PeriodicGrid::new(&mesh);
    let nodes = PolarGrid::new(10, AZIMUTHS);
    let soft = OcclusionIntervals::scan(&grid, &facets, AZIMUTHS, 1e-6).maps(nodes.rings);
    let on_nodes: Vec<Vec3> = (0..9 * AZIMUTHS).map(|node| nodes.direction(node)).collect();
    let exact = ray_cast(&grid, &facets, &on_nodes);
    let scanned = disagreement(&facets, &on_nodes, &exact, |d, s| soft.packed.is_visible(d, s));
    let maps = visibility_maps_cpu(&mesh, &facets, &on_nodes, 512);
    let mapped = disagreement(&facets, &on_nodes, &exact, |d, s| maps.is_visible(d, s));
    eprintln!("overhangs: scan {scanned:.5}, maps {mapped:.5}");
    assert!(scanned < 0.003 && mapped < 0.003, "{scanned} {mapped}");
}

/// Walks end where all that is left blocks slopes below 0.005. These directions are up to a third of a degree above the
/// horizon.
#[test]
fn what_walks_do_not_resolve_is_hidden_as_rays_find_it() {
    let low: Vec<Vec3> = (0..48)
        .map(|k| from_angles(90_f32.to_radians() - [0.002, 0.004, 0.006][k % 3], 0.4 + 0.731 * k as f32))
        .collect();
    for (name, mesh) in [("dunes", dunes(40)), ("tables", tables())] {
        let (facets, grid) = (sample(&mesh, 1500), PeriodicGrid::new(&mesh));
        let visibility = match &mesh.height_grid {
            Some(heights) => Visibility::HorizonMap(HorizonMap::march(heights, mesh.size, &facets, 48, 0.005)),
            None => Visibility::OcclusionIntervals(OcclusionIntervals::scan(&grid, &facets, 48, 0.005)),
        };
        let exact = ray_cast(&grid, &facets, &low);
        let rows = visibility_rows(&visibility, &low);
        let facing = |d: usize, s: usize| facets.normals[s].dot(low[d]) > 0.0;
        let share = |seen: &dyn Fn(usize, usize) -> f64| -> f64 {
            let facing =
                (0..low.len()).flat_map(|d| (0..facets.len()).map(move |s| (d, s))).filter(|&(d, s)| facing(d, s));
            let (sum, count) = facing.fold((0.0, 0.0), |(sum, count), (d, s)| (sum + seen(d, s), count + 1.0));
            sum / count
        };
        let (rays, walks) =
            (share(&|d, s| f64::from(u8::from(exact.is_visible(d, s)))), share(&|d, s| f64::from(rows[d][s])));
        eprintln!("{name}: rays see {rays:.4}, walks {walks:.4}");
        assert!((rays - walks).abs() < 0.03, "{name}: {rays} {walks}");
    }
}

/// Along axes and diagonals walks see a repetition, and end before all slopes are searched.
#[test]
fn along_directions_in_which_the_tile_repeats_walks_hide_what_rays_find_hidden() {
    let directions: Vec<Vec3> = (0..8)
        .flat_map(|b| {
            [0.003, 0.007, 0.012, 0.02, 0.035, 0.06, 0.1, 0.17, 0.3, 0.5, 0.9, 1.3]
                .map(|elevation| from_angles(FRAC_PI_2 - elevation, TAU * b as f32 / 8.0))
        })
        .collect();
    for (name, mesh) in [("tables", tables()), ("wall", wall())] {
        let (facets, grid) = (sample(&mesh, 1500), PeriodicGrid::new(&mesh));
        let exact = ray_cast(&grid, &facets, &directions);
        let rows = visibility_rows(
            &Visibility::OcclusionIntervals(OcclusionIntervals::scan(&grid, &facets, 8, 1e-4)),
            &directions,
        );
        let mut differ = vec![0; directions.len()];
        for (d, s) in (0..directions.len()).flat_map(|d| (0..facets.len()).map(move |s| (d, s))) {
            let faces = facets.normals[s].dot(directions[d]) > 0.0;
            differ[d] += usize::from(faces && exact.is_visible(d, s) != (rows[d][s] > 0.5));
        }
        let (worst, all) = (differ.iter().max().unwrap(), differ.iter().sum::<usize>());
        eprintln!("{name}: {all} differ, at most {worst} in one direction");
        assert!(*worst <= 8, "{name}: {differ:?}");
    }
}

#[test]
fn marching_over_the_samples_finds_the_horizons_of_the_sliced_mesh() {
    for mesh in [dunes(24), noise([12, 12]), noise([9, 16])] {
        check_march(&mesh);
    }
}

fn check_march(mesh: &TileMesh) {
    let facets = sample(mesh, 800);
    let heights = mesh.height_grid.as_ref().unwrap();
    // A wide transition turns differences of the horizon into differences of visibility.
    let transition_width = 0.04;
    let march = Visibility::HorizonMap(HorizonMap::march(heights, mesh.size, &facets, AZIMUTHS, transition_width));
    let scan = Visibility::HorizonMap(HorizonMap::scan(&PeriodicGrid::new(mesh), &facets, AZIMUTHS, transition_width));
    let directions = on_azimuths();
    let (march, scan) = (visibility_rows(&march, &directions), visibility_rows(&scan, &directions));
    let mut differ = 0;
    for (a, b) in march.iter().flatten().zip(scan.iter().flatten()) {
        differ += usize::from((a - b).abs() * transition_width > 2e-3);
    }
    let total = march.len() * facets.len();
    assert!(differ * 500 < total, "{differ} of {total} horizons differ by more than 2 mrad");
}

#[test]
fn height_fields_of_few_columns_and_thousands_of_rows_have_the_horizons_of_their_mesh() {
    let mesh = height_field([2, 4096], |x, y| 0.1 * (6.0 * TAU * y).sin() + 0.05 * x);
    let facets = sample(&mesh, 12);
    let heights = mesh.height_grid.as_ref().unwrap();
    let march = Visibility::HorizonMap(HorizonMap::march(heights, mesh.size, &facets, 1024, 0.04));
    let scan = Visibility::HorizonMap(HorizonMap::scan(&PeriodicGrid::new(&mesh), &facets, 1024, 0.04));
    let directions: Vec<Vec3> =
        (0..1024_u16).map(|k| from_angles(1.2 + 0.3 * f32::from(k % 7) / 7.0, TAU * f32::from(k) / 1024.0)).collect();
    let (march, scan) = (visibility_rows(&march, &directions), visibility_rows(&scan, &directions));
    let differ = march.iter().flatten().zip(scan.iter().flatten()).filter(|(a, b)| (*a - *b).abs() > 0.05).count();
    assert!(differ * 200 < march.len() * facets.len(), "{differ}");
}

/// Returns true if a ray hits a copy of the tile, up to `copies` tiles away. The intersection is that of Möller and
/// Trumbore (1997) in f64.
fn is_blocked(mesh: &TileMesh, origin: Vec3, to: Vec3, own_triangle: u32, copies: i32) -> bool {
    let (p, w) = (origin.as_dvec3(), to.as_dvec3());
    (-copies..=copies).any(|y| {
        (-copies..=copies).any(|x| {
            let shift = DVec3::new(f64::from(x) * f64::from(mesh.size.x), f64::from(y) * f64::from(mesh.size.y), 0.0);
            (0..mesh.triangles.len()).any(|t| {
                let [a, b, c] = mesh.corners(t).map(|v| v.as_dvec3() + shift);
                let (e1, e2) = (b - a, c - a);
                let q = w.cross(e2);
                let determinant = e1.dot(q);
                if determinant.abs() < 1e-14 {
                    return false;
                }
                let s = p - a;
                let u = s.dot(q) / determinant;
                let r = s.cross(e1);
                let v = w.dot(r) / determinant;
                let distance = e2.dot(r) / determinant;
                let lies_on = e1.cross(e2).normalize_or_zero().dot(s).abs() < 1e-4;
                u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 && !(t as u32 == own_triangle && lies_on)
            })
        })
    })
}

#[test]
fn ray_casting_is_the_brute_force_over_explicit_copies() {
    for (name, mesh, copies) in [("dunes", dunes(10), 5), ("tables", tables(), 5), ("wall", wall(), 9)] {
        let facets = sample(&mesh, 150);
        let grid = PeriodicGrid::new(&mesh);
        let origins = lifted_origins(&facets, mesh.size);
        let top = mesh.z_range().1;
        let (mut differ, mut all) = (0, 0);
        for direction in directions(60) {
            // A ray that leaves the copies below their highest point cannot be checked.
            if top * direction.truncate().length() / direction.z > copies as f32 - 1.0 {
                continue;
            }
            for (s, &origin) in origins.iter().enumerate() {
                if facets.normals[s].dot(direction) <= 0.0 {
                    continue;
                }
                all += 1;
                let blocked = is_blocked(&mesh, origin, direction, facets.triangles[s], copies);
                differ += usize::from(blocked == is_facet_visible(&grid, &facets, s, direction));
            }
        }
        assert!(all > 1000, "{name}: only {all} rays");
        assert!(differ * 2000 <= all, "{name}: {differ} of {all} rays");
    }
}

#[test]
fn a_tall_wall_shadows_tiles_far_away() {
    let mesh = wall();
    let facets = sample(&mesh, 400);
    let grid = PeriodicGrid::new(&mesh);
    // At 45° across the walls, every point of the floor is in the shadow of a wall; along the walls, none is.
    let across = ray_cast(&grid, &facets, &[from_angles(45_f32.to_radians(), 0.0)]);
    let along = ray_cast(&grid, &facets, &[from_angles(80_f32.to_radians(), TAU / 4.0)]);
    // At 0.02 rad from the direction of the walls, a ray reaches their height after 76 tiles along y and 1.5 across.
    let oblique = ray_cast(&grid, &facets, &[from_angles(84_f32.to_radians(), TAU / 4.0 - 0.02)]);
    for s in 0..facets.len() {
        if facets.normals[s].z > 0.9 {
            assert!(!across.is_visible(0, s) && along.is_visible(0, s), "facet {s} at {}", facets.positions[s]);
        }
    }
    let lit = (0..facets.len()).filter(|&s| facets.normals[s].z > 0.9 && oblique.is_visible(0, s)).count();
    assert_eq!(lit, 0);
}

#[test]
fn projected_area_is_base_area_times_cosine_within_half_a_percent_with_200_000_facets() {
    check_projected_area(200_000, 0.005);
}

fn check_projected_area(count: usize, tolerance: f64) {
    for (name, mesh) in [("dunes", dunes(48)), ("tables", tables())] {
        let facets = sample(&mesh, count);
        let grid = PeriodicGrid::new(&mesh);
        let worst = directions(18)
            .par_iter()
            .map(|&direction| {
                let area: f64 = (0..facets.len())
                    .filter(|&s| is_facet_visible(&grid, &facets, s, direction))
                    .map(|s| f64::from(facets.areas[s]) * f64::from(facets.normals[s].dot(direction)))
                    .sum();
                (area / f64::from(mesh.base_area() * direction.z) - 1.0).abs()
            })
            .reduce(|| 0.0, f64::max);
        eprintln!("{name}, {count} facets: a_v / (A cos) - 1 = {worst:.5} at worst");
        assert!(worst < tolerance, "{name}: {worst}");
    }
}

fn effective(mesh: &TileMesh, count: usize, term: Term, maps: bool) -> EffectiveBrdf {
    let mut facets = sample(mesh, count);
    facets.sort_for_sums();
    let grid = PeriodicGrid::new(mesh);
    let visibility = if maps {
        Visibility::OcclusionIntervals(OcclusionIntervals::scan(&grid, &facets, 48, 0.02))
    } else {
        Visibility::HorizonMap(HorizonMap::scan(&grid, &facets, 48, 0.02))
    };
    let material = Material { brdf: Brdf { terms: vec![term] }, color: Vec3::ONE };
    let representation =
        Representation::Direct(Direct::new(Arc::new(FacetSum::new(&facets, &[0], &[material])), Arc::new(visibility)));
    EffectiveBrdf { representation, base_area: f64::from(mesh.base_area()) }
}

#[test]
fn the_direct_sum_is_reciprocal_to_the_last_bit() {
    for (mesh, maps) in [(dunes(24), false), (tables(), true)] {
        for term in [
            Term::Lambertian { albedo: Vec3::ONE },
            Term::Ward { roughness: 0.3, specular: Vec3::ONE },
            Term::Ggx { roughness: 0.2, f0: Vec3::splat(0.5) },
            Term::CookTorrance { roughness: 0.3, f0: Vec3::splat(0.5) },
            Term::BlinnPhong { exponent: 50.0, specular: Vec3::ONE },
        ] {
            let brdf = effective(&mesh, 2000, term, maps);
            for pair in mirror_biased_pairs(80, 11) {
                assert_eq!(brdf.g(pair.i, pair.o), brdf.g(pair.o, pair.i), "{pair:?}");
            }
        }
    }
}

/// Returns the effective BRDF of a height field from one facet per triangle, so that facets do not depend on the
/// orientation.
fn effective_of_all_triangles(heights: &HeightGrid) -> EffectiveBrdf {
    let mesh = heightfield::from_grid(heights.clone(), Vec2::ONE);
    let mut facets = Facets::default();
    for triangle in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(triangle);
        let centre = (a + b + c) / 3.0;
        facets.positions.push(Vec3::new(centre.x.rem_euclid(1.0), centre.y.rem_euclid(1.0), centre.z));
        facets.normals.push(mesh.geometric_normal(triangle));
        facets.geometric_normals.push(mesh.geometric_normal(triangle));
        facets.areas.push(mesh.triangle_area(triangle) as f32);
        facets.slots.push(0);
        facets.colors.push(Vec3::ONE);
        facets.triangles.push(triangle as u32);
    }
    facets.sort_for_sums();
    let visibility = Visibility::HorizonMap(HorizonMap::march(heights, mesh.size, &facets, AZIMUTHS, 0.02));
    let brdf = Brdf { terms: vec![Term::CookTorrance { roughness: 0.3, f0: Vec3::ONE }] };
    let sum = FacetSum::new(&facets, &[0], &[Material { brdf, color: Vec3::ONE }]);
    let representation = Representation::Direct(Direct::new(Arc::new(sum), Arc::new(visibility)));
    EffectiveBrdf { representation, base_area: f64::from(mesh.base_area()) }
}

#[test]
fn turning_or_mirroring_a_height_image_turns_or_mirrors_the_result() {
    for mesh in [noise([12, 12]), dunes(64)] {
        let heights = mesh.height_grid.unwrap();
        let side = heights.size.x;
        // Returns the image whose sample (i, j) is the sample `from(i, j)` of the original.
        let image = |from: &dyn Fn(u32, u32) -> [u32; 2]| {
            let at = |k: u32| from(k % side, k / side);
            let values = (0..side * side).map(at).map(|[i, j]| heights.heights[(j * side + i) as usize]).collect();
            HeightGrid { size: heights.size, heights: values }
        };
        let original = effective_of_all_triangles(&heights);
        let last = side - 1;
        type Motion = (&'static str, fn(Vec3) -> Vec3);
        let moved: [(Motion, HeightGrid); 3] = [
            (("a quarter turn", |d| Vec3::new(-d.y, d.x, d.z)), image(&|i, j| [j, last - i])),
            (("a mirror image", |d| Vec3::new(-d.x, d.y, d.z)), image(&|i, j| [last - i, j])),
            (("the mirror image in the diagonal", |d| Vec3::new(d.y, d.x, d.z)), image(&|i, j| [j, i])),
        ];
        for ((name, motion), image) in moved {
            let moved = effective_of_all_triangles(&image);
            let (mut difference, mut norm) = (0.0, 0.0);
            for pair in mirror_biased_pairs(200, 5) {
                let (a, b) = (original.eval(pair.i, pair.o), moved.eval(motion(pair.i), motion(pair.o)));
                difference += (a - b).length_squared();
                norm += a.length_squared();
            }
            let relative = (difference / norm).sqrt();
            eprintln!("{side} x {side} samples, {name}: {relative:.1e}");
            assert!(relative < 1e-3, "{side} x {side} samples, {name}: {relative}");
        }
    }
}

/// Returns the mesh after a quarter turn about z, moved back onto the tile.
fn quarter_turn(mesh: &TileMesh) -> TileMesh {
    let positions = mesh.positions.iter().map(|p| Vec3::new(1.0 - p.y, p.x, p.z)).collect();
    TileMesh { positions, height_grid: None, ..mesh.clone() }
}

#[test]
fn rotating_the_tile_and_the_directions_changes_only_the_sampling() {
    let rotate = |d: Vec3| Vec3::new(-d.y, d.x, d.z);
    for (mesh, maps) in [(dunes(24), false), (tables(), true)] {
        let term = Term::CookTorrance { roughness: 0.4, f0: Vec3::ONE };
        let (plain, rotated) =
            (effective(&mesh, 6000, term.clone(), maps), effective(&quarter_turn(&mesh), 6000, term, maps));
        let (mut difference, mut norm) = (0.0, 0.0);
        for pair in mirror_biased_pairs(120, 5) {
            let (a, b) = (plain.eval(pair.i, pair.o), rotated.eval(rotate(pair.i), rotate(pair.o)));
            difference += (a - b).length_squared();
            norm += a.length_squared();
        }
        let relative = (difference / norm).sqrt();
        assert!(relative < 0.03, "{relative}");
    }
}
