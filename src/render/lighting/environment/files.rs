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
#[path = "files_tests.rs"]
mod tests;
