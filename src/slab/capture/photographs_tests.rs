use super::*;
use crate::slab::capture::rig::RigCamera;

fn rig(extra: &str, camera: &str) -> Rig {
    Rig::parse(&format!(
        "eta = 1.5\nsample_size = [0.08, 0.08]\ndistance = 0.04\n{extra}dots = {{ positions = [[0, 0], [0.01, 0]] }}\n\
         [[camera]]\ndirection = [0, 0, -1]\n{camera}"
    ))
    .unwrap()
}

fn exr(folder: &Path, name: &str, size: (usize, usize), value: impl Fn(usize, usize) -> f32 + Sync) {
    exr::prelude::write_rgb_file(folder.join(name), size.0, size.1, |x, y| {
        let value = value(x, y);
        (value, value, value)
    })
    .unwrap();
}

fn gathered(rig: &Rig, folder: &Path) -> Vec<f32> {
    let photographs = Photographs::open(rig, folder).unwrap();
    let pixels: Vec<usize> = (0..photographs.size.element_product() as usize).collect();
    photographs.gather(0, &pixels, &Cancel::default()).unwrap().into_iter().map(|value| value.x).collect()
}

#[test]
fn exposures_are_merged_less_the_dark_frame_and_saturated_values_drop_out() {
    let folder = tempfile::tempdir().unwrap();
    let radiance = |dot: usize, x: usize| (1 + dot + 4 * x) as f32 * 0.1;
    for dot in 0..2 {
        for (exposure, time) in [0.5_f32, 2.0].into_iter().enumerate() {
            let value = move |x: usize, _| (radiance(dot, x) * time + 0.01 * time).min(1.0);
            exr(folder.path(), &format!("d{dot}_{exposure}.exr"), (3, 1), value);
        }
    }
    exr(folder.path(), "dark.exr", (3, 1), |_, _| 0.005);
    let rig = rig("saturation = 0.99\n", "images = \"d%d_%d.exr\"\nexposures = [0.5, 2]\ndark = \"dark.exr\"\n");
    let found = gathered(&rig, folder.path());
    let expected = [radiance(0, 0), radiance(1, 0), radiance(0, 1), radiance(1, 1), radiance(0, 2), radiance(1, 2)];
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} {expected:?}");
}

#[test]
fn corners_rectify_a_tilted_square_and_its_linear_pattern_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    for dot in 0..2 {
        exr(folder.path(), &format!("d{dot}.exr"), (40, 40), |x, y| x as f32 + 100.0 * y as f32);
    }
    let rig = rig("pixels = [4, 4]\n", "images = \"d%d.exr\"\ncorners = [[8, 8], [24, 8], [24, 24], [8, 24]]\n");
    let found = gathered(&rig, folder.path());
    for pixel in 0..16 {
        let (x, y) = (10.0 + 4.0 * (pixel % 4) as f32 - 0.5, 10.0 + 4.0 * (pixel / 4) as f32 - 0.5);
        assert!((found[2 * pixel] - (x + 100.0 * y)).abs() < 1e-3, "{pixel}");
    }
    let outside = Rig {
        cameras: vec![RigCamera {
            corners: Some([[0.0, 0.0], [90.0, 0.0], [90.0, 9.0], [0.0, 9.0]]),
            ..rig.cameras[0].clone()
        }],
        ..rig
    };
    assert!(gathered(&outside, folder.path())[6].is_nan());
}

#[test]
fn the_corners_of_any_quadrilateral_map_to_themselves_and_a_line_is_refused() {
    let corners = [[3.0, 1.0], [20.0, 4.0], [25.0, 30.0], [1.0, 22.0]];
    let map = rectification(&corners, 0).unwrap();
    for ([x, y], corner) in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].into_iter().zip(corners) {
        let mapped = map * DVec3::new(x, y, 1.0);
        assert!((mapped.truncate() / mapped.z - DVec2::from_array(corner)).length() < 1e-9);
    }
    assert_eq!(natural_size(&[[0.0, 0.0], [8.0, 0.0], [8.0, 5.0], [0.0, 5.0]]), UVec2::new(8, 5));
    for wrong in [[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]], [[1.0; 2]; 4]] {
        assert_eq!(rectification(&wrong, 0).unwrap_err().exit_code(), 2);
    }
}

#[test]
fn missing_images_other_sizes_and_images_of_8_bits_are_errors_that_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    exr(folder.path(), "d0.exr", (3, 2), |_, _| 1.0);
    let described = rig("", "images = \"d%d.exr\"\n");
    let refused = |rig: &Rig| {
        let opened = Photographs::open(rig, folder.path());
        let error = opened.and_then(|all| all.gather(0, &[0], &Cancel::default())).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        error.to_string()
    };
    assert!(refused(&described).contains("1 of 2 images, without `d1.exr`"));
    exr(folder.path(), "d1.exr", (3, 3), |_, _| 1.0);
    let error = refused(&described);
    assert!(error.contains("d1.exr") && error.contains("3 x 3") && error.contains("3 x 2"), "{error}");
    std::fs::write(folder.path().join("d1.exr"), b"v/1\x01").unwrap();
    assert!(refused(&described).contains("d1.exr"));
    image::GrayImage::new(3, 2).save(folder.path().join("p0.png")).unwrap();
    image::GrayImage::new(3, 2).save(folder.path().join("p1.png")).unwrap();
    let error = refused(&rig("", "images = \"p%d.png\"\n"));
    assert!(error.contains("8 bits") && error.contains("16 bits"), "{error}");
}
