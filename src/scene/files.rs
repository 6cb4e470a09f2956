//! Files that a scene names: relative to the scene file, or `asset:name` for a file that is embedded in the binary.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use super::{
    Background, BrdfSpec, ColorMap, Driver, Geometry, LayerWeight, LoadedScene, Scene, SlabFace, Switch, TermSpec,
    check, shipped,
};
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
    /// The scene without light that facets send to each other, as in the paper's definition of `f̄`.
    pub fn without_interreflection(&self) -> Self {
        let mut direct = self.clone();
        direct.scene.effects.interreflection = Switch::Off;
        direct
    }

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

impl LoadedScene {
    /// The key whose value names a file of the scene, by the path of the file on disk.
    pub fn key_of_file(&self, file: &Path) -> Option<String> {
        if !self.files().iter().any(|one| one == file) {
            return None;
        }
        let is_file = |text: &str| resolve(&self.base_dir, Path::new(text)) == file;
        let mut key = String::new();
        has_text(&toml::Value::Table(self.scene.to_table().ok()?), &is_file, &mut key).then_some(key)
    }
}

/// Searches a value for a text, and appends its place to `key` if it is found.
fn has_text(value: &toml::Value, is_wanted: &dyn Fn(&str) -> bool, key: &mut String) -> bool {
    let length = key.len();
    let mut is_in = |step: &str, value: &toml::Value| {
        if !key.is_empty() {
            key.push('.');
        }
        key.push_str(step);
        let is_found = has_text(value, is_wanted, key);
        if !is_found {
            key.truncate(length);
        }
        is_found
    };
    match value {
        toml::Value::String(text) => is_wanted(text),
        toml::Value::Table(table) => table.iter().any(|(step, value)| is_in(step, value)),
        toml::Value::Array(values) => values.iter().enumerate().any(|(index, value)| {
            let name = value.get("name").and_then(toml::Value::as_str);
            is_in(&name.map_or_else(|| index.to_string(), str::to_owned), value)
        }),
        _ => false,
    }
}

impl Scene {
    /// The paths of all files that the scene names, but for the environment, whose name is text.
    pub fn paths_mut(&mut self) -> Vec<&mut PathBuf> {
        let Self { tile, materials, object, color_map, slab, background, .. } = self;
        let mut paths: Vec<&mut PathBuf> = Vec::new();
        match &mut tile.geometry {
            Geometry::Mesh(mesh) => paths.push(&mut mesh.path),
            Geometry::Heightfield(field) => paths.extend(&mut field.path),
            _ => {}
        }
        paths.extend(&mut tile.color_path);
        paths.extend(&mut tile.slot_path);
        paths.extend(&mut object.path);
        let brdfs = materials.iter_mut().filter_map(|material| material.brdf.as_mut());
        paths.extend(brdfs.flat_map(BrdfSpec::terms_mut).filter_map(TermSpec::path_mut));
        if let Some(slab) = slab {
            for face in [&mut slab.top, &mut slab.bottom] {
                match face {
                    SlabFace::Table(table) => paths.push(&mut table.path),
                    SlabFace::Tile(tile) => paths.extend(&mut tile.scene),
                    _ => {}
                }
            }
            paths.extend(&mut slab.svbtdf);
        }
        if let Some(Background::Image(image)) = background {
            paths.push(&mut image.path);
        }
        for layer in color_map.iter_mut().flat_map(|map| &mut map.layer) {
            paths.extend(texture_paths(&mut layer.driver));
            if let LayerWeight::Blend(blend) = &mut layer.weight {
                paths.extend(texture_paths(&mut blend.driver));
            }
        }
        paths
    }
}

/// The paths of the textures of a driver.
fn texture_paths(driver: &mut Driver) -> Vec<&mut PathBuf> {
    match driver {
        Driver::Texture(texture) => vec![&mut texture.path],
        Driver::Sum(sum) => sum.terms.iter_mut().flat_map(|term| texture_paths(&mut term.driver)).collect(),
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paths_to_change_are_those_of_all_files() {
        let stops = "stops = [[0.0, 0.0], [1.0, 1.0]]";
        let texture = |name: &str| format!("{{ kind = \"texture\", path = \"{name}\" }}");
        let text = format!(
            r#"
            [tile]
            geometry = {{ kind = "mesh", path = "a.obj" }}
            color_path = "b.png"
            slot_path = "c.png"
            [[material]]
            name = "default"
            brdf = [{{ kind = "merl", path = "d.binary" }}, {{ kind = "npz", path = "e.npz" }}]
            [object]
            kind = "obj"
            path = "f.obj"
            [slab]
            top = {{ kind = "table", path = "g.npz" }}
            bottom = {{ kind = "tile", scene = "h.toml" }}
            [background]
            kind = "image"
            path = "i.png"
            [[color_map.layer]]
            driver = {}
            {stops}
            weight = {{ driver = {{ kind = "sum", terms = [{{ driver = {}, weight = 1.0 }}] }}, {stops} }}
            "#,
            texture("j.png"),
            texture("k.png"),
        );
        let table: toml::Table = toml::from_str(&text).unwrap();
        let mut scene: Scene = table.try_into().unwrap();
        let loaded = LoadedScene {
            scene: scene.clone(),
            base_dir: PathBuf::new(),
            name: String::new(),
            painted: super::super::Painted::default(),
        };
        let mut files = loaded.files();
        let mut paths: Vec<PathBuf> = scene.paths_mut().into_iter().map(|path| path.clone()).collect();
        files.sort();
        paths.sort();
        assert_eq!(files.len(), 11);
        assert_eq!(paths, files);
    }
}
