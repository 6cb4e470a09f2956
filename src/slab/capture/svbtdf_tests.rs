//! The file of a captured sheet, its pixels and its mean.

use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use super::super::ring_table::RingTable;
use super::bounced::{ALPHAS, Bounced, ROUGHNESSES, SheetBounces};
use super::lobe::{LobeOptics, PointModel, SlopeGrid};
use super::svbtdf::Svbtdf;

/// A sheet of 3 x 2 pixels between two models.
fn sheet() -> Svbtdf {
    let grid = SlopeGrid { side: 16, span: 0.8 };
    let model = |width: f64, alpha: f64| {
        let ln = |k: usize| -(grid.node(k) / width).length_squared();
        let ln_density = (0..256).map(ln).collect();
        let mut model = PointModel { grid, alpha, ln_density };
        model.normalise();
        model
    };
    Svbtdf {
        size: [3, 2],
        optics: LobeOptics::new(1.5, 0.25),
        grid,
        models: vec![model(0.2, 0.25), model(0.3, 0.75)],
        neighbours: 2,
        index: (0..6).flat_map(|_| [0, 1]).collect(),
        weight: (0..6).flat_map(|k| [0.125 * k as f32, 1.0 - 0.125 * k as f32]).collect(),
        scale: (0..6).map(|k| Vec3::new(0.5, 0.6, 0.1 * k as f32)).collect(),
        diffuse: vec![Vec3::splat(0.02); 6],
        bounced: None,
    }
}

fn pair() -> (DVec3, DVec3) {
    let i = DVec3::new(0.3, 0.1, 0.9).normalize();
    (i, DVec3::new(-0.25, -0.2, -0.9).normalize())
}

#[test]
fn a_file_comes_back_to_the_bits_of_f32() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let written = sheet();
    written.write(&path).unwrap();
    let read = Svbtdf::read(&path).unwrap();
    assert_eq!((read.size, &read.index, &read.weight), (written.size, &written.index, &written.weight));
    assert_eq!((&read.scale, &read.diffuse), (&written.scale, &written.diffuse));
    let (i, o) = pair();
    for pixel in 0..6 {
        let (a, b) = (read.btdf(pixel, i, o), written.btdf(pixel, i, o));
        assert!((a - b).length() < 1e-5 * b.length(), "{pixel}: {a} {b}");
    }
    let again = folder.path().join("b.npz");
    read.write(&again).unwrap();
    assert_eq!(std::fs::read(&path).unwrap().len(), std::fs::read(&again).unwrap().len());
}

#[test]
fn a_pixel_has_the_lobe_of_its_model_and_a_pair_turned_round_has_the_same() {
    let sheet = sheet();
    let (i, o) = pair();
    let terms = sheet.optics.terms(i, o).unwrap();
    for pixel in 0..6 {
        let lobe = sheet.scale[pixel].as_dvec3() * sheet.model(pixel).btdf(&terms) + 0.02;
        assert!((sheet.btdf(pixel, i, o) - lobe).length() < 1e-9 * lobe.length());
        assert_eq!(sheet.btdf(pixel, o, i), sheet.btdf(pixel, i, o));
    }
    assert_eq!(sheet.btdf(0, i, -o), DVec3::ZERO);
    assert_eq!(sheet.pixel_at(DVec2::new(1.4, -0.1)), 4);
}

/// The sheet with light that is reflected inside.
fn with_light() -> Svbtdf {
    let table =
        |k: usize| RingTable::new((0..RingTable::LEN).map(|j| 0.1 + 0.01 * ((j + 7 * k) % 13) as f32).collect());
    let light = Arc::new(Bounced::of_tables((0..ROUGHNESSES * ALPHAS).map(table).collect()));
    let sheet = sheet();
    Svbtdf { bounced: Some(SheetBounces::new(light, &sheet.models)), ..sheet }
}

#[test]
fn light_reflected_inside_is_added_to_pixels_and_their_mean_and_comes_back_from_a_file() {
    let (plain, sheet) = (sheet(), with_light());
    let (i, o) = pair();
    let bounced = sheet.bounced.as_ref().unwrap();
    let mut expected = DVec3::ZERO;
    for pixel in 0..6 {
        let weights = [0, 1].map(|k| f64::from(sheet.weight[2 * pixel + k]));
        let roughness = [0, 1].map(|k: usize| sheet.models[k].roughness());
        let both = (weights[0] * roughness[0].powi(2) + weights[1] * roughness[1].powi(2)).sqrt();
        let light = bounced.light.btdf(both, sheet.model(pixel).alpha, i, o);
        let added = sheet.btdf(pixel, i, o) - plain.btdf(pixel, i, o);
        assert!((added - light * sheet.scale[pixel].as_dvec3()).length() < 1e-6, "{pixel}: {added}");
        let of_models = [0, 1].map(|k: usize| bounced.light.btdf(roughness[k], sheet.models[k].alpha, i, o));
        expected += sheet.scale[pixel].as_dvec3() * (weights[0] * of_models[0] + weights[1] * of_models[1]) / 6.0;
    }
    let added = sheet.mean().btdf(i, o) - plain.mean().btdf(i, o);
    assert!((added - expected).length() < 1e-5, "{added} {expected}");
    let over = DVec3::new(1.0, 1.0, -1.0);
    let turned = sheet.mean().turned().btdf(o * over, i * over);
    assert!((turned - sheet.mean().btdf(i, o)).length() < 1e-6 * turned.length());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    sheet.write(&path).unwrap();
    let read = Svbtdf::read(&path).unwrap();
    assert_eq!(read.bounced.unwrap().light.tables(), bounced.light.tables());
}

#[test]
fn the_mean_is_that_of_the_interpolated_lobes_and_turned_over_it_has_the_pair_turned_over() {
    let sheet = sheet();
    let (i, o) = pair();
    let terms = sheet.optics.terms(i, o).unwrap();
    let lobe = |pixel: usize| {
        let parts = (0..2).map(|k| f64::from(sheet.weight[2 * pixel + k]) * sheet.models[k].btdf(&terms)).sum::<f64>();
        sheet.scale[pixel].as_dvec3() * parts + 0.02
    };
    let expected = (0..6).map(lobe).sum::<DVec3>() / 6.0;
    let mean = sheet.mean();
    assert!((mean.btdf(i, o) - expected).length() < 1e-6 * expected.length());
    let over = DVec3::new(1.0, 1.0, -1.0);
    let turned = mean.turned().btdf(o * over, i * over);
    assert!((turned - expected).length() < 1e-6 * expected.length(), "{turned} {expected}");
    assert!((0.1..0.3).contains(&mean.deviation()));
}

#[test]
fn a_file_that_is_no_svbtdf_is_refused_with_the_array() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let refused = |part: &str| {
        let error = Svbtdf::read(&path).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains(part), "{error}");
    };
    refused("a.npz");
    std::fs::write(&path, b"no archive").unwrap();
    refused("ZIP");
    let good = sheet();
    let cases: [(Svbtdf, &str); 5] = [
        (Svbtdf { index: vec![9; 12], ..good.clone() }, "index"),
        (Svbtdf { weight: vec![f32::NAN; 12], ..good.clone() }, "weight"),
        (Svbtdf { scale: vec![Vec3::splat(-1.0); 6], ..good.clone() }, "scale"),
        (Svbtdf { optics: LobeOptics::new(0.5, 0.2), ..good.clone() }, "eta"),
        (Svbtdf { grid: SlopeGrid { side: 16, span: 0.0 }, ..good.clone() }, "span"),
    ];
    for (sheet, part) in cases {
        sheet.write(&path).unwrap();
        refused(part);
    }
    good.write(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert_eq!(Svbtdf::read(&path).unwrap_err().exit_code(), 2);
}
