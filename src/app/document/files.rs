//! Saving a document: the scene, the painted images beside it, and paths that stay valid.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use crate::base::{InputError, Result};
use crate::scene::{BrdfSpec, Geometry, MaterialSpec, Pixels, Scene, TermSpec};
use glam::Vec3;

use super::{Change, Document};

/// Modification time and length of a file, to detect changes by other programs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileStamp {
    modified: Option<SystemTime>,
    length: u64,
}

impl FileStamp {
    pub fn of(path: &Path) -> Option<Self> {
        let metadata = std::fs::metadata(path).ok()?;
        Some(Self { modified: metadata.modified().ok(), length: metadata.len() })
    }
}

impl Document {
    /// Returns true if another program has written the file since the editor read or saved it.
    pub fn changed_on_disk(&self) -> bool {
        let current = self.path.as_deref().and_then(FileStamp::of);
        current.is_some() && current != self.stamp
    }

    /// Accepts the changed file on disk, so that the editor does not ask again. The document becomes unsaved.
    pub fn accept_disk(&mut self) {
        self.stamp = self.path.as_deref().and_then(FileStamp::of);
        self.saved = None;
    }

    /// Writes the document to `path`. Images are written first, so that the scene never names a missing file.
    ///
    /// # Errors
    /// Returns an error if the scene is invalid or the path cannot be written. The document is then unchanged.
    pub fn save_as(&mut self, path: &Path) -> Result<()> {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let mut scene = (*self.state.scene).clone();
        if folder != self.base_dir {
            rebase(&mut scene, &self.base_dir, &folder);
        }
        self.name_images(&mut scene, &stem);
        scene.validate()?;
        self.write_images(&scene, &folder)?;
        crate::base::replace_file(&path, scene.to_toml()?.as_bytes())?;
        let is_changed = scene != *self.state.scene || folder != self.base_dir || stem != self.name;
        if scene != *self.state.scene {
            let after = Arc::new(scene);
            let before = std::mem::replace(&mut self.state.scene, after.clone());
            self.push("Save as", vec![Change::Scene { before, after }]);
        }
        (self.base_dir, self.name) = (folder, stem);
        self.stamp = FileStamp::of(&path);
        self.path = Some(path);
        self.saved = Some(self.history.state());
        self.history.close();
        // The same scene keeps its image and its measurements.
        self.version += u64::from(is_changed);
        Ok(())
    }

    /// Names the painted images after the scene.
    fn name_images(&self, scene: &mut Scene, stem: &str) {
        if let (Geometry::Heightfield(field), Some(_)) = (&mut scene.tile.geometry, &self.state.painted.heights) {
            field.path = Some(PathBuf::from(format!("{stem}_heights.exr")));
        }
        if self.state.painted.colors.is_some() {
            scene.tile.color_path = Some(PathBuf::from(format!("{stem}_colors.exr")));
        }
        if self.state.painted.slots.is_some() {
            scene.tile.slot_path = Some(PathBuf::from(format!("{stem}_materials.png")));
        }
    }

    /// Writes the painted images that the scene names into `folder`.
    pub(super) fn write_images(&self, scene: &Scene, folder: &Path) -> Result<()> {
        if let (Geometry::Heightfield(field), Some(image)) = (&scene.tile.geometry, &self.state.painted.heights)
            && let Some(file) = &field.path
        {
            write_heights(image, &folder.join(file))?;
        }
        if let (Some(file), Some(image)) = (&scene.tile.color_path, &self.state.painted.colors) {
            write_colors(image, &folder.join(file))?;
        }
        if let (Some(file), Some(image)) = (&scene.tile.slot_path, &self.state.painted.slots) {
            write_slots(image, &folder.join(file))?;
        }
        Ok(())
    }
}

/// Writes heights. `.exr` stores them exactly, and `.png` has 16 bits between 0 and 1.
///
/// # Errors
/// Returns an error if the ending is unknown or the path cannot be written.
pub fn write_heights(image: &Pixels<f32>, path: &Path) -> Result<()> {
    let bytes = match ending(path).as_deref() {
        Some("png") => {
            let values: Vec<u16> = image.values.iter().map(|v| (v.clamp(0.0, 1.0) * 65535.0).round() as u16).collect();
            let buffer = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(image.size.x, image.size.y, values);
            png(buffer.map(image::DynamicImage::ImageLuma16), path)?
        }
        Some("exr") => exr(&image.values.iter().map(|v| Vec3::splat(*v)).collect::<Vec<_>>(), image.size, path)?,
        _ => return Err(InputError::new("image", path.display(), "a name that ends in .png or .exr").into()),
    };
    crate::base::replace_file(path, &bytes)
}

/// Writes linear colours. `.exr` stores them linearly, and `.png` as 8-bit sRGB.
///
/// # Errors
/// As [`write_heights`].
pub fn write_colors(image: &Pixels<Vec3>, path: &Path) -> Result<()> {
    let bytes = match ending(path).as_deref() {
        Some("png") => {
            let srgb = |v: &Vec3| v.to_array().map(|c| crate::render::image::tone_map::srgb_byte(c.clamp(0.0, 1.0)));
            let values: Vec<u8> = image.values.iter().flat_map(srgb).collect();
            let buffer = image::RgbImage::from_raw(image.size.x, image.size.y, values);
            png(buffer.map(image::DynamicImage::ImageRgb8), path)?
        }
        Some("exr") => exr(&image.values, image.size, path)?,
        _ => return Err(InputError::new("image", path.display(), "a name that ends in .png or .exr").into()),
    };
    crate::base::replace_file(path, &bytes)
}

/// Writes slots as a grey `.png` with 8 bits.
///
/// # Errors
/// As [`write_heights`].
pub fn write_slots(image: &Pixels<u8>, path: &Path) -> Result<()> {
    if ending(path).as_deref() != Some("png") {
        return Err(InputError::new("image", path.display(), "a name that ends in .png").into());
    }
    let buffer = image::GrayImage::from_raw(image.size.x, image.size.y, image.values.clone());
    crate::base::replace_file(path, &png(buffer.map(image::DynamicImage::ImageLuma8), path)?)
}

fn ending(path: &Path) -> Option<String> {
    path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase)
}

fn png(image: Option<image::DynamicImage>, path: &Path) -> Result<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image.ok_or_else(|| crate::base::Error::failed("an image whose size is not that of its values"))?;
    image
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|error| InputError::new("image", error, "an image that PNG can hold").in_file(path))?;
    Ok(bytes.into_inner())
}

fn exr(values: &[Vec3], size: glam::UVec2, path: &Path) -> Result<Vec<u8>> {
    use exr::prelude::*;
    let width = size.x as usize;
    let pixel = |at: Vec2<usize>| {
        let value = values[at.y() * width + at.x()];
        (value.x, value.y, value.z)
    };
    let image = Image::from_channels((width, size.y as usize), SpecificChannels::rgb(pixel));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| InputError::new("image", error, "an image that EXR can hold").in_file(path))?;
    Ok(bytes.into_inner())
}

/// Makes the file paths of a material absolute, so that scenes in other folders find them.
pub fn make_absolute(material: &mut MaterialSpec, base_dir: &Path) {
    for path in material.brdf.iter_mut().flat_map(BrdfSpec::terms_mut).filter_map(TermSpec::path_mut) {
        let file = base_dir.join(&*path);
        if file.is_file() {
            *path = std::path::absolute(&file).unwrap_or(file);
        }
    }
}

/// Changes relative paths so that they name the same files from folder `new` as from folder `old`.
fn rebase(scene: &mut Scene, old: &Path, new: &Path) {
    let moved_path = |path: &Path| -> Option<PathBuf> {
        let is_asset = path.to_str().is_some_and(|text| text.starts_with("asset:"));
        let file = old.join(path);
        if path.is_absolute() || is_asset || !file.exists() {
            return None;
        }
        let file = std::path::absolute(&file).unwrap_or(file);
        Some(file.strip_prefix(new).map(Path::to_owned).unwrap_or(file))
    };
    for path in scene.paths_mut() {
        if let Some(to) = moved_path(path) {
            *path = to;
        }
    }
    if let Some(to) = moved_path(Path::new(&scene.light.environment)) {
        scene.light.environment = to.to_string_lossy().into_owned();
    }
}
