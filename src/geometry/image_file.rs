//! Images of a scene: heights (linear values), colour weights (sRGB in integer formats, linear in float formats) and
//! slots.

use std::io::Cursor;
use std::path::Path;

use exr::prelude as exr_file;
use exr_file::{ReadChannels, ReadLayers};
use glam::{UVec2, Vec3};
use image::{DynamicImage, ImageReader, Limits};
use tiff::decoder::DecodingResult;
use tiff::tags::{SampleFormat, Tag};

use crate::base::{InputError, Result};
pub use crate::scene::Pixels;
use crate::scene::{MAX_COLOR, files};

/// Maximum size of a file, in bytes.
const MAX_FILE: u64 = 256 << 20;
/// Maximum number of pixels along a side.
const MAX_SIDE: u32 = 4096;
/// Maximum number of pixels in total.
const MAX_PIXELS: u64 = 1 << 22;

/// Reads heights: the value of a grey image (0 to 1 for integer formats), the luminance of a coloured one.
///
/// # Errors
/// Returns an error if the file is missing, is not an image, is too large, or contains NaN or infinite values.
pub fn read_heights(base_dir: &Path, path: &Path) -> Result<Pixels<f32>> {
    let pixels = read(base_dir, path)?;
    Ok(Pixels { size: pixels.size, values: pixels.values.iter().map(|value| luminance(*value)).collect() })
}

/// Reads linear colour weights.
///
/// # Errors
/// Returns an error as [`read_heights`] does, and for values that the scene key `color` refuses.
pub fn read_colors(base_dir: &Path, path: &Path) -> Result<Pixels<Vec3>> {
    let mut pixels = read(base_dir, path)?;
    if pixels.is_integer {
        pixels.values.iter_mut().for_each(|value| *value = Vec3::from_array(value.to_array().map(linear_from_srgb)));
    }
    let most = MAX_COLOR as f32;
    if let Some(at) = pixels.values.iter().position(|v| v.min_element() < 0.0 || v.max_element() > most) {
        // This form writes large numbers with an exponent.
        let (place, found) = (pixel_name(at, pixels.size), format!("{:?}", pixels.values[at].to_array()));
        let error = InputError::new(place, found, format!("linear colours from 0 to {MAX_COLOR}"));
        return Err(error.in_file(files::resolve(base_dir, path)).into());
    }
    Ok(Pixels { size: pixels.size, values: pixels.values })
}

/// Reads linear values of an EXR, HDR or 16-bit PNG file; 65535 is 1. Values may be NaN, infinite or negative, as
/// photographs have them. The second value is true for integers.
///
/// # Errors
/// Returns an error if the file is missing, is not such an image, or is too large.
pub fn read_linear(base_dir: &Path, path: &Path) -> Result<(Pixels<Vec3>, bool)> {
    let RawImage { size, values, is_integer, bits } = read_any(base_dir, path)?;
    if bits < 16 {
        let expected = "linear values: an .exr, an .hdr or a .png of 16 bits";
        return Err(InputError::new("", format!("an image of {bits} bits"), expected)
            .in_file(files::resolve(base_dir, path))
            .into());
    }
    Ok((Pixels { size, values }, is_integer))
}

/// Maximum number of slots that an image may paint.
pub const MAX_SLOTS: u8 = 16;

/// Reads painted slots. The grey value is the slot's number: the 8-bit value in integer formats.
///
/// # Errors
/// Returns an error as [`read_heights`] does, and for values above [`MAX_SLOTS`].
pub fn read_slots(base_dir: &Path, path: &Path) -> Result<Pixels<u8>> {
    let pixels = read(base_dir, path)?;
    let scale = if pixels.is_integer { 255.0 } else { 1.0 };
    let number = |value: &Vec3| (luminance(*value) * scale).round();
    if let Some(at) = pixels.values.iter().position(|value| !(0.0..=f32::from(MAX_SLOTS)).contains(&number(value))) {
        let expected = format!("the number of a slot, 0 to {MAX_SLOTS} (a grey of 8 bits)");
        let found = number(&pixels.values[at]);
        let error = InputError::new(pixel_name(at, pixels.size), found, expected);
        return Err(error.in_file(files::resolve(base_dir, path)).into());
    }
    Ok(Pixels { size: pixels.size, values: pixels.values.iter().map(|value| number(value) as u8).collect() })
}

/// Rec. 709 luminance, exact for greys.
fn luminance(color: Vec3) -> f32 {
    if color.x == color.y && color.y == color.z { color.x } else { color.dot(Vec3::new(0.2126, 0.7152, 0.0722)) }
}

/// Converts an sRGB value to a linear one (IEC 61966-2-1).
fn linear_from_srgb(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

fn pixel_name(index: usize, size: UVec2) -> String {
    format!("pixel ({}, {})", index % size.x as usize, index / size.x as usize)
}

struct RawImage {
    size: UVec2,
    values: Vec<Vec3>,
    is_integer: bool,
    /// Bits per channel.
    bits: u8,
}

/// Reads an image of finite values.
fn read(base_dir: &Path, path: &Path) -> Result<RawImage> {
    let image = read_any(base_dir, path)?;
    if let Some(at) = image.values.iter().position(|value| !value.is_finite()) {
        return Err(InputError::new(pixel_name(at, image.size), image.values[at], "finite values")
            .in_file(files::resolve(base_dir, path))
            .into());
    }
    Ok(image)
}

fn read_any(base_dir: &Path, path: &Path) -> Result<RawImage> {
    let bytes = files::read(base_dir, path, MAX_FILE)?;
    let path = &files::resolve(base_dir, path);
    let error_for = |found: String| InputError::new("", found, "an image: PNG, JPEG, TIFF, HDR or EXR").in_file(path);
    let is_exr = bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]);
    let image = match read_float_tiff(&bytes, path)? {
        Some(image) => image,
        None if is_exr => read_exr(&bytes, path)?,
        None => decode(&bytes).map_err(|error| error_for(error.to_string()))?,
    };
    check_size(image.size, path)?;
    Ok(image)
}

fn check_size(size: UVec2, path: &Path) -> Result<()> {
    let pixels = u64::from(size.x) * u64::from(size.y);
    if pixels == 0 || pixels > MAX_PIXELS || size.max_element() > MAX_SIDE {
        let expected = format!("at most {MAX_PIXELS} pixels and {MAX_SIDE} on a side, at least one");
        return Err(InputError::new("", format!("{} x {} pixels", size.x, size.y), expected).in_file(path).into());
    }
    Ok(())
}

fn decode(bytes: &[u8]) -> image::ImageResult<RawImage> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(4 * MAX_SIDE);
    limits.max_image_height = Some(4 * MAX_SIDE);
    limits.max_alloc = Some(1 << 30);
    reader.limits(limits);
    let image = reader.decode()?;
    let is_integer = !matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let size = UVec2::new(image.width(), image.height());
    let bits = (image.color().bits_per_pixel() / u16::from(image.color().channel_count())) as u8;
    let values = image.into_rgb32f().pixels().map(|pixel| Vec3::from_array(pixel.0)).collect();
    Ok(RawImage { size, values, is_integer, bits })
}

/// Reads a TIFF file of one channel of floats, as profilometers write it and `image` does not read; `None` for other files.
///
/// # Errors
/// The file is such a file, but it is damaged or too large.
fn read_float_tiff(bytes: &[u8], path: &Path) -> Result<Option<RawImage>> {
    let Ok(mut decoder) = tiff::decoder::Decoder::new(Cursor::new(bytes)) else { return Ok(None) };
    let format = decoder.find_tag(Tag::SampleFormat).ok().flatten().and_then(|format| format.into_u16_vec().ok());
    let is_float = format.is_some_and(|format| format == [SampleFormat::IEEEFP.to_u16()]);
    let (Ok(tiff::ColorType::Gray(bits)), true) = (decoder.colortype(), is_float) else { return Ok(None) };
    let error_for = |found: tiff::TiffError| InputError::new("", found, "a TIFF file of floats").in_file(path);
    let size = UVec2::from(decoder.dimensions().map_err(error_for)?);
    check_size(size, path)?;
    let values: Vec<f32> = match decoder.read_image().map_err(error_for)? {
        DecodingResult::F16(values) => values.into_iter().map(|value| value.to_f32()).collect(),
        DecodingResult::F32(values) => values,
        DecodingResult::F64(values) => values.into_iter().map(|value| value as f32).collect(),
        _ => return Ok(None),
    };
    let is_whole = values.len() == size.x as usize * size.y as usize;
    let values = values.into_iter().map(Vec3::splat).collect();
    Ok(is_whole.then_some(RawImage { size, values, is_integer: false, bits }))
}

/// Reads R, G and B of an EXR file, or its Y channel, or its only channel.
fn read_exr(bytes: &[u8], path: &Path) -> Result<RawImage> {
    let error_for = |found: String| InputError::new("", found, "an EXR file with channels R, G, B or Y").in_file(path);
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_err(|error| error_for(error.to_string()))?;
    for header in &meta.headers {
        check_size(UVec2::new(header.layer_size.width() as u32, header.layer_size.height() as u32), path)?;
    }
    let image = exr_file::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| error_for(error.to_string()))?;
    let layer = image.layer_data;
    let size = UVec2::new(layer.size.width() as u32, layer.size.height() as u32);
    let channels = &layer.channel_data.list;
    let find = |name: &str| channels.iter().find(|channel| channel.name.eq_case_insensitive(name));
    let chosen = match (find("R"), find("G"), find("B"), find("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (_, _, _, Some(y)) => [y, y, y],
        _ if channels.len() == 1 => [&channels[0]; 3],
        _ => {
            let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
            return Err(error_for(format!("channels {}", names.join(", "))).into());
        }
    };
    let count = size.x as usize * size.y as usize;
    if let Some(short) = chosen.iter().find(|channel| channel.sample_data.len() < count) {
        return Err(error_for(format!("{} samples in channel {}", short.sample_data.len(), short.name)).into());
    }
    let value =
        |index: usize| Vec3::from_array(chosen.map(|channel| channel.sample_data.value_by_flat_index(index).to_f32()));
    Ok(RawImage { size, values: (0..count).map(value).collect(), is_integer: false, bits: 32 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_bit_heights_are_linear_and_keep_their_bits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ramp.png");
        let ramp =
            image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_fn(4, 1, |x, _| image::Luma([x as u16 * 257 + 1]));
        ramp.save(&path).unwrap();
        let heights = read_heights(folder.path(), Path::new("ramp.png")).unwrap();
        assert_eq!(heights.size, UVec2::new(4, 1));
        for (x, height) in heights.values.iter().enumerate() {
            assert!((height - (x as f32 * 257.0 + 1.0) / 65535.0).abs() < 1e-7);
        }
    }

    #[test]
    fn eight_bit_colours_are_srgb() {
        let folder = tempfile::tempdir().unwrap();
        image::RgbImage::from_pixel(1, 1, image::Rgb([188, 0, 255])).save(folder.path().join("c.png")).unwrap();
        let colors = read_colors(folder.path(), Path::new("c.png")).unwrap();
        // 188/255 is half as much light as white (0.5029 by the standard's formula).
        assert!((colors.values[0] - Vec3::new(0.5029, 0.0, 1.0)).abs().max_element() < 1e-4, "{:?}", colors.values);
    }

    #[test]
    fn exr_heights_are_read_and_nan_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("h.exr");
        exr_file::write_rgb_file(&path, 3, 2, |x, y| {
            let h = x as f32 - 7.5 * y as f32;
            (h, h, h)
        })
        .unwrap();
        let heights = read_heights(folder.path(), Path::new("h.exr")).unwrap();
        assert_eq!(heights.values, [0.0, 1.0, 2.0, -7.5, -6.5, -5.5]);
        exr_file::write_rgb_file(&path, 2, 1, |x, _| {
            let h = if x == 1 { f32::NAN } else { 0.0 };
            (h, h, h)
        })
        .unwrap();
        let error = read_heights(folder.path(), Path::new("h.exr")).unwrap_err().to_string();
        assert!(error.contains("pixel (1, 0)") && error.contains("finite"), "{error}");
    }

    #[test]
    fn tiff_files_of_floats_are_read_as_exr_files_are() {
        use tiff::encoder::{TiffEncoder, colortype};
        let folder = tempfile::tempdir().unwrap();
        let file = || std::fs::File::create(folder.path().join("h.tif")).unwrap();
        let single = [0.0, 1.5, -2.25, 3.0, 1e-3, 7.0_f32];
        TiffEncoder::new(file()).unwrap().write_image::<colortype::Gray32Float>(3, 2, &single).unwrap();
        let read = || read_heights(folder.path(), Path::new("h.tif"));
        let heights = read().unwrap();
        assert_eq!((heights.size, &heights.values[..]), (UVec2::new(3, 2), &single[..]));
        let double = single.map(f64::from);
        TiffEncoder::new(file()).unwrap().write_image::<colortype::Gray64Float>(2, 3, &double).unwrap();
        assert_eq!(read().unwrap().values, single);
        let broken = [0.0, f32::NAN];
        TiffEncoder::new(file()).unwrap().write_image::<colortype::Gray32Float>(2, 1, &broken).unwrap();
        assert!(read().unwrap_err().to_string().contains("NaN"));
        let large = vec![0.0_f32; 5000];
        TiffEncoder::new(file()).unwrap().write_image::<colortype::Gray32Float>(5000, 1, &large).unwrap();
        assert!(read().unwrap_err().to_string().contains("5000 x 1 pixels"));
        let whole = std::fs::read(folder.path().join("h.tif")).unwrap();
        std::fs::write(folder.path().join("h.tif"), &whole[..whole.len() / 2]).unwrap();
        assert_eq!(read().unwrap_err().exit_code(), 2);
    }

    #[test]
    fn errors_name_a_missing_file_and_a_file_that_is_no_image() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("text.png"), "not an image").unwrap();
        for (name, part) in [("text.png", "expected an image"), ("none.png", "none.png"), (".", "expected a file")] {
            let error = read_heights(folder.path(), Path::new(name)).unwrap_err();
            assert!(error.to_string().contains(part), "{error}");
            assert_eq!(error.exit_code(), 2);
        }
    }
}
