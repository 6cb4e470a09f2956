//! Environments from files: Radiance `.hdr` and OpenEXR `.exr`, cleaned and reduced to the resolution that lights need.

use std::fmt::Display;
use std::io::BufReader;
use std::path::Path;

use exr::prelude as exr_file;
use exr_file::{ReadChannels, ReadLayers};
use glam::{DVec3, Vec3};
use image::ImageDecoder;

use super::{Environment, LatLongMap};
use crate::base::{Error, InputError, Result, regular_file};

/// Bounds the texels of a file (0.8 GB); a larger file is refused before memory is allocated.
const MAX_TEXELS: u64 = 1 << 26;
/// Bounds the width and height of a loaded map, in texels. Larger maps are averaged down.
const MAX_WIDTH: usize = 1024;
/// Bounds the radiance of a texel, so that sums over a map or an image stay far inside the range of f32. The sun's disc
/// has 2·10⁹ W/(sr m²).
const MAX_RADIANCE: f32 = 1e18;

fn file_error(path: &Path, found: impl Display, expected: &str) -> Error {
    InputError::new("light.environment", found, expected).in_file(path).into()
}

fn check_size(path: &Path, width: u64, height: u64) -> Result<()> {
    if width == 0 || height == 0 || width.saturating_mul(height) > MAX_TEXELS {
        return Err(file_error(path, format!("{width} x {height} texels"), &format!("1 to {MAX_TEXELS} texels")));
    }
    Ok(())
}

pub(super) fn load_hdr(path: &Path) -> Result<Environment> {
    let expected = "a complete Radiance .hdr file";
    let file = regular_file::open(path).map_err(|error| file_error(path, error, "a readable .hdr file"))?;
    let decoder =
        image::codecs::hdr::HdrDecoder::new(BufReader::new(file)).map_err(|error| file_error(path, error, expected))?;
    let (width, height) = decoder.dimensions();
    check_size(path, width.into(), height.into())?;
    let image =
        image::DynamicImage::from_decoder(decoder).map_err(|error| file_error(path, error, expected))?.into_rgb32f();
    let texels = image.into_raw().chunks_exact(3).map(Vec3::from_slice).collect();
    Ok(cleaned(LatLongMap { width: width as usize, height: height as usize, texels }))
}

pub(super) fn load_exr(path: &Path) -> Result<Environment> {
    let expected = "a complete OpenEXR file with R, G and B channels";
    let open = || regular_file::open(path).map_err(|error| file_error(path, error, "a readable .exr file"));
    let meta =
        exr::meta::MetaData::read_from_unbuffered(open()?, false).map_err(|error| file_error(path, error, expected))?;
    for header in &meta.headers {
        check_size(path, header.layer_size.x() as u64, header.layer_size.y() as u64)?;
    }
    let image = exr_file::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| LatLongMap { width: size.x(), height: size.y(), texels: vec![Vec3::ZERO; size.x() * size.y()] },
            |map: &mut LatLongMap, at, (r, g, b, _): (f32, f32, f32, f32)| {
                map.texels[at.y() * map.width + at.x()] = Vec3::new(r, g, b)
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_unbuffered(open()?)
        .map_err(|error| file_error(path, error, expected))?;
    Ok(cleaned(image.layer_data.channel_data.pixels))
}

/// Sets channels that are negative, not finite or too large to zero, with a warning, and reduces the map.
fn cleaned(mut map: LatLongMap) -> Environment {
    let mut bad = 0usize;
    for texel in &mut map.texels {
        // NaN is outside every range.
        let clean = texel.map(|value| if (0.0..=MAX_RADIANCE).contains(&value) { value } else { 0.0 });
        // NaN is unequal to itself, so this counts NaN, too.
        bad += usize::from(clean != *texel);
        *texel = clean;
    }
    let mut warnings = Vec::new();
    if bad > 0 {
        let all = map.texels.len();
        warnings.push(format!(
            "{bad} of the environment's {all} texels are negative, NaN, or above {MAX_RADIANCE:e} and count as black there"
        ));
    }
    Environment { map: reduced(map), warnings }
}

/// Averages blocks of texels, weighted by solid angle, so that the total is conserved.
fn reduced(map: LatLongMap) -> LatLongMap {
    // If the blocks do not divide a side evenly, their sizes differ by one texel; each block conserves its energy.
    let block = map.width.div_ceil(MAX_WIDTH).max(map.height.div_ceil(MAX_WIDTH));
    if block <= 1 {
        return map;
    }
    let [width, height] = [map.width, map.height].map(|side| side.div_ceil(block));
    let mut small = LatLongMap { width, height, texels: Vec::with_capacity(width * height) };
    for row in 0..height {
        let fine_rows = row * map.height / height..(row + 1) * map.height / height;
        for column in 0..width {
            let fine_columns = column * map.width / width..(column + 1) * map.width / width;
            let mut sum = DVec3::ZERO;
            for fine_row in fine_rows.clone() {
                let texels = &map.texels[fine_row * map.width..][fine_columns.clone()];
                let part: DVec3 = texels.iter().map(|t| t.as_dvec3()).sum();
                sum += part * map.solid_angle(fine_row);
            }
            small.texels.push((sum / small.solid_angle(row)).as_vec3());
        }
    }
    small
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write_exr(path: &Path, texels: &[Vec3], width: usize) {
        let pixel = |x: usize, y: usize| texels[y * width + x].into();
        exr::prelude::write_rgb_file(path, width, texels.len() / width, |x, y| -> (f32, f32, f32) { pixel(x, y) })
            .unwrap();
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
}
