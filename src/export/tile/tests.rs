use std::cell::{Cell, RefCell};
use std::collections::HashMap;

use glam::DVec2;

use super::heights::SampledHeights;
use super::*;
use crate::base::Error;
use crate::geometry;
use crate::scene::{Geometry, GrooveProfile, Grooves, Pyramids};

fn never_cancel(_: f32) -> bool {
    true
}

fn scene_of(geometry: Geometry) -> (Scene, TileMesh) {
    let scene = Scene::of(geometry);
    let mesh = geometry::build(&scene.tile, Path::new("")).unwrap();
    (scene, mesh)
}

fn v_grooves() -> Geometry {
    Geometry::Grooves(Grooves {
        profile: GrooveProfile::V,
        count: 2,
        depth: 0.25,
        side_angle_deg: 45.0,
        ..Grooves::default()
    })
}

#[test]
fn every_edge_of_the_printed_solid_is_shared_by_two_triangles_that_run_opposite_ways() {
    let (_, mesh) = scene_of(Geometry::Pyramids(Pyramids { truncation: 0.3, ..Pyramids::default() }));
    let options = TileOptions { samples: UVec2::new(12, 9), repeat: UVec2::new(2, 1), ..TileOptions::default() };
    let heights = SampledHeights::from_above(&mesh, options.samples, 0.0, &never_cancel).unwrap();
    assert_eq!(heights.holes, 0);
    let triangles = solid::solid(&heights, &mesh, &options, 10.0, &never_cancel).unwrap();
    let mut edges: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
    let key = |p: Vec3| p.to_array().map(f32::to_bits);
    let mut volume = 0.0;
    for [a, b, c] in &triangles {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            *edges.entry([key(*p), key(*q)]).or_default() += 1;
        }
        volume += a.as_dvec3().dot(b.as_dvec3().cross(c.as_dvec3())) / 6.0;
    }
    for (edge, count) in &edges {
        assert_eq!((*count, edges.get(&[edge[1], edge[0]])), (1, Some(&1)));
    }
    // 20 x 10 mm on a base of 2 mm, with pyramids on top.
    assert!(volume > 20.0 * 10.0 * 2.0 && volume < 20.0 * 10.0 * 3.5, "{volume}");
}

#[test]
fn heights_of_grooves_are_the_cross_section() {
    let (_, mesh) = scene_of(v_grooves());
    let heights = SampledHeights::from_above(&mesh, UVec2::new(8, 2), 0.0, &never_cancel).unwrap();
    // Two V grooves per tile: 0 at the ridge, -0.25 in the middle, linear between.
    for (i, expected) in [0.0, -0.125, -0.25, -0.125, 0.0, -0.125, -0.25, -0.125].into_iter().enumerate() {
        assert!((heights.at(i as u32, 1) - expected).abs() < 1e-6, "{i}: {}", heights.at(i as u32, 1));
    }
}

#[test]
fn every_extension_writes_a_file_and_invalid_input_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, mesh) = scene_of(v_grooves());
    let options = TileOptions { samples: UVec2::splat(16), ..TileOptions::default() };
    for ending in ["obj", "stl", "png", "svg", "pdf"] {
        let path = folder.path().join("tile").with_extension(ending);
        assert!(!write(&scene, &mesh, &options, &path, &never_cancel).unwrap().is_empty());
        assert!(std::fs::metadata(&path).unwrap().len() > 100, "{ending}");
    }
    let stl = std::fs::read(folder.path().join("tile.stl")).unwrap();
    let count = u32::from_le_bytes(stl[80..84].try_into().unwrap()) as usize;
    assert_eq!(stl.len(), 84 + 50 * count);
    let input_error = |options: &TileOptions, name: &str| {
        let error = write(&scene, &mesh, options, &folder.path().join(name), &never_cancel).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        error.to_string()
    };
    assert!(input_error(&options, "tile.gif").contains("the ending .gif"));
    assert!(input_error(&TileOptions { scale: 0.0, ..options.clone() }, "tile.stl").contains("scale"));
    assert!(
        input_error(&TileOptions { samples: UVec2::splat(1 << 20), ..options.clone() }, "tile.stl").contains("samples")
    );
    assert!(input_error(&TileOptions { repeat: UVec2::ZERO, ..options.clone() }, "tile.obj").contains("repeat"));
    let mut other = scene.clone();
    other.tile.unit = "furlong".to_owned();
    assert!(
        write(&other, &mesh, &options, &folder.path().join("tile.stl"), &never_cancel)
            .unwrap_err()
            .to_string()
            .contains("tile.unit")
    );
}

#[test]
fn progress_of_every_format_runs_from_0_to_1_and_a_cancelled_file_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, mesh) = scene_of(v_grooves());
    let options = TileOptions { samples: UVec2::splat(16), ..TileOptions::default() };
    for ending in ["obj", "stl", "png", "svg", "pdf"] {
        let path = folder.path().join(format!("tile.{ending}"));
        let reports = RefCell::new(Vec::new());
        let record = |done| {
            reports.borrow_mut().push(done);
            true
        };
        write(&scene, &mesh, &options, &path, &record).unwrap();
        let reports = reports.into_inner();
        assert!(
            reports.first() == Some(&0.0) && reports.last() == Some(&1.0) && reports.is_sorted(),
            "{ending}: {reports:?}"
        );
        std::fs::write(&path, "old").unwrap();
        // Cancelled at each report; at the last one, all bytes are already in the temporary file.
        for allowed in 0..reports.len() {
            let left = Cell::new(allowed);
            let until = |_| left.get().checked_sub(1).map(|less| left.set(less)).is_some();
            let error = write(&scene, &mesh, &options, &path, &until).unwrap_err();
            assert!(matches!(error, Error::Cancelled), "{ending}, {allowed}: {error}");
            assert_eq!(std::fs::read(&path).unwrap(), b"old", "{ending}, {allowed}");
        }
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 5, "no temporary files are left");
}

#[test]
fn an_exported_obj_loads_as_the_same_tile() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, mesh) = scene_of(v_grooves());
    write(&scene, &mesh, &TileOptions::default(), &folder.path().join("tile.obj"), &never_cancel).unwrap();
    let mut from_file = scene;
    from_file.tile.geometry = Geometry::Mesh(crate::scene::MeshFile { path: "tile.obj".into() });
    let loaded = geometry::build(&from_file.tile, folder.path()).unwrap();
    assert_eq!(loaded.triangles.len(), mesh.triangles.len());
    let area = |mesh: &TileMesh| (0..mesh.triangles.len()).map(|k| mesh.triangle_area(k)).sum::<f64>();
    assert!((area(&loaded) - area(&mesh)).abs() < 1e-5);
}

#[test]
fn a_pattern_has_the_area_of_the_surface_that_it_unfolds() {
    for (geometry, scale) in [
        (v_grooves(), 30.0),
        (Geometry::Pyramids(Pyramids { truncation: 0.4, face_ratio: 2.0, ..Pyramids::default() }), 80.0),
    ] {
        let (scene, mesh) = scene_of(geometry);
        let options = TileOptions { scale, ..TileOptions::default() };
        let (page, _) = pattern::sheet(&scene, &options, 1.0, &never_cancel).unwrap();
        let polygon_area = |points: &[DVec2]| {
            let twice: f64 = (0..points.len()).map(|k| points[k].perp_dot(points[(k + 1) % points.len()])).sum();
            0.5 * twice.abs()
        };
        let printed: f64 = page.shapes.iter().filter(|s| s.fill.is_some()).map(|s| polygon_area(&s.points)).sum();
        let slots: f64 = (0..mesh.triangles.len()).map(|k| mesh.triangle_area(k)).sum();
        // The printed floor of pyramids includes the area under them.
        let under = if mesh.slots[0] == "faces" {
            let floor: f64 =
                (0..mesh.triangles.len()).filter(|&k| mesh.triangle_slot[k] == 1).map(|k| mesh.triangle_area(k)).sum();
            1.0 - floor
        } else {
            0.0
        };
        let expected = (slots + under) * f64::from(scale * scale);
        assert!((printed / expected - 1.0).abs() < 1e-4, "{printed} {expected}");
    }
}

#[test]
fn painted_images_that_a_file_leaves_out_are_named_in_its_notes() {
    let folder = tempfile::tempdir().unwrap();
    let (mut scene, mesh) = scene_of(v_grooves());
    let options = TileOptions { samples: UVec2::splat(16), ..TileOptions::default() };
    let notes = |scene: &Scene, ending: &str| {
        let path = folder.path().join("tile").with_extension(ending);
        write(scene, &mesh, &options, &path, &never_cancel).unwrap().join("; ")
    };
    for (colors, slots) in [(false, false), (true, false), (false, true), (true, true)] {
        scene.tile.color_path = colors.then(|| "colors.png".into());
        scene.tile.slot_path = slots.then(|| "slots.png".into());
        for ending in ["obj", "svg", "pdf", "stl", "png"] {
            // A solid and an image of heights have no colours.
            let has_colors = !matches!(ending, "stl" | "png");
            let notes = notes(&scene, ending);
            assert_eq!(notes.contains("tile.color_path"), colors && has_colors, "{ending}: {notes}");
            assert_eq!(notes.contains("tile.slot_path"), slots && has_colors, "{ending}: {notes}");
            assert_eq!(notes.contains("left out"), (colors || slots) && has_colors, "{ending}: {notes}");
        }
    }
}
