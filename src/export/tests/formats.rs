//! The formats of other programs.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::*;
use crate::brdf::rgl::table::RglTable;
use crate::brdf::rgl::tensor_file::TensorFile;
use crate::brdf::{LobeAngles, Measured};
use crate::math::directions::{from_angles, half_vector};

/// Reads a file as Mitsuba does; `src/brdf/rgl` implements this reader.
#[test]
fn a_bsdf_reads_back_as_the_function_and_has_a_note_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bsdf");
    let brdf = corrugated();
    let size = ExportResolution { theta_i: 9, phi_i: 24, theta_o: 24, phi_o: 24 };
    let report = write(&brdf, &meta(), &sized(size), &path, &never_cancel).unwrap();
    let file = TensorFile::read(&path).unwrap();
    assert!(file.has("luminance") && file.has("description") && !file.has("spectra"));
    let table = RglTable::from_fields(&file).unwrap();
    assert_eq!((table.phi_i.len(), table.theta_i.len(), table.jacobian), (25, 9, true));
    let reading = sampler::reading_error(&brdf, |i, o| table.eval(o.as_dvec3(), i.as_dvec3()).as_vec3());
    // The reported error differs from the file's error only by the rounding to f32.
    assert!((reading.mean - report.reading.mean).abs() < 1e-4, "{reading:?} {:?}", report.reading);
    assert!(reading.mean < 0.06, "{reading:?}");
    let note = std::fs::read_to_string(report.note.unwrap()).unwrap();
    assert!(note.contains("Scene: a \"quoted\" näme and a line") && note.contains("half vector"), "{note}");
    let error = crate::brdf::rgl::load(&path).unwrap_err().to_string();
    assert!(error.contains("24 azimuths") || error.contains("25 azimuths"), "{error}");
}

#[test]
fn a_flat_tile_comes_back_as_a_small_scale_brdf_through_every_format_that_loads() {
    let folder = tempfile::tempdir().unwrap();
    let value = Vec3::new(1.0, 0.5, 0.25) * 0.8 * FRAC_1_PI;
    for name in ["a.bsdf", "a.binary", "a.bin", "a.npz"] {
        let path = folder.path().join(name);
        let size = ExportResolution { theta_i: 9, phi_i: 24, theta_o: 24, phi_o: 24 };
        let report = write(&flat(), &meta(), &sized(size), &path, &never_cancel).unwrap();
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
fn an_isotropic_tile_is_tabulated_over_three_angles() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bsdf");
    let tile = Scene::of(Geometry::Flat(Flat::default())).tile;
    let glossy = Term::CookTorrance { roughness: 0.3, f0: Vec3::new(0.9, 0.6, 0.3) };
    let brdf = brdf_of(&geometry::build(&tile, Path::new("")).unwrap(), glossy);
    let size = ExportResolution { theta_i: 13, phi_i: 48, theta_o: 36, phi_o: 36 };
    let three = write(&brdf, &ExportMeta { isotropic: true, ..meta() }, &sized(size), &path, &never_cancel).unwrap();
    let table = RglTable::from_fields(&TensorFile::read(&path).unwrap()).unwrap();
    assert!(table.is_isotropic() && table.phi_i == [0.0]);
    assert!(three.reading.mean < 0.02, "{:?}", three.reading);
    let note = std::fs::read_to_string(three.note.unwrap()).unwrap();
    assert!(note.contains("isotropic"));
    assert!(note.contains("<bsdf type=\"measured\"><string name=\"filename\" value=\"a.bsdf\"/></bsdf>"), "{note}");
    assert!(crate::brdf::rgl::load(&path).is_ok());
    let four = write(&brdf, &meta(), &sized(size), &path, &never_cancel).unwrap();
    assert_eq!(three.pairs * 49, four.pairs);
    assert!(three.reading.mean < 1.5 * four.reading.mean + 1e-3, "{:?} {:?}", three.reading, four.reading);
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
    write(&brdf, &meta(), &ExportOptions::default(), &path, &never_cancel).unwrap();
    let numbers: Vec<f64> =
        std::fs::read(&path).unwrap().as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    assert_eq!(numbers.len(), 3 * 6 * 48 * 6 * 48);
    let (ti, pi, to, po) = (2, 5, 4, 31);
    let radians = |k: usize, step: f32| (k as f32 * step).to_radians();
    let (i, o) = (from_angles(radians(ti, 15.0), radians(pi, 7.5)), from_angles(radians(to, 15.0), radians(po, 7.5)));
    let value = brdf.eval(i, o) / i.z;
    for channel in 0..3 {
        let at = (((channel * 6 + ti) * 48 + pi) * 6 + to) * 48 + po;
        assert!((numbers[at] as f32 / value[channel] - 1.0).abs() < 1e-3, "{} {value}", numbers[at]);
    }
    let path = folder.path().join("a.astm");
    write(&brdf, &meta(), &small(), &path, &never_cancel).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("NUM_POINTS 960\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B\n"));
    let rows = text.lines().skip_while(|line| !line.starts_with("VARS")).skip(1);
    for (line, (angles, brdf, _)) in rows.zip(expected(&brdf, &SMALL)) {
        let row: Vec<f32> = line.split(',').map(|number| number.parse().unwrap()).collect();
        assert!((0..4).all(|axis| (row[axis] - angles[axis]).abs() < 1e-6) && close(Vec3::from_slice(&row[4..]), brdf));
    }
}

#[test]
fn radiance_files_contain_every_value_and_balance_their_tags() {
    let folder = tempfile::tempdir().unwrap();
    for basis in [RadianceBasis::Klems, RadianceBasis::TensorTree] {
        let path = folder.path().join("a.xml");
        let options = ExportOptions { radiance: basis, ..ExportOptions::default() };
        write(&flat(), &meta(), &options, &path, &never_cancel).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let (opened, closed) = (text.matches('<').count(), text.matches("</").count());
        assert_eq!(opened, 2 * closed + 1, "all tags except the declaration come in pairs");
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
fn a_brdf_that_is_not_finite_is_written_in_no_format() {
    let folder = tempfile::tempdir().unwrap();
    let tile = Scene::of(Geometry::Flat(Flat::default())).tile;
    let mesh = geometry::build(&tile, Path::new("")).unwrap();
    let brdf = brdf_of(&mesh, Term::Lambertian { albedo: Vec3::INFINITY });
    let names = FORMATS.iter().map(|(ending, _)| format!("t.{ending}")).chain(["t_spec.bsdf".to_owned()]);
    for name in names {
        for radiance in [RadianceBasis::Klems, RadianceBasis::TensorTree] {
            let sizes = ExportResolution { theta_i: 4, phi_i: 4, theta_o: 8, phi_o: 8 };
            let options = ExportOptions { resolution: Some(sizes), radiance };
            let error = write(&brdf, &meta(), &options, &folder.path().join(&name), &never_cancel).unwrap_err();
            assert!(error.exit_code() == 1 && error.to_string().contains("not finite"), "{name}: {error}");
        }
    }
    let mut out = Vec::new();
    let error = write_csv(&brdf, &meta(), &small(), &mut out, &never_cancel).unwrap_err();
    assert!(error.exit_code() == 1 && error.to_string().starts_with("the result has values"), "{error}");
    assert!(out.is_empty() && std::fs::read_dir(folder.path()).unwrap().next().is_none());
}
