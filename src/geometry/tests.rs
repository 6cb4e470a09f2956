//! Tests of identities that hold for every family.

use std::path::Path;

use glam::{UVec2, Vec2, Vec3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use toml::{Table, Value};

use super::facets::unshadowed_projected_area;
use super::*;
use crate::scene::{Field, FieldShape, Geometry, GrooveProfile, Grooves, Pyramids, Rods, Tile, Weave};

fn tile(geometry: Geometry) -> Tile {
    Tile { size: Vec2::new(1.0, 1.2), ..Tile::of(geometry) }
}

fn built(geometry: Geometry) -> TileMesh {
    build(&tile(geometry), Path::new("")).unwrap()
}

/// Height of the highest surface at a point of the endless tiling, and whether it faces up.
fn highest_surface(mesh: &TileMesh, at: Vec2) -> Option<(f32, bool)> {
    let mut best: Option<(f32, bool)> = None;
    for triangle in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(triangle);
        let (low, high) = (a.min(b).min(c).truncate(), a.max(b).max(c).truncate());
        let (from, to) = (((low - at) / mesh.size).ceil(), ((high - at) / mesh.size).floor());
        for j in from.y as i32..=to.y as i32 {
            for i in from.x as i32..=to.x as i32 {
                let p = at + Vec2::new(i as f32, j as f32) * mesh.size;
                let side = |u: Vec3, v: Vec3| (v - u).truncate().perp_dot(p - u.truncate());
                let weights = [side(b, c), side(c, a), side(a, b)];
                let sum: f32 = weights.iter().sum();
                if sum != 0.0 && weights.iter().all(|weight| weight / sum >= 0.0) {
                    let z = (a.z * weights[0] + b.z * weights[1] + c.z * weights[2]) / sum;
                    if best.is_none_or(|(height, _)| z > height) {
                        best = Some((z, sum > 0.0));
                    }
                }
            }
        }
    }
    best
}

#[test]
fn a_ray_from_above_always_meets_a_reflecting_side() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let rods = Rods { count: 30, lean_deg: 50.0, lean_azimuth_deg: 200.0, length: 1.5, ..Rods::default() };
    for geometry in [
        Geometry::Rods(rods),
        Geometry::Weave(Weave { warp_width: 0.5, weft_width: 0.7, ..Weave::default() }),
        Geometry::Grooves(Grooves { rotation_deg: 33.0, profile: GrooveProfile::U, ..Grooves::default() }),
        Geometry::Pyramids(Pyramids { sides: 5, ..Pyramids::default() }),
    ] {
        let mesh = built(geometry);
        for _ in 0..400 {
            let at = Vec2::new(random.random(), random.random()) * mesh.size;
            assert!(matches!(highest_surface(&mesh, at), Some((_, true))), "{at}: {:?}", highest_surface(&mesh, at));
        }
    }
}

#[test]
fn facet_areas_sum_to_the_surface_and_all_arrays_have_equal_length() {
    for kind in Geometry::kinds().iter().filter(|kind| !matches!(kind.kind, "mesh" | "heightfield")) {
        let mesh = built(Geometry::with_defaults(kind.kind).unwrap());
        let surface: f64 = (0..mesh.triangles.len()).map(|t| mesh.triangle_area(t)).sum();
        for facets in [Facets::sample(&mesh, 777, 3), Facets::sample_wu2011(&mesh, 200, 3)] {
            let n = facets.len();
            let sum: f64 = facets.areas.iter().map(|area| f64::from(*area)).sum();
            assert!((sum / surface - 1.0).abs() < 1e-5, "{}: {sum} of {surface}", kind.kind);
            assert!(
                [
                    facets.normals.len(),
                    facets.geometric_normals.len(),
                    facets.slots.len(),
                    facets.colors.len(),
                    facets.triangles.len()
                ] == [n; 5]
            );
            assert!(
                facets.positions.iter().all(|p| p.x >= 0.0 && p.x < mesh.size.x && p.y >= 0.0 && p.y < mesh.size.y)
            );
            assert!(facets.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5));
        }
    }
}

#[test]
fn facets_lie_on_their_triangles() {
    let mesh = built(Geometry::Rods(Rods::default()));
    let facets = Facets::sample(&mesh, 500, 0);
    for k in 0..facets.len() {
        let [a, _, _] = mesh.corners(facets.triangles[k] as usize);
        let offset = facets.positions[k] - a;
        let wrapped = (offset.truncate() - mesh.size * (offset.truncate() / mesh.size).round()).extend(offset.z);
        assert!(wrapped.dot(facets.geometric_normals[k]).abs() < 1e-4);
    }
}

fn noise_tile() -> TileMesh {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let waves: Vec<[f32; 4]> = (0..12)
        .map(|_| {
            let wave = |random: &mut ChaCha8Rng| std::f32::consts::TAU * f32::from(random.random_range(-4i8..=4));
            [wave(&mut random), wave(&mut random), random.random::<f32>() * 6.0, 0.02 + 0.02 * random.random::<f32>()]
        })
        .collect();
    heightfield::from_function(UVec2::splat(96), Vec2::ONE, |p| {
        waves.iter().map(|w| w[3] * (w[0] * p.x + w[1] * p.y + w[2]).sin()).sum()
    })
}

/// Root mean square over passes of the error of `Σ ΔA (n·o)+`, relative to the sum over all triangles.
fn error_of(mesh: &TileMesh, sample: impl Fn(u64) -> Facets) -> f64 {
    let (theta, phi) = (1.2, 0.4);
    let o = crate::math::directions::from_angles(theta, phi);
    let term = |t: usize| f64::from(mesh.geometric_normal(t).dot(o).max(0.0)) * mesh.triangle_area(t);
    let exact: f64 = (0..mesh.triangles.len()).map(term).sum();
    let errors = (0..24).map(|pass| (unshadowed_projected_area(&sample(pass), theta, phi) / exact - 1.0).powi(2));
    (errors.sum::<f64>() / 24.0).sqrt()
}

#[test]
fn systematic_facets_have_a_smaller_error_than_the_papers_random_ones() {
    let grooves = Grooves { rotation_deg: 30.0, profile: GrooveProfile::U, ..Grooves::default() };
    for (mesh, factor) in [(noise_tile(), 1.5), (built(Geometry::Grooves(grooves)), 3.0)] {
        let systematic = error_of(&mesh, |pass| Facets::sample(&mesh, 1000, pass));
        let random = error_of(&mesh, |pass| Facets::sample_wu2011(&mesh, 1000, pass));
        assert!(systematic * factor < random, "systematic {systematic:.5}, wu2011 {random:.5}");
    }
}

/// Tests that each shape of triangle has a sequence of its own. One sequence through all triangles would correlate with
/// the repetitions of the mesh and give a strip along the walls too many facets or none.
#[test]
fn strips_along_the_edges_of_equal_triangles_get_their_share_of_facets_at_any_count() {
    let spec = Grooves { profile: GrooveProfile::Rectangular, depth: 0.5, ..Grooves::default() };
    let mesh = built(Geometry::Grooves(spec));
    // Width of the strip along the walls' upper edge. The walls are 4 of the 5 tile areas of the surface.
    const STRIP: f32 = 0.04;
    let mut max_deviation = 0.0_f64;
    for count in (500..8000).step_by(4) {
        let facets = Facets::sample(&mesh, count, 1);
        let on_strip = |k: &usize| facets.normals[*k].x > 0.5 && facets.positions[*k].z > -0.5 * STRIP;
        let found = (0..count).filter(on_strip).count() as f64;
        let expected = count as f64 * 0.4 * f64::from(STRIP);
        max_deviation = max_deviation.max((found - expected).abs() / expected.sqrt());
    }
    // In units of the standard deviation of random points.
    assert!(max_deviation < 2.5, "{max_deviation}");
}

#[test]
fn systematic_points_integrate_a_smooth_function_better_than_random_ones() {
    // The mean of sin(πx) sin(πy) over the unit square is 4/π².
    let mesh = heightfield::from_function(UVec2::ONE, Vec2::ONE, |_| 0.0);
    let f = |p: &Vec3| f64::from((p.x * std::f32::consts::PI).sin() * (p.y * std::f32::consts::PI).sin());
    let exact = 4.0 / std::f64::consts::PI.powi(2);
    let rms = |sample: &dyn Fn(u64) -> Facets| {
        let error = |pass| sample(pass).positions.iter().map(f).sum::<f64>() / 1000.0 - exact;
        ((0..16).map(|pass| error(pass).powi(2)).sum::<f64>() / 16.0).sqrt()
    };
    let lattice = rms(&|pass| Facets::sample(&mesh, 1000, pass));
    let random = rms(&|pass| {
        let mut random = ChaCha8Rng::seed_from_u64(pass);
        Facets {
            positions: (0..1000).map(|_| Vec3::new(random.random(), random.random(), 0.0)).collect(),
            ..Facets::default()
        }
    });
    assert!(lattice < random / 5.0, "{lattice} {random}");
}

#[test]
fn facets_use_interpolated_normals_if_the_mesh_has_them() {
    let mut mesh = built(Geometry::Flat(crate::scene::Flat::default()));
    mesh.corner_normals = Some(vec![[Vec3::X, Vec3::X, Vec3::Z]; mesh.triangles.len()]);
    let facets = Facets::sample(&mesh, 64, 0);
    assert!(facets.geometric_normals.iter().all(|normal| *normal == Vec3::Z));
    assert!(facets.normals.iter().any(|normal| normal.x > 0.5 && normal.z > 0.1));
    assert!(facets.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5));
}

#[test]
fn triangles_without_area_or_with_nan_are_skipped_and_counted() {
    let mut mesh = built(Geometry::Flat(crate::scene::Flat::default()));
    mesh.positions.push(Vec3::NAN);
    mesh.triangles.extend([[0, 0, 1], [0, 1, 4]]);
    mesh.triangle_slot.extend([0, 0]);
    let facets = Facets::sample(&mesh, 50, 0);
    assert_eq!(facets.skipped_triangles, 2);
    assert!((facets.areas.iter().sum::<f32>() - 1.2).abs() < 1e-5);
    mesh.triangles.drain(..2);
    mesh.triangle_slot.drain(..2);
    for facets in [Facets::sample(&mesh, 50, 0), Facets::sample_wu2011(&mesh, 50, 0)] {
        assert!(facets.is_empty());
    }
}

#[test]
fn colour_images_weight_the_facets() {
    let folder = tempfile::tempdir().unwrap();
    let image =
        image::RgbImage::from_fn(2, 1, |x, _| if x == 0 { image::Rgb([255, 0, 0]) } else { image::Rgb([0, 255, 0]) });
    image.save(folder.path().join("c.png")).unwrap();
    let flat = tile(Geometry::Flat(Default::default()));
    let mesh = build(&Tile { color_path: Some("c.png".into()), ..flat }, folder.path()).unwrap();
    let facets = Facets::sample(&mesh, 400, 0);
    let mean = facets.colors.iter().sum::<Vec3>() / 400.0;
    assert!((mean - Vec3::new(0.5, 0.5, 0.0)).length() < 0.02, "{mean}");
}

#[test]
fn painted_slots_cover_their_part_of_any_surface_and_leave_the_rest_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    // The left half keeps the surface's slots; the right half gets the second painted slot.
    image::GrayImage::from_fn(4, 3, |x, _| image::Luma([if x < 2 { 0 } else { 2 }]))
        .save(folder.path().join("s.png"))
        .unwrap();
    for geometry in [Geometry::Flat(Default::default()), Geometry::Grooves(Default::default())] {
        let plain = build(&tile(geometry.clone()), folder.path()).unwrap();
        let painted = Tile { slot_path: Some("s.png".into()), ..tile(geometry) };
        let mesh = build(&painted, folder.path()).unwrap();
        let own = plain.slots.len();
        assert_eq!(mesh.slots[own..], ["paint_1", "paint_2"]);
        let facets = Facets::sample(&mesh, 2000, 0);
        for (slot, position) in facets.slots.iter().zip(&facets.positions) {
            assert_eq!(usize::from(*slot) == own + 1, position.x >= 0.5, "{slot} at {position}");
        }
        // The tile repeats beyond its edge.
        assert_eq!(usize::from(mesh.slot_at(0, Vec2::new(-0.1, 7.3))), own + 1);
        assert!(usize::from(mesh.slot_at(0, Vec2::new(1.1, -0.1))) < own);
    }
    image::GrayImage::from_pixel(2, 2, image::Luma([99])).save(folder.path().join("s.png")).unwrap();
    let painted = Tile { slot_path: Some("s.png".into()), ..tile(Geometry::Flat(Default::default())) };
    let error = build(&painted, folder.path()).unwrap_err().to_string();
    assert!(error.contains("pixel (0, 0)") && error.contains("99") && error.contains("0 to 16"), "{error}");
}

fn any_family() -> impl Strategy<Value = (Table, [f32; 2])> {
    let kinds: Vec<_> = Geometry::kinds().into_iter().filter(|kind| kind.kind != "mesh").collect();
    let family = proptest::sample::select(kinds).prop_flat_map(|kind| {
        let name = kind.kind;
        let is_file = |field: &Field| matches!(field.shape, FieldShape::Path);
        let is_random = move |field: &Field| !is_file(field) && !matches!(field.key, "values");
        let fields: Vec<Field> = kind.fields.into_iter().filter(is_random).collect();
        let keys: Vec<&'static str> = fields.iter().map(|field| field.key).collect();
        let values: Vec<_> = fields.iter().map(|field| crate::scene::tests::value_of(field.shape)).collect();
        values.prop_map(move |values| {
            let mut table: Table = keys.iter().map(|key| (*key).to_owned()).zip(values).collect();
            table.insert("kind".to_owned(), Value::String(name.to_owned()));
            if name == "heightfield" {
                let rows = [[0.0, 1.0, 0.5], [0.3, -1.0, 0.2]].map(|row| Value::Array(row.map(Value::Float).to_vec()));
                table.insert("values".to_owned(), Value::Array(rows.to_vec()));
            }
            if name == "rods" {
                // The count is used instead, because a density of 10⁶ would make every case large.
                table.remove("density");
            }
            table
        })
    });
    (family, [0.2f32..3.0, 0.2f32..3.0])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]

    #[test]
    fn any_parameters_in_range_build_a_finite_mesh_that_closes_the_plane((table, size) in any_family()) {
        let geometry: Geometry = table.try_into().map_err(|error: toml::de::Error| TestCaseError::fail(error.to_string()))?;
        let closed = !matches!(geometry, Geometry::Rods(_));
        let mesh = match build(&Tile { size: size.into(), ..Tile::of(geometry) }, Path::new("")) {
            Ok(mesh) => mesh,
            // Each parameter is in range, but the tile may be too high.
            Err(error) => {
                prop_assert!(error.to_string().contains("tile lengths"), "{}", error);
                return Ok(());
            }
        };
        prop_assert!(!mesh.triangles.is_empty() && mesh.triangles.len() == mesh.triangle_slot.len());
        prop_assert!(mesh.positions.iter().all(|position| position.is_finite()));
        prop_assert!(mesh.triangles.iter().flatten().all(|index| (*index as usize) < mesh.positions.len()));
        prop_assert!(mesh.triangle_slot.iter().all(|slot| usize::from(*slot) < mesh.slots.len()));
        if closed && mesh.closes_plane {
            let ratio = closure::signed_projected_area(&mesh) / f64::from(mesh.base_area());
            prop_assert!((ratio - 1.0).abs() < 1e-4, "projected area {} of the base area", ratio);
        }
        let facets = Facets::sample(&mesh, 64, 1);
        prop_assert!(facets.len() == 64 && facets.positions.iter().all(|p| p.is_finite()));
    }
}

#[test]
fn every_shipped_scene_builds_and_each_slot_has_a_material() {
    for name in crate::scene::shipped::names() {
        let loaded = crate::scene::open(name, &[]).unwrap();
        let mesh = build(&loaded.scene.tile, &loaded.base_dir).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(mesh.closes_plane, "{name}");
        for slot in &mesh.slots {
            loaded.scene.material_for_slot(slot).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
        for material in
            loaded.scene.materials.iter().filter(|material| !name.starts_with("table3") && material.name != "default")
        {
            assert!(mesh.slots.contains(&material.name), "{name}: no slot `{}`", material.name);
        }
        eprintln!("{name}: {} triangles {:?}", mesh.triangles.len(), mesh.notes);
    }
}
