//! Regression tests: inputs that crash a reader that lacks a check, make it hang, or are read as something else.

use std::path::Path;

use biscale::base::Error;
use biscale::effective::Reflectance;
use biscale::pipeline::Pipeline;
use biscale::scene::{Geometry, LoadedScene, MeshFile, Painted};
use biscale::{geometry, scene};
use glam::Vec3;

fn tile(text: &str) -> Result<geometry::TileMesh, Error> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.obj"), text).unwrap();
    let tile = scene::Scene::of(Geometry::Mesh(MeshFile { path: "a.obj".into() })).tile;
    geometry::build(&tile, folder.path())
}

/// The quotient of 1e30 and the tile size overflows the integers of welding and of grids.
#[test]
fn coordinates_of_1e30_are_refused_by_vertex() {
    let error = tile("v 0 0 0\nv 1e30 0 0\nv 1e30 1e30 0\nv 0 1 0\nf 1 2 3 4\n").unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("vertex 2"), "{error}");
    assert!(tile("v 0 0 1e30\nv 1 0 -1e30\nv 1 1 1e30\nf 1 2 3\n").is_err());
}

/// Copies of a triangle are counted in 16 bits.
#[test]
fn a_mesh_a_million_tiles_away_is_refused() {
    assert!(tile("v 1000000 0 0\nv 1000001 0 0\nv 1000001 1 0\nf 1 2 3\n").is_err());
    assert!(tile("v 9000 0 0\nv 9001 0 0\nv 9001 1 0\nf 1 2 3\n").is_ok());
    assert!(tile("v -9000 -9000 0\nv 9000 -9000 0\nv 0 9000 0\nf 1 2 3\n").is_err(), "3·10⁸ tiles under one triangle");
}

/// A mesh without area has no facets.
#[test]
fn a_mesh_without_area_is_black_in_every_representation() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0.5 0 0\nf 1 2 3\n").unwrap();
    for method in ["direct", "low_rank"] {
        let text = format!(
            "[tile]\ngeometry = {{ kind = \"mesh\", path = \"a.obj\" }}\n[quality]\npreset = \"draft\"\nmethod = \"{method}\"\n"
        );
        let scene = scene::parse(&text).unwrap();
        let base_dir = folder.path().to_owned();
        let loaded = LoadedScene { scene, base_dir, name: String::new(), painted: Painted::default() };
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let mut out = [Vec3::ONE];
        outcome.eval_lights(&[Vec3::Z], Vec3::Z, &mut out);
        assert_eq!(out, [Vec3::ZERO], "{method}");
        assert!(outcome.health().warnings.iter().any(|warning| warning.contains("no area")), "{method}");
    }
}

/// A device file reports length 0 and never ends.
#[test]
#[cfg(unix)]
fn device_files_are_refused() {
    use biscale::brdf::{Brdf, MeasuredCache};
    use biscale::scene::{BrdfSpec, TermSpec};
    let endless = Path::new("/dev/zero").to_owned();
    for term in [
        TermSpec::Npz { path: endless.clone() },
        TermSpec::Merl { path: endless.clone() },
        TermSpec::Rgl { path: endless.clone() },
        TermSpec::Utia { path: endless.clone() },
    ] {
        assert!(Brdf::from_specs(&BrdfSpec::One(term), Path::new(""), &mut MeasuredCache::default()).is_err());
    }
    let object = scene::Object { kind: "mesh".to_owned(), path: Some(endless.clone()) };
    assert!(biscale::render::object::build(&object, Path::new("")).is_err());
    assert!(scene::open("/dev/zero", &[]).is_err());
}

/// A header that announces 10^18 samples is refused before memory is allocated.
#[test]
fn headers_that_announce_more_samples_than_the_file_has_are_refused() {
    use biscale::brdf::{Brdf, MeasuredCache};
    use biscale::scene::{BrdfSpec, TermSpec};
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let term = if name.ends_with("bsdf") { TermSpec::Rgl { path } } else { TermSpec::Merl { path } };
        Brdf::from_specs(&BrdfSpec::One(term), Path::new(""), &mut MeasuredCache::default())
    };
    let huge = [1_000_000_i32; 3].map(i32::to_le_bytes).concat();
    assert_eq!(read("a.binary", &huge).unwrap_err().exit_code(), 2);
    let mut tensor = b"tensor_file\0\x01\x00".to_vec();
    tensor.extend(1_u32.to_le_bytes());
    tensor.extend(7_u16.to_le_bytes());
    tensor.extend(b"theta_i");
    tensor.extend([1, 0, 10]);
    tensor.extend(64_u64.to_le_bytes());
    tensor.extend(1_000_000_000_000_000_000_u64.to_le_bytes());
    tensor.resize(128, 0);
    assert_eq!(read("a.bsdf", &tensor).unwrap_err().exit_code(), 2);
}

/// A UTIA sample of 1.4e306 is infinite in f32.
#[test]
fn samples_beyond_the_range_of_f32_are_refused() {
    use biscale::brdf::{Brdf, MeasuredCache};
    use biscale::scene::{BrdfSpec, TermSpec};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    let mut bytes: Vec<u8> = (0..3 * 288 * 288).flat_map(|_| 0.1_f64.to_le_bytes()).collect();
    bytes[1_806_592..1_806_600].copy_from_slice(&1.4e306_f64.to_le_bytes());
    std::fs::write(&path, bytes).unwrap();
    let term = BrdfSpec::One(TermSpec::Utia { path });
    let error = Brdf::from_specs(&term, Path::new(""), &mut MeasuredCache::default()).unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("number 225824"), "{error}");
}

/// Rotated grooves at the requested density would be too many on a tile of 1 by 10^6, so the tile has fewer.
#[test]
fn rotated_grooves_on_a_long_tile_have_fewer_than_100_000_triangles() {
    let text =
        "[tile]\nsize = [1.0, 1e6]\ngeometry = { kind = \"grooves\", profile = \"v\", count = 2, rotation_deg = 10 }\n";
    let mesh = geometry::build(&scene::parse(text).unwrap().tile, Path::new("")).unwrap();
    assert!(mesh.triangles.len() < 100_000 && mesh.closes_plane, "{}", mesh.triangles.len());
    assert!(mesh.notes.iter().any(|note| note.contains("grooves run at")), "{:?}", mesh.notes);
}

/// A matte material that reflects 905 times the light that it receives, between rods: its walks grow past the range of
/// f32.
#[test]
fn light_between_facets_that_create_energy_stays_finite() {
    let text = r#"
        tile.size = [1, 0.8]
        material = [{ name = "default", brdf = { kind = "lambertian", albedo = [905, 0.4, 0.6] }, color = 0.9 }]
        effects.interreflection = "on"
        quality = { preset = "draft", backend = "cpu", facets = 48, azimuths = 8, rings = 4 }
        [tile.geometry]
        kind = "rods"
        radius = 0.1
        length = 0.3
        taper = 0.2
        lean_deg = 20
        spread_deg = 10
        jitter = 0.5
        count = 4
    "#;
    for preset in ["draft", "reference"] {
        let mut scene = scene::parse(text).unwrap();
        scene.quality.preset = preset.to_owned();
        let base_dir = Path::new("").to_owned();
        let loaded = LoadedScene { scene, base_dir, name: String::new(), painted: Painted::default() };
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        assert_eq!(outcome.health().result.unsound_values, 0, "{preset}");
        assert!(outcome.health().warnings.iter().any(|warning| warning.contains("conserve energy")), "{preset}");
    }
}
