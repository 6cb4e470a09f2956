//! Files read back against the function they were written from.

use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI};
use std::path::Path;
use std::sync::Arc;

use glam::{UVec2, Vec2, Vec3};

use super::*;
use crate::brdf::rgl::table::RglTable;
use crate::brdf::rgl::tensor_file::TensorFile;
use crate::brdf::{Brdf, LobeAngles, Measured, Term};
use crate::directions::{from_angles, half_vector};
use crate::filtering::{Direct, FacetSum, Form, SumMaterial};
use crate::geometry::{Facets, TileMesh, heightfield};
use crate::visibility::{Horizons, Visibility};

const SMALL: ExportResolution = ExportResolution { theta_i: 4, phi_i: 6, theta_o: 5, phi_o: 8 };

fn sized(resolution: ExportResolution) -> ExportOptions {
    ExportOptions { resolution: Some(resolution), ..ExportOptions::default() }
}

fn small() -> ExportOptions {
    sized(SMALL)
}

fn silent(_: f32) -> bool {
    true
}

fn brdf_of(mesh: &TileMesh, term: Term) -> EffectiveBrdf {
    let mut facets = Facets::sample(mesh, 300, 1);
    facets.sort_for_sums();
    let visibility = match &mesh.height_grid {
        Some(heights) => Visibility::Horizons(Horizons::march(heights, mesh.size, &facets, 16, 0.02)),
        None => Visibility::Unblocked { facets: facets.len() },
    };
    let materials = [SumMaterial { brdf: Brdf { terms: vec![term] }, color: Vec3::new(1.0, 0.5, 0.25) }];
    let sum = FacetSum::new(&facets, &[0], &materials);
    let form = Form::Direct(Direct { sum: Arc::new(sum), visibility: Arc::new(visibility) });
    EffectiveBrdf { form, base_area: f64::from(mesh.base_area()) }
}

/// A corrugated tile: anisotropic, so that mixed-up axes show.
fn corrugated() -> EffectiveBrdf {
    let wave =
        |at: Vec2| 0.15 * (std::f32::consts::TAU * at.x).sin() + 0.05 * (std::f32::consts::TAU * (at.x + at.y)).cos();
    let mesh = heightfield::from_function(UVec2::splat(16), Vec2::new(1.0, 2.0), wave);
    brdf_of(&mesh, Term::CookTorrance { roughness: 0.5, f0: Vec3::new(0.9, 0.6, 0.3) })
}

/// A flat Lambertian tile, albedo 0.8: `f̄ / cos θ_i` is albedo times colour over π everywhere.
fn flat() -> EffectiveBrdf {
    let mesh = TileMesh {
        size: Vec2::ONE,
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        triangle_slot: vec![0, 0],
        slots: vec!["surface".to_owned()],
        closes_plane: true,
        ..TileMesh::default()
    };
    brdf_of(&mesh, Term::Lambertian { albedo: Vec3::splat(0.8) })
}

fn meta() -> ExportMeta {
    ExportMeta {
        scene: "a \"quoted\" näme\nand a line".to_owned(),
        quality: "standard".to_owned(),
        seed: 7,
        tile_size: [1.0, 2.0],
        tile_unit: "mm".to_owned(),
        closes_plane: true,
        notes: vec!["grooves: 7.3 became 7".to_owned()],
    }
}

/// Every pair of the small grid with `(f̄/cos θ_i, G)` straight from the function, viewer fastest.
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

/// `.npy` members of an `.npz` by name: (header, data), found through the directory, CRCs checked.
fn read_npz(bytes: &[u8]) -> HashMap<String, (String, Vec<u8>)> {
    let half = |at: usize| usize::from(u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap()));
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let end = bytes.len() - 22;
    let mut at = word(end + 16);
    let mut members = HashMap::new();
    for _ in 0..half(end + 10) {
        assert_eq!(&bytes[at..at + 4], b"PK\x01\x02");
        let (size, name_length, local) = (word(at + 24), half(at + 28), word(at + 42));
        let name = String::from_utf8(bytes[at + 46..at + 46 + name_length].to_vec()).unwrap();
        let npy = &bytes[local + 30 + name_length..][..size];
        assert_eq!(&npy[..8], b"\x93NUMPY\x01\x00");
        let header_end = 10 + usize::from(u16::from_le_bytes([npy[8], npy[9]]));
        assert_eq!(header_end % 64, 0);
        let header = String::from_utf8(npy[10..header_end].to_vec()).unwrap();
        members.insert(name.trim_end_matches(".npy").to_owned(), (header, npy[header_end..].to_vec()));
        at += 46 + name_length;
    }
    assert_eq!(at, end);
    members
}

fn floats(data: &[u8]) -> Vec<f32> {
    data.as_chunks::<4>().0.iter().map(|bytes| f32::from_ne_bytes(*bytes)).collect()
}

#[test]
fn an_npz_holds_what_eval_says_at_every_pair() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let brdf = corrugated();
    let report = write(&brdf, &meta(), &small(), &path, &silent).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!((report.pairs, report.bytes), (4 * 6 * 5 * 8, bytes.len() as u64));
    let members = read_npz(&bytes);
    assert!(members["brdf"].0.contains("'shape': (4,6,5,8,3,)"), "{}", members["brdf"].0);
    assert!(members["projected_area"].0.contains("'shape': (5,8,)") && members["meta"].0.contains("'shape': ()"));
    let (values, g) = (floats(&members["brdf"].1), floats(&members["g"].1));
    let axes = ["theta_i", "phi_i", "theta_o", "phi_o"].map(|name| floats(&members[name].1));
    for (k, (angles, expected_brdf, expected_g)) in expected(&brdf, &SMALL).into_iter().enumerate() {
        assert!(close(Vec3::from_slice(&values[3 * k..]), expected_brdf), "{angles:?}");
        assert!(close(Vec3::from_slice(&g[3 * k..]), expected_g), "{angles:?}");
        let index = [k / 240, k / 40 % 6, k / 8 % 5, k % 8];
        for axis in 0..4 {
            assert!((axes[axis][index[axis]] - angles[axis]).abs() < 1e-6);
        }
    }
    let areas = floats(&members["projected_area"].1);
    let o = from_angles(axes[2][3], axes[3][2]);
    assert_eq!(areas[3 * 8 + 2], brdf.relative_projected_area(o));
    let text: String =
        members["meta"].1.as_chunks::<4>().0.iter().map(|c| char::from_u32(u32::from_ne_bytes(*c)).unwrap()).collect();
    let described: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(described["scene"], meta().scene.as_str());
    assert_eq!(described["base_area"], 2.0);
    assert_eq!(members["seed"].1, 7_u64.to_ne_bytes());
}

#[test]
fn a_csv_has_a_header_and_a_row_a_pair() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.CSV");
    let brdf = corrugated();
    write(&brdf, &meta(), &small(), &path, &silent).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let mut lines = text.lines().skip_while(|line| line.starts_with('#'));
    assert_eq!(lines.next(), Some("theta_i,phi_i,theta_o,phi_o,r,g,b,g_r,g_g,g_b"));
    let mut rows = 0;
    for (line, (angles, brdf, g)) in lines.by_ref().zip(expected(&brdf, &SMALL)) {
        let row: Vec<f32> = line.split(',').map(|number| number.parse().unwrap()).collect();
        assert!((0..4).all(|axis| (row[axis] - angles[axis]).abs() < 1e-6) && row.len() == 10, "{line}");
        assert!(close(Vec3::from_slice(&row[4..]), brdf) && close(Vec3::from_slice(&row[7..]), g), "{line}");
        rows += 1;
    }
    assert_eq!((rows, lines.next()), (4 * 6 * 5 * 8, None));
    assert!(text.contains("# scene: a \"quoted\" näme and a line\n"), "{text:.2000}");
    let mut streamed = Vec::new();
    write_csv(&brdf, &meta(), &small(), &mut streamed, &silent).unwrap();
    assert_eq!(streamed, text.as_bytes());
}

#[test]
fn an_exr_is_an_atlas_of_both_quantities() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let brdf = corrugated();
    write(&brdf, &meta(), &small(), &path, &silent).unwrap();
    let image = exr::prelude::read_all_flat_layers_from_file(&path).unwrap();
    let names: Vec<String> =
        image.layer_data.iter().map(|layer| layer.attributes.layer_name.as_ref().unwrap().to_string()).collect();
    assert_eq!(names, ["brdf", "reciprocal_g"]);
    let pixel = |part: usize, at: usize| {
        // Channels are sorted by name: B, G, R.
        let list = &image.layer_data[part].channel_data.list;
        let value = |channel: usize| list[channel].sample_data.value_by_flat_index(at).to_f32();
        Vec3::new(value(2), value(1), value(0))
    };
    for (k, (angles, brdf, g)) in expected(&brdf, &SMALL).into_iter().enumerate() {
        let [ti, pi, to, po] = [k / 240, k / 40 % 6, k / 8 % 5, k % 8];
        let at = (ti * 5 + to) * (6 * 8) + pi * 8 + po;
        assert!(close(pixel(0, at), brdf) && close(pixel(1, at), g), "{angles:?}");
    }
    let comments = image.layer_data[0].attributes.comments.as_ref().unwrap().to_string();
    let described: serde_json::Value = serde_json::from_str(&comments).unwrap();
    assert_eq!(described["scene"], meta().scene.as_str());
    assert_eq!(described["phi_o"].as_array().unwrap().len(), 8);
}

#[test]
fn a_flat_lambertian_tile_is_albedo_over_pi_and_resamples_without_error() {
    let grid = SMALL.grid();
    let brdf = flat();
    let table = Table::new(&brdf, grid, &silent).unwrap();
    let value = Vec3::new(1.0, 0.5, 0.25) * 0.8 * FRAC_1_PI;
    for (k, (brdf, g)) in table.brdf.iter().zip(&table.g).enumerate() {
        assert!(close(*brdf, value));
        let (light, view) = (table.grid.light.directions()[k / 40], table.grid.view.directions()[k % 40]);
        assert!(close(*g, value * light.z * view.z), "{g} {k}");
    }
    assert!(table.resampling(&brdf).errors.rel_l2 < 1e-5);
}

#[test]
fn bilinear_reading_hits_the_nodes_and_is_continuous_across_pole_and_seam() {
    let table = Table::new(&corrugated(), SMALL.grid(), &silent).unwrap();
    let (lights, views) = (table.grid.light.directions(), table.grid.view.directions());
    for (k, value) in table.brdf.iter().enumerate() {
        let (i, o) = (lights[k / 40], views[k % 40]);
        assert!(close(table.f_bar(i, o) / i.z, *value));
    }
    let near = |a: (f32, f32), b: (f32, f32)| {
        let o = from_angles(0.6, 0.3);
        let (a, b) = (table.f_bar(from_angles(a.0, a.1), o), table.f_bar(from_angles(b.0, b.1), o));
        (a - b).length() < 0.01 * b.length()
    };
    assert!(near((1e-3, 0.4), (1e-3, 0.4 + PI)) && near((0.7, 1e-4), (0.7, 2.0 * PI - 1e-4)));
}

#[test]
fn a_finer_grid_resamples_better_and_the_report_says_so() {
    let brdf = corrugated();
    let error = |rings| {
        let resolution = ExportResolution { theta_i: rings, phi_i: 2 * rings, theta_o: rings, phi_o: 2 * rings };
        Table::new(&brdf, resolution.grid(), &silent).unwrap().resampling(&brdf).errors.rel_l2
    };
    // Shadow edges are kinks, so halving the step halves the error; a smooth function would quarter it.
    let (coarse, fine) = (error(6), error(12));
    assert!(fine < 0.7 * coarse && fine > 0.0 && coarse < 0.5, "{coarse} {fine}");
}

#[test]
fn files_are_the_same_bytes_again_with_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.npz", "a.csv", "a.exr"] {
        let path = folder.path().join(name);
        let bytes = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| write(&corrugated(), &meta(), &small(), &path, &silent)).unwrap();
            std::fs::read(&path).unwrap()
        };
        assert!(bytes(1) == bytes(3), "{name}");
    }
}

#[test]
fn progress_goes_from_nothing_to_all() {
    let told = std::cell::RefCell::new(Vec::new());
    let tell = |part| {
        told.borrow_mut().push(part);
        true
    };
    Table::new(&flat(), SMALL.grid(), &tell).unwrap();
    let told = told.into_inner();
    assert!(told.first() == Some(&0.0) && told.last() == Some(&1.0) && told.is_sorted());
}

#[test]
fn a_table_that_is_given_up_replaces_nothing_and_leaves_nothing_beside() {
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
fn what_cannot_be_written_is_the_callers_error_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("folder.npz")).unwrap();
    let old = folder.path().join("old.npz");
    std::fs::write(&old, b"old").unwrap();
    let attempt = |name: &str, resolution: &ExportResolution| {
        let error = write(&flat(), &meta(), &sized(*resolution), &folder.path().join(name), &silent).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
        error.to_string()
    };
    for (name, says) in [
        ("a.jpg", ".binary, .xml"),
        ("a.jpg", "the ending .jpg"),
        ("a", "without an ending"),
        ("missing/a.npz", "missing/a.npz"),
        ("folder.npz", "a folder"),
    ] {
        let error = attempt(name, &SMALL);
        assert!(error.contains(says) && error.contains(name), "{error}");
    }
    assert!(attempt("old.npz", &ExportResolution { theta_o: 0, ..SMALL }).contains("theta_o"));
    assert!(attempt("old.npz", &ExportResolution { phi_i: usize::MAX, ..SMALL }).contains("phi_i"));
    let huge = ExportResolution { theta_i: 1024, phi_i: 1024, theta_o: 1024, phi_o: 1024 };
    assert!(attempt("old.npz", &huge).contains("pairs"));
    assert!(check_ending(Path::new("a.npz")).is_ok() && check_ending(Path::new("a.npy")).is_err());
    assert_eq!(std::fs::read(&old).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no temporary files are left");
}

/// What Mitsuba and the others do with a file, as `src/brdf/rgl` has it.
#[test]
fn a_bsdf_reads_back_as_the_function_and_has_a_note_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bsdf");
    let brdf = corrugated();
    let size = ExportResolution { theta_i: 9, phi_i: 24, theta_o: 24, phi_o: 24 };
    let report = write(&brdf, &meta(), &sized(size), &path, &silent).unwrap();
    let file = TensorFile::read(&path).unwrap();
    assert!(file.has("luminance") && file.has("description") && !file.has("spectra"));
    let table = RglTable::from_fields(&file).unwrap();
    assert_eq!((table.phi_i.len(), table.theta_i.len(), table.jacobian), (25, 9, true));
    let reading = sampler::reading_error(&brdf, |i, o| table.eval(o.as_dvec3(), i.as_dvec3()).as_vec3());
    // Rounding to f32 is all that lies between the file and what was said of it.
    assert!((reading.mean - report.reading.mean).abs() < 1e-4, "{reading:?} {:?}", report.reading);
    assert!(reading.mean < 0.06, "{reading:?}");
    let note = std::fs::read_to_string(report.note.unwrap()).unwrap();
    assert!(note.contains("Scene: a \"quoted\" näme and a line") && note.contains("half vector"), "{note}");
    let image = crate::brdf::rgl::load(&path).unwrap_err().to_string();
    assert!(image.contains("24 azimuths") || image.contains("25 azimuths"), "{image}");
}

#[test]
fn a_flat_tile_comes_back_as_a_small_scale_brdf_through_every_format_that_loads() {
    let folder = tempfile::tempdir().unwrap();
    let value = Vec3::new(1.0, 0.5, 0.25) * 0.8 * FRAC_1_PI;
    for name in ["a.bsdf", "a.binary", "a.bin", "a.npz"] {
        let path = folder.path().join(name);
        let size = ExportResolution { theta_i: 9, phi_i: 24, theta_o: 24, phi_o: 24 };
        let report = write(&flat(), &meta(), &sized(size), &path, &silent).unwrap();
        assert!(report.anisotropy_lost.unwrap_or(0.0) < 1e-4);
        let table = match path.extension().and_then(|ending| ending.to_str()) {
            Some("bsdf") => crate::brdf::rgl::load(&path),
            Some("binary") => crate::brdf::merl::load(&path),
            Some("bin") => crate::brdf::utia::load(&path),
            _ => crate::brdf::npz::load(&path),
        };
        let table = table.unwrap();
        for (theta_i, theta_o, phi) in [(0.1, 0.3, 2.0), (0.7, 0.2, 0.3), (1.0, 1.1, 3.0)] {
            let (i, o) = (from_angles(theta_i, 0.0), from_angles(theta_o, phi));
            let found = table.f_r(&LobeAngles::new(Vec3::Z, i, o, half_vector(i, o)));
            assert!((found / value - 1.0).abs().max_element() < 0.03, "{name} {theta_i} {theta_o}: {found} {value}");
        }
    }
}

#[test]
fn reflectances_of_a_flat_lambertian_are_its_albedo() {
    let reflectances = Reflectances::of(&flat());
    let albedo = Vec3::new(1.0, 0.5, 0.25) * 0.8;
    assert_eq!(reflectances.of_direction.len(), 11);
    assert!(reflectances.of_direction.iter().all(|(_, value)| (*value / albedo - 1.0).abs().max_element() < 1e-3));
    assert!((reflectances.diffuse / albedo - 1.0).abs().max_element() < 1e-3);
}

#[test]
fn utia_and_astm_hold_the_brdf_in_their_orders() {
    let folder = tempfile::tempdir().unwrap();
    let brdf = corrugated();
    let path = folder.path().join("a.bin");
    write(&brdf, &meta(), &ExportOptions::default(), &path, &silent).unwrap();
    let numbers: Vec<f64> =
        std::fs::read(&path).unwrap().as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    assert_eq!(numbers.len(), 3 * 6 * 48 * 6 * 48);
    let (ti, pi, to, po) = (2, 5, 4, 31);
    let radians = |k: usize, step: f32| (k as f32 * step).to_radians();
    let (i, o) = (from_angles(radians(ti, 15.0), radians(pi, 7.5)), from_angles(radians(to, 15.0), radians(po, 7.5)));
    let expected = brdf.eval(i, o) / i.z;
    for channel in 0..3 {
        let at = (((channel * 6 + ti) * 48 + pi) * 6 + to) * 48 + po;
        assert!((numbers[at] as f32 / expected[channel] - 1.0).abs() < 1e-3, "{} {expected}", numbers[at]);
    }
    let path = folder.path().join("a.astm");
    write(&brdf, &meta(), &small(), &path, &silent).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("NUM_POINTS 960\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B\n"));
    let rows = text.lines().skip_while(|line| !line.starts_with("VARS")).skip(1);
    for (line, (angles, brdf, _)) in rows.zip(super::tests::expected(&brdf, &SMALL)) {
        let row: Vec<f32> = line.split(',').map(|number| number.parse().unwrap()).collect();
        assert!((0..4).all(|axis| (row[axis] - angles[axis]).abs() < 1e-6) && close(Vec3::from_slice(&row[4..]), brdf));
    }
}

#[test]
fn radiance_files_hold_every_value_and_balance_their_tags() {
    let folder = tempfile::tempdir().unwrap();
    for basis in [RadianceBasis::Klems, RadianceBasis::TensorTree] {
        let path = folder.path().join("a.xml");
        let options = ExportOptions { radiance: basis, ..ExportOptions::default() };
        write(&flat(), &meta(), &options, &path, &silent).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let (opened, closed) = (text.matches('<').count(), text.matches("</").count());
        assert_eq!(opened, 2 * closed + 1, "all but the declaration come in pairs");
        let data: Vec<&str> =
            text.split("<ScatteringData>").skip(1).filter_map(|rest| rest.split("</ScatteringData>").next()).collect();
        assert_eq!(data.len(), 4);
        // The luminance of a flat Lambertian is the same everywhere.
        let luminance = 0.8 * FRAC_1_PI * (0.212_639 + 0.5 * 0.715_169 + 0.25 * 0.072_192);
        let numbers: Vec<f32> = data[1]
            .split(|c: char| c.is_whitespace() || "{}".contains(c))
            .filter_map(|word| word.parse().ok())
            .collect();
        assert!(numbers.iter().all(|value| (value / luminance - 1.0).abs() < 1e-3), "{:?}", &numbers[..3]);
        assert_eq!(numbers.len(), if basis == RadianceBasis::Klems { 145 * 145 } else { 1 });
    }
}

#[test]
fn a_failure_while_writing_leaves_the_old_file_whole() {
    let folder = tempfile::tempdir().unwrap();
    let old = folder.path().join("old.npz");
    std::fs::write(&old, b"old").unwrap();
    let full = replace::replacing(&old, |out| {
        out.write_all(b"half of the new")?;
        Err::<(), _>(io::Error::other("disk full"))
    });
    let error = full.unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("old.npz: output: found disk full"), "{error}");
    assert_eq!(std::fs::read(&old).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    replace_file(&old, b"new").unwrap();
    assert_eq!(std::fs::read(&old).unwrap(), b"new");
}

#[test]
fn a_reader_that_hangs_up_is_no_failure() {
    struct Closed;
    impl Write for Closed {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::BrokenPipe.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    assert!(write_csv(&flat(), &meta(), &small(), &mut Closed, &silent).is_ok());
}

#[test]
fn numpy_loads_an_npz() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let brdf = corrugated();
    write(&brdf, &meta(), &small(), &path, &silent).unwrap();
    let script = "import sys, json\n\
        try: import numpy\n\
        except ImportError: sys.exit(77)\n\
        z = numpy.load(sys.argv[1])\n\
        meta = json.loads(str(z['meta']))\n\
        assert z['brdf'].shape == z['g'].shape == (4, 6, 5, 8, 3) and z['brdf'].dtype == 'f4'\n\
        assert float(z['base_area']) == 2.0 and int(z['seed']) == 7 and meta['tile_unit'] == 'mm'\n\
        g = z['brdf'] * numpy.cos(z['theta_i'])[:, None, None, None, None] * z['projected_area'][..., None]\n\
        assert numpy.allclose(g, z['g'], rtol=1e-4, atol=1e-7)\n\
        print(*z['brdf'][3, 1, 2, 5])\n";
    let Ok(run) = std::process::Command::new("python3").args(["-c", script]).arg(&path).output() else {
        return eprintln!("SKIPPED: no python3 to load the .npz with");
    };
    if run.status.code() == Some(77) {
        return eprintln!("SKIPPED: no numpy to load the .npz with");
    }
    let said = String::from_utf8(run.stdout).unwrap();
    let complaint = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{complaint}");
    let loaded: Vec<f32> = said.split_whitespace().map(|number| number.parse().unwrap()).collect();
    let (_, value, _) = expected(&brdf, &SMALL)[((3 * 6 + 1) * 5 + 2) * 8 + 5];
    assert!(close(Vec3::from_slice(&loaded), value), "{said} {value}");
}
