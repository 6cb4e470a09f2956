//! Invariance under rotation and reflection of tile and directions, and under the unit of length.

use std::sync::Arc;

use biscale::brdf::{Brdf, Material, Term};
use biscale::effective::{Direct, EffectiveBrdf, FacetSum, LowRank, Representation};
use biscale::geometry::{FacetSampler, Facets, PeriodicGrid, SampleShift, TileMesh};
use biscale::metrics::mirror_biased_pairs;
use biscale::plan::{Preset, Settings};
use biscale::visibility::{HorizonMap, OcclusionIntervals, Visibility};
use biscale::{geometry, scene};
use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;

/// A map of the lattice of a tile to that of another.
struct Isometry {
    name: &'static str,
    matrix: Mat3,
}

fn isometries() -> [Isometry; 4] {
    let rows = |x: Vec3, y: Vec3| Mat3::from_cols(x, y, Vec3::Z);
    [
        Isometry { name: "a quarter turn", matrix: rows(Vec3::Y, Vec3::NEG_X) },
        Isometry { name: "half a turn", matrix: rows(Vec3::NEG_X, Vec3::NEG_Y) },
        Isometry { name: "the mirror image in x", matrix: rows(Vec3::NEG_X, Vec3::Y) },
        Isometry { name: "the mirror image in the diagonal", matrix: rows(Vec3::Y, Vec3::X) },
    ]
}

fn tile(geometry: &str) -> TileMesh {
    let scene = scene::parse(&format!("[tile]\nsize = [1.0, 0.75]\ngeometry = {geometry}\n")).unwrap();
    geometry::build(&scene.tile, std::path::Path::new("")).unwrap()
}

const TILES: [(&str, &str); 4] = [
    ("pyramids", r#"{ kind = "pyramids", face_ratio = 1.4, height = 0.2 }"#),
    ("grooves", r#"{ kind = "grooves", profile = "u", count = 3, depth = 0.2, rotation_deg = 30 }"#),
    ("rods", r#"{ kind = "rods", count = 12, radius = 0.04, length = 0.2, lean_deg = 30 }"#),
    ("threads", r#"{ kind = "weave", warp_count = 2, weft_count = 2 }"#),
];

/// Returns the transformed mesh and facets. The facets correspond, so only visibility and sums can differ.
fn transformed(mesh: &TileMesh, facets: &Facets, matrix: Mat3) -> (TileMesh, Facets) {
    let mut mesh = mesh.clone();
    mesh.size = (matrix * mesh.size.extend(0.0)).truncate().abs();
    mesh.positions.iter_mut().for_each(|p| *p = matrix * *p);
    if matrix.determinant() < 0.0 {
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    mesh.height_grid = None;
    let mut facets = facets.clone();
    let wrap = |p: Vec3| Vec3::new(p.x.rem_euclid(mesh.size.x), p.y.rem_euclid(mesh.size.y), p.z);
    facets.positions.iter_mut().for_each(|p| *p = wrap(matrix * *p));
    facets.normals.iter_mut().chain(&mut facets.geometric_normals).for_each(|n| *n = matrix * *n);
    (mesh, facets)
}

fn visibility(mesh: &TileMesh, facets: &Facets) -> Visibility {
    let grid = PeriodicGrid::new(mesh);
    if mesh.is_height_field() {
        Visibility::HorizonMap(HorizonMap::scan(&grid, facets, 32, 0.02))
    } else {
        Visibility::OcclusionIntervals(OcclusionIntervals::scan(&grid, facets, 32, 0.02))
    }
}

fn material() -> Material {
    let glossy = Term::CookTorrance { roughness: 0.35, f0: Vec3::new(0.9, 0.5, 0.1) };
    Material { brdf: Brdf { terms: vec![glossy, Term::Lambertian { albedo: Vec3::splat(0.2) }] }, color: Vec3::ONE }
}

fn evaluators(mesh: &TileMesh, facets: &Facets) -> [(&'static str, EffectiveBrdf); 2] {
    let (slots, materials) = (vec![0; mesh.slots.len()], [material()]);
    let visibility = Arc::new(visibility(mesh, facets));
    let base_area = f64::from(mesh.base_area());
    let settings = Settings::of_preset(Preset::Draft).low_rank(!mesh.is_height_field());
    let factors = LowRank::build(facets, &visibility, &slots, &materials, &settings).unwrap();
    let sum = Arc::new(FacetSum::new(facets, &slots, &materials));
    [
        ("direct", EffectiveBrdf { representation: Representation::Direct(Direct::new(sum, visibility)), base_area }),
        ("low rank", EffectiveBrdf { representation: Representation::LowRank(factors), base_area }),
    ]
}

#[test]
fn rotating_or_mirroring_tile_and_directions_changes_only_rounding() {
    let pairs = mirror_biased_pairs(120, 8);
    for (name, geometry) in TILES {
        let mesh = tile(geometry);
        let mut facets = FacetSampler::new(&mesh).sample(&mesh, 512, SampleShift::from_seed(1));
        facets.sort_for_sums();
        let here = evaluators(&mesh, &facets);
        for isometry in isometries() {
            let (mesh, facets) = transformed(&mesh, &facets, isometry.matrix);
            let there = evaluators(&mesh, &facets);
            for ((evaluator, here), (_, there)) in here.iter().zip(&there) {
                let largest = pairs.iter().map(|p| here.g(p.i, p.o).max_element()).fold(0.0, f32::max);
                let mut differences: Vec<f32> = pairs
                    .par_iter()
                    .map(|p| {
                        (here.g(p.i, p.o) - there.g(isometry.matrix * p.i, isometry.matrix * p.o)).abs().max_element()
                    })
                    .collect();
                differences.sort_by(f32::total_cmp);
                // Grid steps map onto grid steps, so only rounding differs, which at a silhouette may flip one of 512
                // facets. Under overhangs, the interpolation between azimuths is not symmetric, so its mirror image
                // differs. The random projection of low-rank factors differs, too.
                let (typical, worst) =
                    (differences[differences.len() / 2] / largest, differences[differences.len() - 1] / largest);
                let overhangs = ["rods", "threads"].contains(&name);
                let mirrored = isometry.matrix.determinant() < 0.0;
                let limits = match *evaluator {
                    "direct" if mirrored && overhangs => [1e-2, 0.1],
                    "direct" => [1e-5, 2e-2],
                    _ => [1e-2, 0.1],
                };
                let what =
                    format!("{name}, {evaluator}, {}: {typical:.1e} typically, {worst:.1e} at worst", isometry.name);
                assert!(typical < limits[0] && worst < limits[1], "{what}");
            }
        }
    }
}

#[test]
fn the_unit_of_length_changes_nothing() {
    let directions = mirror_biased_pairs(60, 2);
    for geometry in [
        r#"{ kind = "heightfield", values = [[0, 0.3, 0.1], [0.5, 0.9, 0.4], [0.2, 0.6, 1.0]], height_scale = SCALE }"#,
        r#"{ kind = "grooves", depth = SCALE }"#,
        r#"{ kind = "rods", radius = 0.1SCALE, length = SCALE, count = 6 }"#,
    ] {
        let value = |unit: f64| -> Vec<Vec3> {
            let scaled =
                geometry.replace("0.1SCALE", &format!("{}", 0.03 * unit)).replace("SCALE", &format!("{}", 0.25 * unit));
            let text = format!("[tile]\nsize = [{unit}, {unit}]\ngeometry = {scaled}\n");
            let scene = scene::parse(&text).unwrap();
            let mesh = geometry::build(&scene.tile, std::path::Path::new("")).unwrap();
            let mut facets = FacetSampler::new(&mesh).sample(&mesh, 256, SampleShift::from_seed(1));
            facets.sort_for_sums();
            assert_eq!(mesh.size, Vec2::splat(unit as f32));
            let evaluators = evaluators(&mesh, &facets);
            directions.iter().flat_map(|p| evaluators.iter().map(|(_, brdf)| brdf.eval(p.i, p.o))).collect()
        };
        // The units are powers of two, which scale without rounding.
        let one = value(1.0);
        let scale = one.iter().map(|v| v.max_element()).fold(0.0, f32::max);
        for unit in [f64::exp2(-18.0), f64::exp2(18.0)] {
            let other = value(unit);
            let difference = one.iter().zip(&other).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
            assert!(difference < 1e-4 * scale, "{geometry} of {unit}: {difference} of {scale}");
        }
    }
}
