//! A scene that is edited by keys, as `--set` does, and a scene together with the files that it names.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::load::{SceneSource, checked, parse_toml};
use super::{LoadedScene, Painted, check, files, keys_of, overrides, shipped};
use crate::base::{Error, InputError, Result, regular_file, replace_file};
use crate::cache::{Key, KeyBuilder};

/// A scene, and the table that edits apply to. The table holds the keys of the scene file and of the edits alone, so that an
/// edit does the same as `--set`.
#[derive(Debug, Clone)]
pub struct EditableScene {
    table: Table,
    loaded: LoadedScene,
}

impl EditableScene {
    /// Opens a file or a shipped scene.
    ///
    /// # Errors
    /// As [`super::open`].
    pub fn open(scene: &str) -> Result<Self> {
        let loaded = super::open(scene, &[])?;
        Ok(Self { table: SceneSource::find(scene)?.table()?, loaded })
    }

    /// Parses the text of a scene file whose relative paths start at `base_dir`.
    ///
    /// # Errors
    /// As [`super::parse`].
    pub fn parse(text: &str, base_dir: &Path, name: &str) -> Result<Self> {
        let scene = super::parse(text)?;
        let (base_dir, name) = (base_dir.to_owned(), name.to_owned());
        Ok(Self {
            table: parse_toml(text)?,
            loaded: LoadedScene { scene, base_dir, name, painted: Painted::default() },
        })
    }

    pub fn loaded(&self) -> &LoadedScene {
        &self.loaded
    }

    /// Sets keys to values, all of them or none. The keys are those of `--set`.
    ///
    /// # Errors
    /// A key that the scene does not have, or a value that its key cannot take.
    pub fn set(&mut self, edits: &[(String, Value)]) -> Result<()> {
        let mut table = self.table.clone();
        for (key, value) in edits {
            overrides::apply_value(&mut table, key, value.clone())?;
        }
        let scene = checked(table.clone()).map_err(|problem| problem.into_error(None))?;
        self.table = table;
        self.loaded.scene = scene;
        Ok(())
    }

    /// As [`EditableScene::set`] with the texts of `--set`.
    ///
    /// # Errors
    /// As [`EditableScene::set`].
    pub fn with_overrides(&self, texts: &[String]) -> Result<LoadedScene> {
        let mut table = self.table.clone();
        texts.iter().try_for_each(|text| overrides::apply(&mut table, text))?;
        let scene = checked(table).map_err(|problem| problem.into_error(None))?;
        Ok(LoadedScene { scene, ..self.loaded.clone() })
    }

    /// The value of a key: a value or a table with its defaults. `None` for an optional key that is not set.
    ///
    /// # Errors
    /// The scene has no such key.
    pub fn get(&self, key: &str) -> Result<Option<Value>> {
        let keys = overrides::split_key(key).unwrap_or_default();
        let whole = Value::Table(self.loaded.scene.to_short_table()?);
        let found = keys.iter().try_fold(&whole, |value, key| match value {
            Value::Array(entries) => key
                .parse()
                .ok()
                .and_then(|index: usize| entries.get(index))
                .or_else(|| entries.iter().find(|entry| entry.get("name").and_then(Value::as_str) == Some(key))),
            value => value.get(key),
        });
        if let Some(value) = found.filter(|_| !keys.is_empty()) {
            return Ok(Some(value.clone()));
        }
        let known = keys_of(&self.loaded.scene)?;
        let below = |entry: &str| entry == key || entry.strip_prefix(key).is_some_and(|rest| rest.starts_with('.'));
        if known.iter().any(|entry| below(&entry.key)) {
            return Ok(None);
        }
        let error = InputError::new(key, format!("unknown key `{key}`"), "a key of this scene, as `fields` lists them");
        Err(match check::nearest(key, known.iter().map(|entry| entry.key.as_str())) {
            Some(near) => error.with_hint(format!("did you mean `{near}`?")),
            None => error,
        }
        .into())
    }

    /// The text of a scene file with all keys.
    ///
    /// # Errors
    /// The scene has no form as TOML.
    pub fn to_toml(&self) -> Result<String> {
        self.loaded.scene.to_toml()
    }
}

/// A scene and the content of all files that it names, for another process or machine.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SceneBundle {
    /// Text of the scene, whose paths are the names of the files.
    pub text: String,
    pub name: String,
    pub files: Vec<(String, Vec<u8>)>,
}

impl SceneBundle {
    /// Reads all files of a scene.
    ///
    /// # Errors
    /// A file cannot be read, or scenes name each other in a circle.
    pub fn of(scene: &EditableScene) -> Result<Self> {
        let mut bundle = Self { name: scene.loaded.name.clone(), ..Self::default() };
        bundle.text = bundle.add(scene.table.clone(), &scene.loaded, 0)?;
        Ok(bundle)
    }

    /// Adds the files that a scene names, and returns its text with their new names.
    fn add(&mut self, mut table: Table, loaded: &LoadedScene, depth: usize) -> Result<String> {
        /// Largest number of scenes that name each other.
        const MAX_DEPTH: usize = 16;
        if depth > MAX_DEPTH {
            let found = "scenes that name each other in a circle";
            return Err(InputError::new("slab", found, "scenes that end").into());
        }
        let mut names = HashMap::new();
        for path in loaded.files() {
            let is_shipped = |path: &Path| path.file_name().and_then(|name| shipped::source(name.to_str()?)).is_some();
            if !path.exists() && is_shipped(&path) {
                continue;
            }
            let bytes = if path.extension().is_some_and(|ending| ending == "toml") {
                let inner = EditableScene::open(&path.to_string_lossy())?;
                self.add(inner.table, &inner.loaded, depth + 1)?.into_bytes()
            } else {
                regular_file::read(&path)
                    .map_err(|error| InputError::new("", error, "a file that can be read").in_file(&path))?
            };
            let original = path.file_name().unwrap_or_default().to_string_lossy();
            let name = format!("{}-{original}", self.files.len());
            self.files.push((name.clone(), bytes));
            names.insert(path, name);
        }
        table.iter_mut().for_each(|(_, value)| rename(value, &loaded.base_dir, &names));
        toml::to_string(&table).map_err(|error| Error::failed(format!("cannot write the scene as TOML: {error}")))
    }

    /// A key of the scene, the content of its files, the build of the program, and `more`. The scene's name is no part of it.
    pub fn key(&self, more: &[u8]) -> Key {
        let mut key = KeyBuilder::of_stage("scene");
        key.numbers("text", self.text.as_bytes()).numbers("more", more);
        for (name, bytes) in &self.files {
            key.numbers("name", name.as_bytes()).numbers("file", bytes);
        }
        key.finish()
    }

    /// Writes the files to a folder and returns the scene, which reads them there.
    ///
    /// # Errors
    /// A file cannot be written, or the bundle holds no scene of this version.
    pub fn unpack(&self, folder: &Path) -> Result<EditableScene> {
        for (name, bytes) in &self.files {
            // A name from elsewhere must not leave the folder.
            let name = Path::new(name).file_name().unwrap_or_default();
            replace_file(&folder.join(name), bytes)?;
        }
        EditableScene::parse(&self.text, folder, &self.name)
    }
}

/// Replaces paths of files by their new names.
fn rename(value: &mut Value, base_dir: &Path, names: &HashMap<PathBuf, String>) {
    match value {
        Value::String(text) => {
            if let Some(name) = names.get(&files::resolve(base_dir, Path::new(text.as_str()))) {
                text.clone_from(name);
            }
        }
        Value::Array(values) => values.iter_mut().for_each(|value| rename(value, base_dir, names)),
        Value::Table(table) => table.iter_mut().for_each(|(_, value)| rename(value, base_dir, names)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;

    #[test]
    fn an_edit_does_the_same_as_an_override_of_the_command_line() {
        let edits: [(&str, Value, &str); 4] = [
            ("tile.geometry.depth", Value::Float(0.3), "tile.geometry.depth=0.3"),
            ("material.default.brdf.kind", "lambertian".into(), "material.default.brdf.kind=lambertian"),
            ("material.*.color", Value::Float(0.5), "material.*.color=0.5"),
            ("tile.geometry.kind", "rods".into(), "tile.geometry.kind=rods"),
        ];
        for (key, value, text) in edits {
            let mut editable = EditableScene::open("fig4b_bicolor_cup").unwrap();
            editable.set(&[(key.to_owned(), value.clone())]).unwrap();
            let opened = scene::open("fig4b_bicolor_cup", &[text.to_owned()]).unwrap();
            assert_eq!(editable.loaded(), &opened, "{text}");
            let original = EditableScene::open("fig4b_bicolor_cup").unwrap();
            assert_eq!(original.with_overrides(&[text.to_owned()]).unwrap(), opened, "{text}");
        }
    }

    #[test]
    fn an_edit_that_is_refused_changes_nothing_and_names_its_key() {
        let mut editable = EditableScene::open("fig4b_bicolor_cup").unwrap();
        let before = editable.to_toml().unwrap();
        let edits = [("tile.geometry.depth", 0.3), ("tile.geometry.dephth", 0.3)];
        let edits = edits.map(|(key, value)| (key.to_owned(), Value::Float(value)));
        let error = editable.set(&edits).unwrap_err().to_string();
        assert!(error.starts_with("tile.geometry.dephth: found unknown key"), "{error}");
        assert_eq!(editable.to_toml().unwrap(), before);
        let error = editable.get("tile.geometry.dephth").unwrap_err().to_string();
        assert!(error.contains("did you mean `tile.geometry.depth`?"), "{error}");
        assert_eq!(editable.get("material.default.color").unwrap(), editable.get("material.0.color").unwrap());
        assert!(editable.get("color_map").is_ok_and(|value| value.is_none()));
    }

    #[test]
    fn a_bundle_holds_the_files_of_a_scene_and_of_the_scenes_that_it_names() {
        let folder = tempfile::tempdir().unwrap();
        let inner = "[tile]\ngeometry = { kind = \"heightfield\", path = \"heights.png\" }\n";
        let outer = "[tile]\ngeometry = { kind = \"flat\" }\n[light]\nenvironment = \"sky.hdr\"\n\
                     [slab]\ntop = { kind = \"tile\", scene = \"inner.toml\" }\n";
        for (name, content) in [("inner.toml", inner), ("outer.toml", outer), ("heights.png", "h"), ("sky.hdr", "s")] {
            std::fs::write(folder.path().join(name), content).unwrap();
        }
        let scene = EditableScene::open(&folder.path().join("outer.toml").to_string_lossy()).unwrap();
        let bundle = SceneBundle::of(&scene).unwrap();
        assert_eq!(bundle.files.len(), 3);
        let elsewhere = tempfile::tempdir().unwrap();
        drop(folder);
        let unpacked = bundle.unpack(elsewhere.path()).unwrap();
        assert_eq!(SceneBundle { name: "other".to_owned(), ..bundle.clone() }.key(b""), bundle.key(b""));
        assert_ne!(bundle.key(b"pairs"), bundle.key(b""));
        let mut changed = bundle.clone();
        changed.files[0].1.push(0);
        assert_ne!(changed.key(b""), bundle.key(b""));
        let files = unpacked.loaded().files();
        assert_eq!(files.len(), 2);
        assert!(files.iter().all(|file| file.starts_with(elsewhere.path()) && file.is_file()), "{files:?}");
        let inner = files.iter().find(|file| file.extension().unwrap() == "toml").unwrap();
        let heights = scene::load(inner, &[]).unwrap().files();
        assert_eq!(std::fs::read(&heights[0]).unwrap(), b"h");
    }
}
