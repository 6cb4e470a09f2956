//! Tests of `.npz`, `.csv` and `.exr`, and of interpolation between the nodes of the grid.

use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use super::*;
use crate::math::directions::from_angles;

/// Returns the `.npy` members of an `.npz` by name as (header, data), found through the directory.
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
fn an_npz_contains_the_value_of_eval_at_every_pair() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let brdf = corrugated();
    let report = write(&brdf, &meta(), &small(), &path, &never_cancel).unwrap();
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
    assert_eq!(described["reflectance"].as_array().unwrap().len(), 11);
    assert_eq!(members["seed"].1, 7_u64.to_ne_bytes());
}

#[test]
fn a_csv_has_a_header_and_a_row_per_pair() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.CSV");
    let brdf = corrugated();
    write(&brdf, &meta(), &small(), &path, &never_cancel).unwrap();
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
    write_csv(&brdf, &meta(), &small(), &mut streamed, &never_cancel).unwrap();
    assert_eq!(streamed, text.as_bytes());
}

#[test]
fn an_exr_is_an_atlas_of_both_quantities() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let brdf = corrugated();
    write(&brdf, &meta(), &small(), &path, &never_cancel).unwrap();
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
fn a_flat_lambertian_tile_is_albedo_over_pi_and_interpolates_without_error() {
    let grid = SMALL.grid();
    let brdf = flat();
    let table = ExportTable::new(&brdf, grid, &never_cancel).unwrap();
    let value = Vec3::new(1.0, 0.5, 0.25) * 0.8 * FRAC_1_PI;
    for (k, (brdf, g)) in table.brdf.iter().zip(&table.g).enumerate() {
        assert!(close(*brdf, value));
        let (light, view) = (table.grid.light.directions()[k / 40], table.grid.view.directions()[k % 40]);
        assert!(close(*g, value * light.z * view.z), "{g} {k}");
    }
    assert!(table.resampling(&brdf).errors.rel_l2 < 1e-5);
}

#[test]
fn bilinear_interpolation_reproduces_the_nodes_and_is_continuous_across_pole_and_seam() {
    let table = ExportTable::new(&corrugated(), SMALL.grid(), &never_cancel).unwrap();
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
fn a_finer_grid_reports_a_smaller_error() {
    let brdf = corrugated();
    let error = |rings| {
        let resolution = ExportResolution { theta_i: rings, phi_i: 2 * rings, theta_o: rings, phi_o: 2 * rings };
        ExportTable::new(&brdf, resolution.grid(), &never_cancel).unwrap().resampling(&brdf).errors.rel_l2
    };
    // Shadow edges are kinks, so halving the step halves the error; a smooth function would quarter it.
    let (coarse, fine) = (error(6), error(12));
    assert!(fine < 0.7 * coarse && fine > 0.0 && coarse < 0.5, "{coarse} {fine}");
}

#[test]
fn numpy_loads_an_npz() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let brdf = corrugated();
    write(&brdf, &meta(), &small(), &path, &never_cancel).unwrap();
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
        return eprintln!("SKIPPED: python3, which loads the .npz, is missing");
    };
    if run.status.code() == Some(77) {
        return eprintln!("SKIPPED: numpy, which loads the .npz, is missing");
    }
    let stdout = String::from_utf8(run.stdout).unwrap();
    let stderr = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{stderr}");
    let loaded: Vec<f32> = stdout.split_whitespace().map(|number| number.parse().unwrap()).collect();
    let (_, value, _) = expected(&brdf, &SMALL)[((3 * 6 + 1) * 5 + 2) * 8 + 5];
    assert!(close(Vec3::from_slice(&loaded), value), "{stdout} {value}");
}
