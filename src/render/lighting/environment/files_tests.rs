use super::*;

fn write_exr(path: &Path, texels: &[Vec3], width: usize) {
    let pixel = |x: usize, y: usize| texels[y * width + x].into();
    exr::prelude::write_rgb_file(path, width, texels.len() / width, |x, y| -> (f32, f32, f32) { pixel(x, y) }).unwrap();
}

#[test]
fn an_exr_comes_back_and_bad_texels_count_as_black_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.exr");
    let bad = [Vec3::new(f32::NAN, 1.0, 2.0), Vec3::new(1.0, -3.0, f32::INFINITY)];
    write_exr(&path, &[bad[0], bad[1], Vec3::ONE, Vec3::new(4.0, 5.0, 6.0)], 2);
    let environment = load_exr(&path).unwrap();
    assert_eq!(environment.map.texels, [Vec3::new(0.0, 1.0, 2.0), Vec3::X, Vec3::ONE, Vec3::new(4.0, 5.0, 6.0)]);
    assert!(environment.warnings[0].starts_with("2 of the environment's 4 texels"), "{:?}", environment.warnings);
}

#[test]
fn an_hdr_comes_back_and_a_truncated_one_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.hdr");
    let pixels: Vec<_> = (0..64 * 32).map(|k| image::Rgb([k as f32, 1.0, 0.25])).collect();
    let mut bytes = Vec::new();
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, 64, 32).unwrap();
    std::fs::write(&path, &bytes).unwrap();
    let map = load_hdr(&path).unwrap().map;
    assert_eq!((map.width, map.height), (64, 32));
    assert!((map.texels[1000].x / 1000.0 - 1.0).abs() < 0.01);
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let error = load_hdr(&path).unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("sky.hdr"), "{error}");
}

#[test]
fn files_that_are_missing_or_not_what_they_say_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.hdr", "a.exr"] {
        let path = folder.path().join(name);
        assert_eq!(crate::render::lighting::environment::load(name, folder.path()).unwrap_err().exit_code(), 2);
        std::fs::write(&path, b"not an image at all").unwrap();
        assert_eq!(crate::render::lighting::environment::load(name, folder.path()).unwrap_err().exit_code(), 2);
        std::fs::write(&path, b"").unwrap();
        assert_eq!(crate::render::lighting::environment::load(name, folder.path()).unwrap_err().exit_code(), 2);
    }
    let hostile = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2000000000 +X 2000000000\n";
    std::fs::write(folder.path().join("huge.hdr"), hostile).unwrap();
    assert_eq!(crate::render::lighting::environment::load("huge.hdr", folder.path()).unwrap_err().exit_code(), 2);
}

#[test]
fn reducing_keeps_the_total() {
    let map = LatLongMap::from_fn(2048, 64, |d| DVec3::new(d.y + 1.0, d.x + 1.0, 1.0));
    let total = map.total();
    let small = reduced(map);
    assert_eq!((small.width, small.height), (1024, 32));
    assert!((small.total() - total).length() < 1e-5);
    let odd = LatLongMap::from_fn(2053, 67, |d| DVec3::new(d.y + 1.0, d.x + 1.0, 1.0));
    let (total, small) = (odd.total(), reduced(odd));
    assert_eq!((small.width, small.height), (685, 23));
    assert!((small.total() - total).length() < 1e-5);
}
