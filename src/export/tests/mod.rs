//! Tests that compare written files with the effective BRDF. This module holds what all formats share.

mod formats;
mod grids;

use std::f32::consts::{FRAC_PI_2, PI};
use std::path::Path;
use std::sync::Arc;

use glam::{UVec2, Vec2, Vec3};

use super::*;
use crate::brdf::{Brdf, Material, Term};
use crate::effective::{Direct, FacetSum, Representation};
use crate::geometry;
use crate::geometry::families::heightfield;
use crate::geometry::{Facets, TileMesh};
use crate::math::directions::from_angles;
use crate::scene::{Flat, Geometry, Scene};
use crate::visibility::{HorizonMap, Visibility};

const SMALL: ExportResolution = ExportResolution { theta_i: 4, phi_i: 6, theta_o: 5, phi_o: 8 };

fn sized(resolution: ExportResolution) -> ExportOptions {
    ExportOptions { resolution: Some(resolution), ..ExportOptions::default() }
}

fn small() -> ExportOptions {
    sized(SMALL)
}

fn never_cancel(_: f32) -> bool {
    true
}

fn brdf_of(mesh: &TileMesh, term: Term) -> EffectiveBrdf {
    let mut facets = Facets::sample(mesh, 300, 1);
    facets.sort_for_sums();
    let visibility = match &mesh.height_grid {
        Some(heights) => Visibility::HorizonMap(HorizonMap::march(heights, mesh.size, &facets, 16, 0.02)),
        None => Visibility::Unblocked { facets: facets.len() },
    };
    let materials = [Material { brdf: Brdf { terms: vec![term] }, color: Vec3::new(1.0, 0.5, 0.25) }];
    let sum = FacetSum::new(&facets, &[0], &materials);
    let representation = Representation::Direct(Direct::new(Arc::new(sum), Arc::new(visibility)));
    EffectiveBrdf { representation, base_area: f64::from(mesh.base_area()) }
}

/// A corrugated tile. It is anisotropic, so that exchanged axes fail a test.
fn corrugated() -> EffectiveBrdf {
    let wave =
        |at: Vec2| 0.15 * (std::f32::consts::TAU * at.x).sin() + 0.05 * (std::f32::consts::TAU * (at.x + at.y)).cos();
    let mesh = heightfield::from_function(UVec2::splat(16), Vec2::new(1.0, 2.0), wave);
    brdf_of(&mesh, Term::CookTorrance { roughness: 0.5, f0: Vec3::new(0.9, 0.6, 0.3) })
}

/// A flat Lambertian tile with albedo 0.8: `f̄ / cos θ_i` is albedo times colour over π everywhere.
fn flat() -> EffectiveBrdf {
    let tile = Scene::of(Geometry::Flat(Flat::default())).tile;
    brdf_of(&geometry::build(&tile, Path::new("")).unwrap(), Term::Lambertian { albedo: Vec3::splat(0.8) })
}

fn meta() -> ExportMeta {
    ExportMeta {
        scene: "a \"quoted\" näme\nand a line".to_owned(),
        quality: "standard".to_owned(),
        seed: 7,
        tile_size: [1.0, 2.0],
        tile_unit: "mm".to_owned(),
        closes_plane: true,
        isotropic: false,
        notes: vec!["grooves: 7.3 became 7".to_owned()],
    }
}

/// Returns every pair of the grid with `(f̄/cos θ_i, G)` of the function itself, viewer fastest.
fn expected(brdf: &EffectiveBrdf, resolution: &ExportResolution) -> Vec<([f32; 4], Vec3, Vec3)> {
    let theta = |a: usize, n: usize| (a as f32 + 0.5) * FRAC_PI_2 / n as f32;
    let phi = |b: usize, n: usize| 2.0 * PI * b as f32 / n as f32;
    let mut rows = Vec::new();
    for ti in 0..resolution.theta_i {
        for pi in 0..resolution.phi_i {
            for to in 0..resolution.theta_o {
                for po in 0..resolution.phi_o {
                    let angles = [
                        theta(ti, resolution.theta_i),
                        phi(pi, resolution.phi_i),
                        theta(to, resolution.theta_o),
                        phi(po, resolution.phi_o),
                    ];
                    let (i, o) = (from_angles(angles[0], angles[1]), from_angles(angles[2], angles[3]));
                    rows.push((angles, brdf.eval(i, o) / i.z, brdf.g(i, o)));
                }
            }
        }
    }
    rows
}

fn close(a: Vec3, b: Vec3) -> bool {
    (a - b).length() <= 2e-4 * b.length() + 1e-6
}

#[test]
fn files_have_the_same_bytes_with_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.npz", "a.csv", "a.exr"] {
        let path = folder.path().join(name);
        let bytes = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| write(&corrugated(), &meta(), &small(), &path, &never_cancel)).unwrap();
            std::fs::read(&path).unwrap()
        };
        assert!(bytes(1) == bytes(3), "{name}");
    }
}

#[test]
fn progress_runs_from_0_to_1() {
    let reports = std::cell::RefCell::new(Vec::new());
    let record = |done| {
        reports.borrow_mut().push(done);
        true
    };
    ExportTable::new(&flat(), SMALL.grid(), &record).unwrap();
    let reports = reports.into_inner();
    assert!(reports.first() == Some(&0.0) && reports.last() == Some(&1.0) && reports.is_sorted());
}

#[test]
fn a_cancelled_table_replaces_nothing_and_leaves_no_temporary_file() {
    let folder = tempfile::tempdir().unwrap();
    for (ending, _) in FORMATS {
        let path = folder.path().join(format!("table.{ending}"));
        std::fs::write(&path, "old").unwrap();
        let error = write(&flat(), &meta(), &ExportOptions::default(), &path, &|_| false).unwrap_err();
        assert!(matches!(error, Error::Cancelled), "{ending}: {error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"old", "{ending}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), FORMATS.len());
}

#[test]
fn an_unwritable_table_is_an_input_error_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("folder.npz")).unwrap();
    let old = folder.path().join("old.npz");
    std::fs::write(&old, b"old").unwrap();
    let attempt = |name: &str, resolution: &ExportResolution| {
        let error = write(&flat(), &meta(), &sized(*resolution), &folder.path().join(name), &never_cancel).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
        error.to_string()
    };
    for (name, expected) in [
        ("a.jpg", ".binary, .xml"),
        ("a.jpg", "the ending .jpg"),
        ("a", "without an ending"),
        ("missing/a.npz", "missing/a.npz"),
        ("folder.npz", "a folder"),
    ] {
        let error = attempt(name, &SMALL);
        assert!(error.contains(expected) && error.contains(name), "{error}");
    }
    assert!(attempt("old.npz", &ExportResolution { theta_o: 0, ..SMALL }).contains("theta_o"));
    assert!(attempt("old.npz", &ExportResolution { phi_i: usize::MAX, ..SMALL }).contains("phi_i"));
    let huge = ExportResolution { theta_i: 1024, phi_i: 1024, theta_o: 1024, phi_o: 1024 };
    assert!(attempt("old.npz", &huge).contains("pairs"));
    assert!(check_ending(Path::new("a.npz")).is_ok() && check_ending(Path::new("a.npy")).is_err());
    assert_eq!(std::fs::read(&old).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no temporary files are left");
}

#[test]
fn a_failure_while_writing_leaves_the_old_file_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let old = folder.path().join("old.npz");
    std::fs::write(&old, b"old").unwrap();
    let result = atomic_file::write_atomically(&old, |out| {
        out.write_all(b"half of the new")?;
        Err::<(), _>(io::Error::other("disk full"))
    });
    let error = result.unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("old.npz: output: found disk full"), "{error}");
    assert_eq!(std::fs::read(&old).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    replace_file(&old, b"new").unwrap();
    assert_eq!(std::fs::read(&old).unwrap(), b"new");
}

#[test]
fn a_reader_that_closes_the_stream_early_is_no_failure() {
    struct Closed;
    impl Write for Closed {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::BrokenPipe.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    assert!(write_csv(&flat(), &meta(), &small(), &mut Closed, &never_cancel).is_ok());
}
