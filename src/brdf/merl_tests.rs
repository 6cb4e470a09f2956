use std::f32::consts::TAU;
use std::f64::consts::{FRAC_PI_2, PI};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::half_difference::cosines;
use super::super::{LobeAngles, Measured, Term};
use super::*;
use crate::math::directions::{from_angles, half_vector};

/// A full-size file whose entries are `f(θ_h, θ_d, φ_d)` per channel, as the format stores them.
fn file_of(f: impl Fn(f64, f64, f64) -> [f64; 3]) -> Vec<u8> {
    let mut bytes: Vec<u8> = [90_i32, 90, 180].iter().flat_map(|n| n.to_le_bytes()).collect();
    bytes.resize(FILE_BYTES, 0);
    for h in 0..90 {
        for d in 0..90 {
            for p in 0..180 {
                let theta_h = ((h as f64 + 0.5) / 90.0).powi(2) * FRAC_PI_2;
                let value = f(theta_h, (d as f64 + 0.5) / 90.0 * FRAC_PI_2, (p as f64 + 0.5) / 180.0 * PI);
                for c in 0..3 {
                    let at = 12 + 8 * (c * PLANE + p + 180 * (d + 90 * h));
                    bytes[at..at + 8].copy_from_slice(&(value[c] / SCALES[c]).to_le_bytes());
                }
            }
        }
    }
    bytes
}

fn ggx_f_r(theta_h: f64, theta_d: f64, phi_d: f64) -> f64 {
    let (n_dot_i, n_dot_o) = cosines([theta_h, theta_d, phi_d]);
    let angles = LobeAngles {
        n_dot_i: n_dot_i as f32,
        n_dot_o: n_dot_o as f32,
        n_dot_h: theta_h.cos() as f32,
        sin2_theta_h: theta_h.sin().powi(2) as f32,
        i_dot_h: theta_d.cos() as f32,
    };
    if !angles.above() {
        return -1.0;
    }
    f64::from(Term::Ggx { roughness: 0.3, f0: Vec3::ONE }.f_r(&angles).x)
}

#[test]
fn a_tabulated_ggx_is_read_back_within_interpolation_error() {
    let bytes = file_of(|h, d, p| {
        let f = ggx_f_r(h, d, p);
        [f, 0.5 * f, 0.25 * f]
    });
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("ggx.binary");
    std::fs::write(&path, &bytes).unwrap();
    let table = load(&path).unwrap();
    assert_eq!(table.name(), "ggx");
    assert!(table.report().reciprocity_residual < 1e-6);
    assert!(table.report().invalid_samples > 0 && table.report().total == 1_458_000);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (mut error, mut power) = (0.0, 0.0);
    for k in 0..50_000 {
        let i = from_angles(rng.random_range(0.0..1.48), rng.random_range(0.0..TAU));
        let near = if k % 2 == 0 { 0.3 } else { 3.0 };
        let mirrored =
            Vec3::new(-i.x, -i.y, i.z) + near * Vec3::new(rng.random(), rng.random(), rng.random()) - near / 2.0;
        let o = mirrored.normalize_or(Vec3::Z);
        let angles = LobeAngles::new(Vec3::Z, i, o, half_vector(i, o));
        if o.z < 0.087 {
            continue;
        }
        let expected = Term::Ggx { roughness: 0.3, f0: Vec3::ONE }.f_cos(&angles) * Vec3::new(1.0, 0.5, 0.25);
        let found = table.f_r(&angles) * i.z * o.z;
        error += f64::from((found - expected).length_squared());
        power += f64::from(expected.length_squared());
    }
    let relative = (error / power).sqrt();
    eprintln!("MERL grid, GGX 0.3: relative L2 {relative:.2e}");
    assert!(relative < 2e-3, "{relative}");
}

#[test]
fn reciprocity_is_restored_and_its_lack_reported() {
    // For 1 + ε cosφ_d, the swap of light and view negates the cosine. The RMS over φ_d of 2 ε cosφ_d is √2 ε.
    let table = table_from_planes("skew".to_owned(), &file_of(|_, _, p| [1.0 + 0.1 * p.cos(); 3])[12..]);
    let residual = f64::from(table.report().reciprocity_residual);
    // The residual is a little smaller: near the horizon the weights are smaller at φ_d = 0, where the difference is
    // largest.
    assert!((0.12..0.1415).contains(&residual), "{residual}");
    let angles = LobeAngles::new(Vec3::Z, from_angles(0.3, 0.0), from_angles(0.7, 2.0), Vec3::Z);
    let angles = LobeAngles { i_dot_h: 0.9, n_dot_h: 0.9, sin2_theta_h: 0.19, ..angles };
    assert!((table.f_r(&angles) - Vec3::ONE).abs().max_element() < 1e-6);
}

#[test]
fn invalid_samples_are_left_out_one_channel_or_all() {
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 1e300];
    let bytes = file_of(|h, d, p| {
        let k = (h * 1e6 + d * 1e3 + p * 10.0) as usize;
        if k.is_multiple_of(7) { [2.0, bad[k % 5], 2.0] } else { [2.0, 4.0, 8.0] }
    });
    let table = table_from_planes("holes".to_owned(), &bytes[12..]);
    assert!(table.report().invalid_samples > 100_000);
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..10_000 {
        let (i, o) = (
            from_angles(rng.random_range(0.0..1.5), 0.0),
            from_angles(rng.random_range(0.0..1.5), rng.random_range(0.0..TAU)),
        );
        let found = table.f_r(&LobeAngles::new(Vec3::Z, i, o, half_vector(i, o)));
        let whole = (found - Vec3::new(2.0, 4.0, 8.0)).abs().max_element() < 1e-4;
        assert!(whole || found == Vec3::ZERO, "{found}");
    }
}

#[test]
fn wrong_files_are_refused_with_what_was_found_and_expected() {
    let directory = tempfile::tempdir().unwrap();
    let mut whole = vec![0_u8; FILE_BYTES];
    whole[..12].copy_from_slice(&[90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0]);
    let longer = [&whole[..], &[0]].concat();
    let cases: [(&str, &[u8], &str); 5] = [
        ("empty", &[], "found 0 bytes, expected 34992012 bytes"),
        ("short", &whole[..FILE_BYTES - 1], "found 34992011 bytes, expected 34992012 bytes"),
        ("long", &longer, "found 34992013 bytes"),
        ("text", b"hello, this is text", "expected [90, 90, 180]"),
        ("hostile", &[0xff; 64], "found dimensions [-1, -1, -1]"),
    ];
    for (name, bytes, message) in cases {
        let path = directory.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let error = load(&path).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(message) && error.to_string().contains(name), "{error}");
    }
    assert!(load(&directory.path().join("absent")).unwrap_err().to_string().contains("absent"));
    assert!(load(directory.path()).is_err());
}

#[test]
#[ignore = "needs measured data: BISCALE_MERL names a folder of MERL files"]
fn the_paints_of_table_3_load_and_reflect_less_than_they_receive() {
    let Some(folder) = crate::testing::measured_data::folder("BISCALE_MERL") else { return };
    let entries = std::fs::read_dir(&folder).unwrap().flatten().map(|entry| entry.path());
    let paths: Vec<_> = entries.filter(|path| path.extension().is_some_and(|ending| ending == "binary")).collect();
    assert!(!paths.is_empty(), "{} holds no MERL files", folder.display());
    for path in paths {
        let start = std::time::Instant::now();
        let table = load(&path).unwrap();
        eprintln!("{} in {:.0} ms: {:?}", table.name(), start.elapsed().as_secs_f64() * 1e3, table.report());
        assert!(table.report().invalid_samples > 0 && table.report().reciprocity_residual < 0.5);
    }
}
