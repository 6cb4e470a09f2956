//! Files that a scene names: relative to the scene file, or `asset:name` for a file that is embedded in the binary.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use super::{Background, BrdfSpec, ColorMap, Geometry, LoadedScene, Scene, TermSpec, check, shipped};
use crate::base::{InputError, Result, regular_file};

/// Reads a file that a scene names. The scene's folder is `base_dir`, and the file has at most `limit` bytes.
///
/// # Errors
/// The file is missing, unreadable or too large. The error names the file.
pub fn read(base_dir: &Path, path: &Path, limit: u64) -> Result<Cow<'static, [u8]>> {
    if let Some(name) = path.to_str().and_then(|path| path.strip_prefix("asset:")) {
        return match shipped::asset(name) {
            Some(bytes) => Ok(Cow::Borrowed(bytes)),
            None => {
                let names = shipped::ASSETS.iter().chain(shipped::SHEETS).map(|(name, _)| *name);
                let expected = format!("one of {}", names.clone().collect::<Vec<_>>().join(", "));
                let error = InputError::new("", format!("no asset `{name}`"), expected).in_file(path);
                Err(match check::nearest(name, names) {
                    Some(name) => error.with_hint(format!("did you mean `asset:{name}`?")),
                    None => error,
                }
                .into())
            }
        };
    }
    let full = resolve(base_dir, path);
    let input_error = |found: String, expected: &str| InputError::new("", found, expected).in_file(&full);
    let unreadable = |error: std::io::Error| input_error(error.to_string(), "a file that can be read");
    let length = std::fs::metadata(&full).map_err(unreadable)?.len();
    if length > limit {
        return Err(input_error(format!("{length} bytes"), &format!("at most {limit} bytes")).into());
    }
    Ok(Cow::Owned(regular_file::read(&full).map_err(unreadable)?))
}

/// Path on disk of a file that a scene names; the name itself if the file is embedded.
pub fn resolve(base_dir: &Path, path: &Path) -> PathBuf {
    if is_embedded(path) { path.to_owned() } else { base_dir.join(path) }
}

fn is_embedded(path: &Path) -> bool {
    path.to_str().is_some_and(|path| path.starts_with("asset:"))
}

impl LoadedScene {
    /// Paths on disk of all files that the scene names: tile, images, measured BRDFs, object and environment.
    pub fn files(&self) -> Vec<PathBuf> {
        let Scene { tile, materials, object, light, color_map, slab, background, .. } = &self.scene;
        let of_geometry = match &tile.geometry {
            Geometry::Mesh(mesh) => Some(mesh.path.as_path()),
            Geometry::Heightfield(field) => field.path.as_deref(),
            _ => None,
        };
        let terms = materials.iter().filter_map(|material| material.brdf.as_ref()).flat_map(BrdfSpec::terms);
        // The names of built-in environments have no ending.
        let environment = Some(Path::new(&light.environment)).filter(|path| path.extension().is_some());
        [of_geometry, tile.color_path.as_deref(), tile.slot_path.as_deref(), object.path.as_deref(), environment]
            .into_iter()
            .flatten()
            .chain(terms.filter_map(TermSpec::path))
            .chain(slab.iter().flat_map(|slab| slab.faces().map(|(_, face)| face.path())).flatten())
            .chain(background.iter().filter_map(Background::path))
            .chain(slab.iter().filter_map(|slab| slab.svbtdf.as_deref()))
            .chain(color_map.iter().flat_map(ColorMap::files).map(PathBuf::as_path))
            .filter(|path| !is_embedded(path))
            .map(|path| resolve(&self.base_dir, path))
            .collect()
    }
}
