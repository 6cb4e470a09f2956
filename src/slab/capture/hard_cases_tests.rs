//! Captures of photographs that show nothing, too much, or no light of the lobe: the result is finite and not negative.

use std::path::Path;

use glam::{DVec2, DVec3};

use super::lobe::LobeOptics;
use super::radiance::DotLight;
use super::rig::Rig;
use super::sheet::{CaptureSettings, Captured, capture};
use super::svbtdf::Svbtdf;
use crate::base::Cancel;

/// Places of dots, pixels and the radiance of each.
pub(crate) struct Case<'a> {
    pub dots: &'a str,
    pub pixels: [usize; 2],
    pub radiance: &'a (dyn Fn(usize, usize, f64) -> f32 + Sync),
}

pub(crate) const GRID: &str = "count = [12, 12], from = [-0.09, -0.05], to = [0.01, 0.05]";

/// Writes the images of a case. The last argument of its radiance is the one of a Beckmann sheet with a diffuse part.
fn photographed(folder: &Path, case: &Case<'_>) -> Rig {
    let text = format!(
        "eta = 1.5\nsample_size = [0.02, 0.02]\ndistance = 0.04\ndots = {{ {} }}\n[[camera]]\ndirection = [1, 0, -1]\nimages = \
         \"d%d.exr\"\n",
        case.dots
    );
    let rig = Rig::parse(&text).unwrap();
    let o = rig.cameras[0].unit_direction();
    let optics = LobeOptics::new(1.5, 0.2);
    let size = glam::UVec2::new(case.pixels[0] as u32, case.pixels[1] as u32);
    for (number, dot) in rig.dots().into_iter().enumerate() {
        let value = |x: usize, y: usize| {
            let pixel = y * case.pixels[0] + x;
            let light = DotLight::new(dot, 0.04, rig.place(pixel, size));
            let lobe = optics
                .terms(light.i, o)
                .map_or(0.0, |terms| terms.ln_top.exp() * (-terms.slope_top.length_squared() / 0.04).exp() * 8.0);
            let value = (case.radiance)(number, pixel, light.irradiance * (lobe + 0.02));
            (value, value, 0.5 * value)
        };
        exr::prelude::write_rgb_file(folder.join(format!("d{number}.exr")), case.pixels[0], case.pixels[1], value)
            .unwrap();
    }
    rig
}

/// Writes the images of a case and the `rig.toml` of a model without inner reflections.
pub(crate) fn write_folder(folder: &Path, case: &Case<'_>) {
    let rig = Rig { bounces: false, ..photographed(folder, case) };
    std::fs::write(folder.join(super::rig::FILE), rig.to_toml().unwrap()).unwrap();
}

fn captured(case: &Case<'_>, settings: &CaptureSettings) -> Captured {
    let folder = tempfile::tempdir().unwrap();
    let rig = photographed(folder.path(), case);
    let captured = capture(&rig, folder.path(), settings, &Cancel::default(), &|_| true).unwrap();
    let path = folder.path().join("a.npz");
    captured.svbtdf.write(&path).unwrap();
    let read = Svbtdf::read(&path).unwrap();
    check(&captured.svbtdf);
    check(&read);
    assert!(captured.residual.iter().all(|value| value.is_finite()));
    captured
}

/// Checks pairs of directions up to the horizon at every pixel, and the mean.
fn check(sheet: &Svbtdf) {
    let mean = sheet.mean();
    for degrees in [0.0, 30.0, 45.0, 80.0, 89.99, 90.0_f64] {
        for turn in 0..6 {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let i = (sin * DVec2::from_angle(f64::from(turn))).extend(cos.max(0.0));
            for o in [-i, DVec3::NEG_Z, DVec3::new(0.6, 0.0, -0.8), DVec3::new(1.0, 0.0, -0.0)] {
                let all = (0..sheet.scale.len()).map(|pixel| sheet.btdf(pixel, i, o)).chain([mean.btdf(i, o)]);
                for value in all {
                    assert!(value.is_finite() && value.min_element() >= 0.0, "{degrees} {turn} {o}: {value}");
                }
            }
        }
    }
}

fn lobes(captured: &Captured) -> f32 {
    captured.svbtdf.scale.iter().map(|scale| scale.x).fold(0.0, f32::max)
}

#[test]
fn black_photographs_and_a_sheet_that_only_scatters_have_no_lobe() {
    let black = captured(&Case { dots: GRID, pixels: [3, 2], radiance: &|_, _, _| 0.0 }, &CaptureSettings::default());
    assert_eq!((lobes(&black), black.figures.dark), (0.0, 1.0));
    let dots = Rig::parse(&format!("eta = 1.5\nsample_size = [1, 1]\ndistance = 0.04\ndots = {{ {GRID} }}\n[[camera]]\ndirection = [0, 0, -1]\nimages = \"%d\"\n")).unwrap().dots();
    let size = glam::UVec2::new(3, 2);
    let place = |pixel: usize| {
        let at = DVec2::new((pixel % 3) as f64, (pixel / 3) as f64) + 0.5;
        (at / size.as_dvec2() - 0.5) * 0.02
    };
    let even =
        |dot: usize, pixel: usize, _: f64| (0.1 * DotLight::new(dots[dot], 0.04, place(pixel)).irradiance) as f32;
    let diffuse = captured(&Case { dots: GRID, pixels: [3, 2], radiance: &even }, &CaptureSettings::default());
    assert!(lobes(&diffuse) < 1e-3, "{}", lobes(&diffuse));
    assert!(diffuse.svbtdf.diffuse.iter().all(|value| (value.x - 0.1).abs() < 1e-3), "{:?}", diffuse.svbtdf.diffuse);
}

#[test]
fn one_lit_dot_one_pixel_and_four_dots_give_finite_lobes() {
    let lit = |dot: usize, _: usize, value: f64| if dot == 66 { value as f32 } else { 0.0 };
    captured(&Case { dots: GRID, pixels: [2, 2], radiance: &lit }, &CaptureSettings::default());
    let plain = |_: usize, _: usize, value: f64| value as f32;
    let one = captured(&Case { dots: GRID, pixels: [1, 1], radiance: &plain }, &CaptureSettings::default());
    assert_eq!(one.figures.representatives, 1);
    let few = "count = [2, 2], from = [-0.05, -0.01], to = [-0.03, 0.01]";
    captured(&Case { dots: few, pixels: [2, 1], radiance: &plain }, &CaptureSettings::default());
    let single = "positions = [[-0.04, 0.0]]";
    captured(&Case { dots: single, pixels: [2, 1], radiance: &plain }, &CaptureSettings::default());
}

#[test]
fn saturated_negative_and_broken_values_take_no_part() {
    let radiance = |dot: usize, pixel: usize, value: f64| match (dot + pixel) % 7 {
        0 => f32::NAN,
        1 => -1.0,
        2 => f32::INFINITY,
        _ => value as f32,
    };
    for every_pixel in [false, true] {
        let settings = CaptureSettings { every_pixel, ..CaptureSettings::default() };
        let found = captured(&Case { dots: GRID, pixels: [3, 3], radiance: &radiance }, &settings);
        assert!((0.2..0.4).contains(&found.figures.broken), "{}", found.figures.broken);
    }
    let all =
        captured(&Case { dots: GRID, pixels: [2, 2], radiance: &|_, _, _| f32::NAN }, &CaptureSettings::default());
    assert_eq!((lobes(&all), all.figures.broken), (0.0, 1.0));
}

#[test]
fn dots_that_miss_the_lobe_give_a_finite_sheet() {
    let far = "count = [8, 8], from = [0.2, 0.2], to = [0.3, 0.3]";
    captured(&Case { dots: far, pixels: [2, 2], radiance: &|_, _, value| value as f32 }, &CaptureSettings::default());
}

#[test]
fn the_same_photographs_and_seed_give_the_same_file_in_bands_of_any_height() {
    let folder = tempfile::tempdir().unwrap();
    let plain = |_: usize, pixel: usize, value: f64| (value * (1.0 + 0.1 * pixel as f64)) as f32;
    let rig = photographed(folder.path(), &Case { dots: GRID, pixels: [5, 4], radiance: &plain });
    let bytes = |memory: usize| {
        let settings = CaptureSettings { memory, ..CaptureSettings::default() };
        let found = capture(&rig, folder.path(), &settings, &Cancel::default(), &|_| true).unwrap();
        let path = folder.path().join("a.npz");
        found.svbtdf.write(&path).unwrap();
        assert!(found.residual.iter().all(|value| *value < 0.05), "{:?}", found.residual);
        std::fs::read(path).unwrap()
    };
    assert_eq!(bytes(1 << 30), bytes(1));
    let refused = capture(&rig, folder.path(), &CaptureSettings::default(), &Cancel::default(), &|_| false);
    assert!(matches!(refused, Err(crate::base::Error::Cancelled)));
}
