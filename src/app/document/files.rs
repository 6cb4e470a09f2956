//! Saving: the scene, the painted images beside it, and paths that keep pointing where they did.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use crate::base::{InputError, Result};
use crate::scene::{BrdfSpec, Geometry, MaterialSpec, Pixels, Scene, TermSpec};
use glam::Vec3;

use super::{Change, Document};

/// A file as it was at some time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stamp {
    modified: Option<SystemTime>,
    length: u64,
}

impl Stamp {
    pub fn of(path: &Path) -> Option<Self> {
        let there = std::fs::metadata(path).ok()?;
        Some(Self { modified: there.modified().ok(), length: there.len() })
    }
}

impl Document {
    /// Whether someone else has written the file since it was read or saved here.
    pub fn changed_on_disk(&self) -> bool {
        let now = self.path.as_deref().and_then(Stamp::of);
        now.is_some() && now != self.stamp
    }

    /// Takes the file on disk as seen: it is not asked about again, and what is open is not what is saved there.
    pub fn accept_disk(&mut self) {
        self.stamp = self.path.as_deref().and_then(Stamp::of);
        self.saved = None;
    }

    /// Writes everything to `path`, images first, so that the scene never names one that is not there.
    ///
    /// # Errors
    /// A scene that is not valid, or a place that cannot be written; the document stays as it is then.
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
        if scene != *self.state.scene {
            let after = Arc::new(scene);
            let before = std::mem::replace(&mut self.state.scene, after.clone());
            self.push("Save as", vec![Change::Scene { before, after }]);
        }
        (self.base_dir, self.name) = (folder, stem);
        self.stamp = Stamp::of(&path);
        self.path = Some(path);
        self.saved = Some(self.history.state());
        self.history.close();
        self.version += 1;
        Ok(())
    }

    /// Painted images are called after the scene.
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

/// Heights by the file's ending: `.exr` keeps every bit, `.png` has 16 bits between 0 and 1.
///
/// # Errors
/// Another ending, or a place that cannot be written.
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

/// Linear colours by the file's ending: `.exr` as they are, `.png` as sRGB of 8 bits.
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

/// Slots as a grey `.png` of 8 bits.
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

/// Every file that a scene names, to be changed.
pub fn paths(scene: &mut Scene) -> Vec<&mut PathBuf> {
    let mut found: Vec<&mut PathBuf> = Vec::new();
    match &mut scene.tile.geometry {
        Geometry::Heightfield(field) => found.extend(&mut field.path),
        Geometry::Mesh(mesh) => found.push(&mut mesh.path),
        _ => {}
    }
    found.extend(&mut scene.tile.color_path);
    found.extend(&mut scene.tile.slot_path);
    for term in scene.materials.iter_mut().filter_map(|m| m.brdf.as_mut()).flat_map(BrdfSpec::terms_mut) {
        if let TermSpec::Merl { path } | TermSpec::Rgl { path } | TermSpec::Utia { path } | TermSpec::Npz { path } =
            term
        {
            found.push(path);
        }
    }
    found.extend(&mut scene.object.path);
    found
}

/// The measured files of a material.
fn measured_paths(material: &mut MaterialSpec) -> impl Iterator<Item = &mut PathBuf> {
    material.brdf.iter_mut().flat_map(BrdfSpec::terms_mut).filter_map(|term| match term {
        TermSpec::Merl { path } | TermSpec::Rgl { path } | TermSpec::Utia { path } | TermSpec::Npz { path } => {
            Some(path)
        }
        _ => None,
    })
}

/// Names a material's files so that any scene finds them.
pub fn make_absolute(material: &mut MaterialSpec, base_dir: &Path) {
    for path in measured_paths(material) {
        let there = base_dir.join(&*path);
        if there.is_file() {
            *path = std::path::absolute(&there).unwrap_or(there);
        }
    }
}

/// Relative paths that led somewhere from `old` lead there from `new`.
fn rebase(scene: &mut Scene, old: &Path, new: &Path) {
    let moved = |path: &Path| -> Option<PathBuf> {
        let is_asset = path.to_str().is_some_and(|text| text.starts_with("asset:"));
        let there = old.join(path);
        if path.is_absolute() || is_asset || !there.exists() {
            return None;
        }
        let there = std::path::absolute(&there).unwrap_or(there);
        Some(there.strip_prefix(new).map(Path::to_owned).unwrap_or(there))
    };
    for path in paths(scene) {
        if let Some(to) = moved(path) {
            *path = to;
        }
    }
    if let Some(to) = moved(Path::new(&scene.light.environment)) {
        scene.light.environment = to.to_string_lossy().into_owned();
    }
}
