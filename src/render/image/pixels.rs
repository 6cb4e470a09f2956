//! The rendered image, and writing it as PNG (tone-mapped, sRGB, 8 bits) or OpenEXR (linear).

use std::io::Cursor;
use std::path::Path;

use glam::Vec3;

use super::tone_map::{ToneMap, srgb_byte};
use crate::base::{Error, InputError, Result, replace_file, require_finite};

/// File formats of images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageFormat {
    Png,
    Exr,
}

impl ImageFormat {
    /// Returns the format that [`Image::write`] writes at `path`. Callers check it before a long computation.
    ///
    /// # Errors
    /// Another extension than `.png` and `.exr`.
    pub fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            ending => {
                let found = ending
                    .map_or_else(|| "a name without an ending".to_owned(), |ending| format!("the ending .{ending}"));
                let expected = "a name that ends in .png or .exr";
                Err(InputError::new("output", found, expected).in_file(path).into())
            }
        }
    }
}

/// Linear RGB radiance, row 0 at the top.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Image {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<Vec3>,
}

impl Image {
    /// Returns tone-mapped sRGB bytes, three per pixel.
    pub fn to_srgb(&self, tone_map: &ToneMap) -> Vec<u8> {
        self.pixels.iter().flat_map(|p| tone_map.apply(*p).to_array().map(srgb_byte)).collect()
    }

    /// Writes a `.png` through the tone map or a linear `.exr`, by the path's extension. If writing fails, an existing
    /// file stays unchanged.
    ///
    /// # Errors
    /// An unknown extension, a pixel that is not finite, or a path that cannot be written.
    pub fn write(&self, path: &Path, tone_map: &ToneMap) -> Result<()> {
        let format = ImageFormat::of(path)?;
        require_finite(&self.pixels)?;
        let bytes = match format {
            ImageFormat::Png => self.png_bytes(tone_map)?,
            ImageFormat::Exr => self.exr_bytes()?,
        };
        replace_file(path, &bytes)
    }

    pub(crate) fn png_bytes(&self, tone_map: &ToneMap) -> Result<Vec<u8>> {
        let too_large = |_| Error::failed("the image is too large for PNG");
        let (width, height) =
            (u32::try_from(self.width).map_err(too_large)?, u32::try_from(self.height).map_err(too_large)?);
        let mut bytes = Vec::new();
        let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
        image::ImageEncoder::write_image(
            encoder,
            &self.to_srgb(tone_map),
            width,
            height,
            image::ExtendedColorType::Rgb8,
        )
        .map_err(|error| Error::failed(format!("PNG: {error}")))?;
        Ok(bytes)
    }

    fn exr_bytes(&self) -> Result<Vec<u8>> {
        use exr::prelude::{Image, SpecificChannels, Vec2, WritableImage};
        let channels = SpecificChannels::rgb(|at: Vec2<usize>| -> (f32, f32, f32) {
            self.pixels[at.y() * self.width + at.x()].into()
        });
        let mut bytes = Cursor::new(Vec::new());
        Image::from_channels((self.width, self.height), channels)
            .write()
            .to_buffered(&mut bytes)
            .map_err(|error| Error::failed(format!("EXR: {error}")))?;
        Ok(bytes.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::image::tone_map::ToneCurve;

    const PLAIN: ToneMap = ToneMap { curve: ToneCurve::Plain, gain: 1.0 };

    fn small() -> Image {
        Image { width: 2, height: 1, pixels: vec![Vec3::new(0.0, 0.214_041_14, 1.0), Vec3::new(7.5, -1.0, 1e-4)] }
    }

    #[test]
    fn png_and_exr_come_back_as_written() {
        let folder = tempfile::tempdir().unwrap();
        let (png, exr) = (folder.path().join("a.png"), folder.path().join("a.exr"));
        small().write(&png, &PLAIN).unwrap();
        small().write(&exr, &PLAIN).unwrap();
        assert_eq!(image::open(&png).unwrap().into_rgb8().into_raw(), [0, 128, 255, 255, 0, 0]);
        let back = exr::prelude::read_first_rgba_layer_from_file(
            &exr,
            |size, _| vec![Vec3::ZERO; size.x() * size.y()],
            |pixels: &mut Vec<Vec3>, at, (r, g, b, _): (f32, f32, f32, f32)| pixels[at.x()] = Vec3::new(r, g, b),
        );
        assert_eq!(back.unwrap().layer_data.channel_data.pixels, small().pixels);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no temporary files are left");
    }

    #[test]
    fn an_unwritable_path_is_an_input_error_and_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let error = small().write(&folder.path().join("missing/a.png"), &PLAIN).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        std::fs::create_dir(folder.path().join("taken.png")).unwrap();
        std::fs::write(folder.path().join("taken.png/file"), b"x").unwrap();
        assert_eq!(small().write(&folder.path().join("taken.png"), &PLAIN).unwrap_err().exit_code(), 2);
        assert_eq!(small().write(&folder.path().join("a.gif"), &PLAIN).unwrap_err().exit_code(), 2);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
