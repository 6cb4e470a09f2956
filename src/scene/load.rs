//! Loading a checked [`Scene`] from a file, a shipped name or a text, and writing it back.

use std::io::Read;
use std::path::{Path, PathBuf};

use toml::Table;
use toml::de::{DeTable, DeValue};

use super::check::{self, PathStep, Problem};
use super::{Painted, Scene, overrides, shipped};
use crate::base::{Error, InputError, Result, regular_file};

/// A scene and the folder of its relative paths.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedScene {
    pub scene: Scene,
    /// Folder of the scene file; empty (the working directory) for shipped scenes.
    pub base_dir: PathBuf,
    /// The file's stem or the shipped name, for titles.
    pub name: String,
    /// Images in memory that replace files; the editor sets them.
    pub painted: Painted,
}

/// Largest scene file in bytes. A larger file is not a scene.
const MAX_FILE: u64 = 64 << 20;

/// Opens `scene`, a file or the name of a shipped material, with `--set` overrides (`key.path=value`) applied.
pub fn open(scene: &str, overrides: &[String]) -> Result<LoadedScene> {
    let path = Path::new(scene);
    if path.is_file() {
        return load(path, overrides);
    }
    if let Some(source) = shipped::source(scene) {
        let parsed =
            load_with_overrides(source, overrides).map_err(|error| error.in_file(format!("{scene} (shipped)")))?;
        return Ok(LoadedScene {
            scene: parsed,
            base_dir: PathBuf::new(),
            name: scene.to_owned(),
            painted: Painted::default(),
        });
    }
    if path.exists() {
        // The path is no regular file, and the error says what it is.
        return load(path, overrides);
    }
    let error = InputError::new(
        "",
        format!("no file and no shipped material `{scene}`"),
        "a scene file or a name that `biscale materials` lists",
    );
    Err(match check::nearest(scene, shipped::names()) {
        Some(name) => error.with_hint(format!("did you mean `{name}`?")),
        None => error,
    }
    .into())
}

/// Loads a scene file.
pub fn load(path: &Path, overrides: &[String]) -> Result<LoadedScene> {
    let input_error =
        |found: String| Error::from(InputError::new("", found, "a scene file (TOML, UTF-8)").in_file(path));
    let unreadable = |error: std::io::Error| input_error(error.to_string());
    let file = regular_file::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    if length > MAX_FILE {
        return Err(input_error(format!("{length} bytes")));
    }
    let mut source = String::new();
    file.take(MAX_FILE).read_to_string(&mut source).map_err(unreadable)?;
    let scene = load_with_overrides(&source, overrides).map_err(|error| error.in_file(path))?;
    let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let base_dir = path.parent().unwrap_or(Path::new("")).to_owned();
    Ok(LoadedScene { scene, base_dir, name, painted: Painted::default() })
}

/// Parses a scene from its text.
pub fn parse(source: &str) -> Result<Scene> {
    load_with_overrides(source, &[])
}

impl Scene {
    /// Returns the scene with the overrides `quality.key=value` applied to its settings.
    ///
    /// # Errors
    /// An override has another form, or a value that its setting cannot take.
    pub fn with_quality(&self, overrides: &[String]) -> Result<Self> {
        let input_error =
            |found: String| Error::from(InputError::new("quality", found, "settings of the quality table"));
        let quality = Table::try_from(&self.quality).map_err(|error| input_error(error.to_string()))?;
        let mut table = Table::new();
        table.insert("quality".to_owned(), toml::Value::Table(quality));
        for text in overrides {
            overrides::apply(&mut table, text)?;
        }
        let quality = table.remove("quality").ok_or_else(|| input_error(String::new()))?;
        let quality = quality.try_into().map_err(|error: toml::de::Error| input_error(error.message().to_owned()))?;
        Ok(Self { quality, ..self.clone() })
    }
}

/// Parses another file of TOML against a catalogue of its keys.
///
/// # Errors
/// The text is no TOML, or a key is unknown, missing or has a wrong value. The error names the line and the key.
pub fn parse_table<T: serde::de::DeserializeOwned>(source: &str, fields: &[super::Field]) -> Result<T> {
    let table: Table = toml::from_str(source).map_err(|error| syntax_error(source, &error))?;
    check::check_table(&table, fields, &mut Vec::new()).map_err(|problem| {
        let line = line_of(source, &problem.path);
        Error::from(problem.into_error(line))
    })?;
    table
        .try_into()
        .map_err(|error: toml::de::Error| InputError::new("", error.message(), "values of the listed keys").into())
}

/// Parses a scene from its text. Overrides are applied to the text's table, which is then checked.
pub fn load_with_overrides(source: &str, overrides: &[String]) -> Result<Scene> {
    let mut table: Table = toml::from_str(source).map_err(|error| syntax_error(source, &error))?;
    for text in overrides {
        overrides::apply(&mut table, text)?;
    }
    let fail = |problem: Problem| {
        let field = check::path_text(&problem.path);
        match overrides.iter().rev().find(|text| overrides::touches(text, &problem.path)) {
            Some(text) => {
                let mut error = problem.into_error(None);
                error.place = if field.is_empty() { format!("--set {text}") } else { format!("--set {text}: {field}") };
                Error::from(error)
            }
            None => {
                let line = line_of(source, &problem.path);
                problem.into_error(line).into()
            }
        }
    };
    check::check_table(&table, &Scene::fields(), &mut Vec::new()).map_err(fail)?;
    // The catalogue defines the legal values. An error of serde after this check means a gap in the catalogue.
    let scene: Scene = table.try_into().map_err(|error: toml::de::Error| {
        Error::from(InputError::new("", error.message(), "a scene that the catalogue of keys describes"))
    })?;
    scene.check_relations().map_err(fail)?;
    Ok(scene)
}

fn syntax_error(source: &str, error: &toml::de::Error) -> Error {
    let place = error.span().map(|span| format!("line {}", line_at(source, span.start))).unwrap_or_default();
    InputError::new(place, error.message().replace('\n', "; "), "TOML").into()
}

fn line_at(source: &str, offset: usize) -> usize {
    let offset = offset.min(source.len());
    1 + source.as_bytes()[..offset].iter().filter(|&&byte| byte == b'\n').count()
}

/// The line of the deepest part of `path` that exists in the text.
fn line_of(source: &str, path: &[PathStep]) -> Option<usize> {
    let document = DeTable::parse(source).ok()?;
    let mut offset = None;
    let mut table = Some(document.get_ref());
    let mut value: Option<&DeValue<'_>> = None;
    for step in path {
        let next = match step {
            PathStep::Key(key) => {
                let found = table.or(value.and_then(DeValue::as_table))?.iter().find(|(name, _)| name.get_ref() == key);
                let Some((name, next)) = found else { break };
                offset = Some(name.span().start);
                next
            }
            PathStep::Entry(index, _) => {
                let Some(next) = value.and_then(DeValue::as_array).and_then(|array| array.get(*index)) else {
                    break;
                };
                offset = Some(next.span().start);
                next
            }
        };
        table = None;
        value = Some(next.get_ref());
    }
    offset.map(|offset| line_at(source, offset))
}

impl Scene {
    /// Writes the scene as the text of a scene file.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|error| Error::failed(format!("cannot write the scene as TOML: {error}")))
    }

    /// Checks a scene that was created or changed in memory: ranges, names and relations between fields.
    pub fn validate(&self) -> Result<()> {
        let table =
            Table::try_from(self).map_err(|error| Error::failed(format!("cannot write the scene as TOML: {error}")))?;
        let fail = |problem: Problem| Error::from(problem.into_error(None));
        check::check_table(&table, &Self::fields(), &mut Vec::new()).map_err(fail)?;
        self.check_relations().map_err(fail)
    }
}
