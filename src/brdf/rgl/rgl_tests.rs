use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use super::super::{Brdf, Term};
use super::*;

/// A field of a synthetic file.
struct FieldBytes {
    name: &'static str,
    kind: u8,
    shape: Vec<u64>,
    data: Vec<u8>,
}

fn floats(name: &'static str, shape: &[u64], values: impl IntoIterator<Item = f64>) -> FieldBytes {
    let data = values.into_iter().flat_map(|v| (v as f32).to_le_bytes()).collect();
    FieldBytes { name, kind: 10, shape: shape.to_vec(), data }
}

fn file_of(fields: &[FieldBytes]) -> Vec<u8> {
    let contents: usize = fields.iter().map(|f| 2 + f.name.len() + 11 + 8 * f.shape.len()).sum();
    let mut bytes = b"tensor_file\0\x01\x00".to_vec();
    bytes.extend((fields.len() as u32).to_le_bytes());
    let mut offset = 18 + contents;
    for field in fields {
        bytes.extend((field.name.len() as u16).to_le_bytes());
        bytes.extend(field.name.as_bytes());
        bytes.extend((field.shape.len() as u16).to_le_bytes());
        bytes.push(field.kind);
        bytes.extend((offset as u64).to_le_bytes());
        field.shape.iter().for_each(|n| bytes.extend(n.to_le_bytes()));
        offset += field.data.len();
    }
    fields.iter().for_each(|field| bytes.extend(&field.data));
    bytes
}

/// Fields of a Lambertian of albedo (0.8, 0.4, 0.2): no warp, `rgb = 4 · albedo/π · cosθ_o`.
fn lambertian_fields() -> Vec<FieldBytes> {
    let (slices, n) = (14_u64, 40_u64);
    let thetas: Vec<f64> = (0..slices).map(|k| k as f64 / (slices - 1) as f64 * FRAC_PI_2).collect();
    let mut rgb = Vec::new();
    for &theta_i in &thetas {
        for albedo in [0.8, 0.4, 0.2] {
            for y in 0..n {
                for x in 0..n {
                    let theta_m = (x as f64 / (n - 1) as f64).powi(2) * FRAC_PI_2;
                    let phi_m = (y as f64 / (n - 1) as f64) * 2.0 * PI - PI;
                    let i_dot_m = theta_i.cos() * theta_m.cos() + theta_i.sin() * theta_m.sin() * phi_m.cos();
                    // No clamp at the horizon, so that bilinear interpolation across it stays smooth.
                    rgb.push(4.0 * albedo / PI * (2.0 * i_dot_m * theta_m.cos() - theta_i.cos()));
                }
            }
        }
    }
    vec![
        floats("phi_i", &[1], [0.0]),
        floats("theta_i", &[slices], thetas),
        floats("ndf", &[2, 2], [1.0; 4]),
        floats("sigma", &[2, 2], [1.0; 4]),
        floats("vndf", &[1, slices, 3, 3], vec![1.0; (slices * 9) as usize]),
        floats("rgb", &[1, slices, 3, n, n], rgb),
        FieldBytes { name: "jacobian", kind: 1, shape: vec![1], data: vec![1] },
    ]
}

fn parse(fields: &[FieldBytes]) -> std::result::Result<RglTable, InputError> {
    RglTable::from_fields(&TensorFile::parse(file_of(fields))?)
}

#[test]
fn a_lambertian_file_is_read_as_a_lambertian() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("grey.bsdf");
    std::fs::write(&path, file_of(&lambertian_fields())).unwrap();
    let table = load(&path).unwrap();
    assert_eq!(table.name(), "grey");
    assert!(table.report().resampling_error < 5e-3, "{:?}", table.report());
    assert!(table.report().reciprocity_residual < 2e-2, "{:?}", table.report());
    let brdf = Brdf { terms: vec![Term::Measured(Arc::new(table))] };
    for degrees in [0.0_f32, 30.0, 60.0, 75.0] {
        let albedo = brdf.directional_albedo(degrees.to_radians(), 64);
        let expected = glam::Vec3::new(0.8, 0.4, 0.2);
        assert!((albedo / expected - 1.0).abs().max_element() < 0.02, "{degrees}: {albedo}");
    }
}

#[test]
fn without_the_jacobian_flag_values_are_not_multiplied() {
    let mut fields = lambertian_fields();
    fields[6].data = vec![0];
    let (i, o) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 0.6, 0.8));
    let (whole, divided) = (parse(&fields).unwrap().eval(i, o), parse(&lambertian_fields()).unwrap().eval(i, o));
    assert!((whole / divided - 4.0).abs().max_element() < 1e-9);
}

#[test]
fn half_and_difference_angles_become_vectors_with_these_angles() {
    for angles in [[0.1, 0.2, 0.3], [0.7, 0.5, 1.2], [0.01, 1.2, 0.0], [0.4, 0.9, 1.5]] {
        let (i, o) = directions(angles).unwrap();
        let h = (i + o).normalize();
        let (n_dot_i, n_dot_o) = cosines(angles);
        assert!((i.length() - 1.0).abs() < 1e-12 && (i.z - n_dot_i).abs() < 1e-12 && (o.z - n_dot_o).abs() < 1e-12);
        assert!((h.z.acos() - angles[0]).abs() < 1e-9 && (i.dot(h).acos() - angles[1]).abs() < 1e-9);
    }
    assert!(directions([1.0, 1.2, 0.1]).is_none());
}

#[test]
fn anisotropic_files_are_refused_with_the_reason() {
    let mut anisotropic = lambertian_fields();
    anisotropic[0] = floats("phi_i", &[3], [-PI, 0.0, PI]);
    for at in [4, 5] {
        let once = anisotropic[at].data.clone();
        anisotropic[at].shape[0] = 3;
        anisotropic[at].data = once.repeat(3);
    }
    // Half vectors of an anisotropic file are not relative to i, so equal slices for all azimuths are not a Lambertian.
    let error = parse(&anisotropic).unwrap().check_isotropic().unwrap_err().to_string();
    assert!(error.contains("3 azimuths") && error.contains("isotropic"), "{error}");
}

#[test]
fn spectra_become_their_colour_in_daylight() {
    // A reflectance of 0.5 at every wavelength is grey.
    let mut fields = lambertian_fields();
    let planes: Vec<u8> = fields[5].data.chunks(4 * 1600).step_by(3).flat_map(|plane| plane.repeat(5)).collect();
    fields[5] = FieldBytes { name: "spectra", kind: 10, shape: vec![1, 14, 5, 40, 40], data: planes };
    fields.push(floats("wavelengths", &[5], [400.0, 480.0, 560.0, 640.0, 720.0]));
    let (i, o) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 0.6, 0.8));
    let (found, red) = (parse(&fields).unwrap().eval(i, o), parse(&lambertian_fields()).unwrap().eval(i, o).x);
    assert!((found / red - 1.0).abs().max_element() < 1e-6, "{found} {red}");
    fields[7].shape = vec![1];
    let error = parse(&fields).err().unwrap().to_string();
    assert!(error.contains("wavelengths"), "{error}");
}

#[test]
fn malformed_fields_are_refused_by_name() {
    type Damage = fn(&mut Vec<FieldBytes>);
    let cases: [(&str, Damage); 10] = [
        ("theta_i", |f| f[1].data[4..8].fill(0)),
        ("theta_i", |f| f[1].data[0..4].copy_from_slice(&f32::NAN.to_le_bytes())),
        ("ndf", |f| f[2].shape = vec![1, 4]),
        ("sigma", |f| f[3].shape = vec![4]),
        ("vndf", |f| f[4].data.fill(0)),
        ("vndf", |f| f[4].shape = vec![14, 1, 3, 3]),
        ("rgb", |f| f[5].data[100..104].copy_from_slice(&f32::INFINITY.to_le_bytes())),
        ("rgb", |f| f[5].shape = vec![1, 14, 2, 60, 40]),
        ("rgb", |f| f[5].shape = vec![u64::MAX, 14, 3, 40, 40]),
        ("rgb", |f| f[5].kind = 7),
    ];
    for (name, damage) in cases {
        let mut fields = lambertian_fields();
        damage(&mut fields);
        let error = parse(&fields).err().unwrap().to_string();
        assert!(error.contains(&format!("field \"{name}\"")), "{name}: {error}");
    }
    let mut fields = lambertian_fields();
    fields.remove(4);
    assert!(parse(&fields).err().unwrap().to_string().contains("a field named \"vndf\""));
}

#[test]
fn truncated_and_damaged_bytes_are_errors_not_panics() {
    let whole = file_of(&lambertian_fields());
    let contents = 18 + lambertian_fields().iter().map(|f| 13 + f.name.len() + 8 * f.shape.len()).sum::<usize>();
    for len in (0..contents).chain([whole.len() - 1]) {
        assert!(TensorFile::parse(whole[..len].to_vec()).is_err(), "{len}");
    }
    // Any changed byte of the table of contents gives an error or a BRDF, but no panic and no huge allocation.
    for at in 0..contents {
        for value in [0, 1, 0x7f, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] = value;
            if let Ok(Ok(brdf)) = TensorFile::parse(bytes).map(|file| RglTable::from_fields(&file)) {
                assert!(brdf.eval(DVec3::Z, DVec3::new(0.6, 0.0, 0.8)).is_finite());
            }
        }
    }
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("text.bsdf");
    std::fs::write(&path, "<xml>not a tensor file</xml>").unwrap();
    let error = load(&path).unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("text.bsdf: header"), "{error}");
}

#[test]
#[ignore = "needs measured data: BISCALE_DATA names a folder of RGL files"]
fn measured_files_reflect_less_than_they_receive_and_survive_resampling() {
    let Some(folder) = crate::testing::measured_data::folder("BISCALE_DATA") else { return };
    for name in ["chm_orange_rgb", "irid_flake_paint1_rgb", "vch_silk_blue_rgb"] {
        let path = folder.join(name).with_extension("bsdf");
        let start = std::time::Instant::now();
        let table = load(&path).unwrap();
        eprintln!("{name} in {:.0} ms: {:?}", start.elapsed().as_secs_f64() * 1e3, table.report());
        assert!(table.report().resampling_error < 0.015);
        assert!((0.1..1.0).contains(&table.report().max_albedo));
    }
}

#[test]
#[ignore = "needs measured data: BISCALE_DATA names a folder with vch_silk_blue_rgb.bsdf"]
fn the_silk_film_is_most_nearly_reciprocal_with_the_other_directions_cosine() {
    // The format stores f_r cosθ_o. Read as f_r or as f_r cosθ_i, the smooth file is less reciprocal.
    let Some(folder) = crate::testing::measured_data::folder("BISCALE_DATA") else { return };
    let path = folder.join("vch_silk_blue_rgb.bsdf");
    let brdf = RglTable::from_fields(&TensorFile::read(&path).unwrap()).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut random = || {
        let (z, phi) = (rng.random_range(0.2..1.0_f64), rng.random_range(0.0..2.0 * PI));
        let s = (1.0 - z * z).sqrt();
        DVec3::new(s * phi.cos(), s * phi.sin(), z)
    };
    let mut residuals: [Residual; 3] = Default::default();
    for _ in 0..20_000 {
        let (i, o) = (random(), random());
        let (there, back) = (brdf.eval(i, o), brdf.eval(o, i));
        for (residual, (weight_i, weight_o)) in residuals.iter_mut().zip([(i.z, o.z), (1.0, 1.0), (o.z, i.z)]) {
            residual.add(there * weight_i - back * weight_o, there * weight_i, 1.0);
        }
    }
    let [with_cosine, plain, other] = residuals.map(|residual| residual.relative());
    eprintln!("reciprocity of vch_silk_blue: f_r cosθ_o {with_cosine:.3}, f_r {plain:.3}, f_r cosθ_i {other:.3}");
    assert!(with_cosine < 0.15 && with_cosine < plain && plain < other);
}
