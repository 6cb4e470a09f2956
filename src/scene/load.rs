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

/// The argument that stands for a scene on standard input.
const STANDARD_INPUT: &str = "-";

/// The text of a scene, and where it comes from.
pub(super) struct SceneSource {
    pub text: String,
    pub base_dir: PathBuf,
    pub name: String,
    /// The file as messages name it.
    file: PathBuf,
}

impl SceneSource {
    /// The text of a file or of a shipped scene.
    ///
    /// # Errors
    /// There is no such scene, or the file cannot be read.
    pub(super) fn find(scene: &str) -> Result<Self> {
        let path = Path::new(scene);
        if path.is_file() {
            return Self::of_file(path);
        }
        if let Some(text) = shipped::source(scene) {
            let file = shown_name(scene);
            return Ok(Self { text: text.to_owned(), base_dir: PathBuf::new(), name: scene.to_owned(), file });
        }
        if path.exists() {
            // The path is no regular file, and the error says what it is.
            return Self::of_file(path);
        }
        let error = InputError::new(
            "",
            format!("no file and no shipped scene `{scene}`"),
            "a scene file or a name that `biscale materials` lists",
        );
        Err(match check::nearest(scene, shipped::names()) {
            Some(name) => error.with_hint(format!("did you mean `{name}`?")),
            None => error,
        }
        .into())
    }

    fn of_file(path: &Path) -> Result<Self> {
        let file = regular_file::open(path).map_err(|error| unreadable(path, error))?;
        let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
        if length > MAX_FILE {
            return Err(InputError::new("", format!("{length} bytes"), format!("at most {MAX_FILE} bytes"))
                .in_file(path)
                .into());
        }
        let text = read_text(file, path)?;
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let base_dir = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { text, base_dir, name, file: path.to_owned() })
    }

    /// The text on standard input. Its relative paths start at the working directory.
    fn of_standard_input() -> Result<Self> {
        let file = shown_name(STANDARD_INPUT);
        let text = read_text(std::io::stdin().lock(), &file)?;
        Ok(Self { text, base_dir: PathBuf::new(), name: "stdin".to_owned(), file })
    }

    /// The table of the text, without a check of its keys.
    ///
    /// # Errors
    /// The text is no TOML.
    pub(super) fn table(&self) -> Result<Table> {
        parse_toml(&self.text).map_err(|error| error.in_file(&self.file))
    }

    fn load(self, overrides: &[String]) -> Result<LoadedScene> {
        let scene = load_with_overrides(&self.text, overrides).map_err(|error| error.in_file(&self.file))?;
        Ok(LoadedScene { scene, base_dir: self.base_dir, name: self.name, painted: Painted::default() })
    }
}

/// The error of a scene file that cannot be read.
fn unreadable(path: &Path, found: impl std::fmt::Display) -> Error {
    InputError::new("", found, "a scene file (TOML, UTF-8)").in_file(path).into()
}

fn read_text(from: impl Read, path: &Path) -> Result<String> {
    let mut text = String::new();
    from.take(MAX_FILE).read_to_string(&mut text).map_err(|error| unreadable(path, error))?;
    Ok(text)
}

/// Opens `scene`, a file or the name of a shipped scene, with `--set` overrides (`key.path=value`) applied.
///
/// # Errors
/// There is no such scene, it cannot be read, or its content or an override is wrong.
pub fn open(scene: &str, overrides: &[String]) -> Result<LoadedScene> {
    SceneSource::find(scene)?.load(overrides)
}

/// Opens the scene of a command: as [`open`], and `-` is a scene file on standard input.
///
/// # Errors
/// As [`open`].
pub fn open_argument(scene: &str, overrides: &[String]) -> Result<LoadedScene> {
    if is_standard_input(scene) { SceneSource::of_standard_input()?.load(overrides) } else { open(scene, overrides) }
}

/// Returns true if the scene of a command is on standard input.
pub fn is_standard_input(scene: &str) -> bool {
    scene == STANDARD_INPUT
}

/// The scene of a command as messages name it.
pub fn shown_name(scene: &str) -> PathBuf {
    match scene {
        STANDARD_INPUT => PathBuf::from("standard input"),
        _ if !Path::new(scene).is_file() && shipped::source(scene).is_some() => {
            PathBuf::from(format!("{scene} (shipped)"))
        }
        _ => PathBuf::from(scene),
    }
}

/// Loads a scene file.
///
/// # Errors
/// As [`open`].
pub fn load(path: &Path, overrides: &[String]) -> Result<LoadedScene> {
    SceneSource::of_file(path)?.load(overrides)
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
    let table = parse_toml(source)?;
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
    let mut table = parse_toml(source)?;
    for text in overrides {
        overrides::apply(&mut table, text)?;
    }
    checked(table).map_err(|problem| {
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
    })
}

/// The shortest decimal number that is read as the same in single precision.
pub(super) fn shortest(number: f64) -> f64 {
    let single = number as f32;
    if f64::from(single) == number { single.to_string().parse().unwrap_or(number) } else { number }
}

/// Replaces all numbers by their shortest form.
fn shorten(value: &mut toml::Value) {
    match value {
        toml::Value::Float(number) => *number = shortest(*number),
        toml::Value::Array(values) => values.iter_mut().for_each(shorten),
        toml::Value::Table(table) => table.iter_mut().for_each(|(_, value)| shorten(value)),
        _ => {}
    }
}

/// The scene of a table, checked against the catalogue and the rules between keys.
pub(super) fn checked(table: Table) -> std::result::Result<Scene, Problem> {
    check::check_table(&table, &Scene::fields(), &mut Vec::new())?;
    // The catalogue defines the legal values. An error of serde after this check means a gap in the catalogue.
    let scene: Scene = table.try_into().map_err(|error: toml::de::Error| {
        Problem::new(&[], error.message(), "a scene that the catalogue of keys describes")
    })?;
    scene.check_relations()?;
    Ok(scene)
}

/// Parses a text as TOML.
pub(super) fn parse_toml(source: &str) -> Result<Table> {
    toml::from_str(source).map_err(|error| syntax_error(source, &error))
}

fn syntax_error(source: &str, error: &toml::de::Error) -> Error {
    let place = error.span().map(|span| format!("line {}", line_at(source, span.start))).unwrap_or_default();
    let message = error.message().replace('\n', "; ");
    // Some messages say what was expected, and none quotes the text.
    let (what, expected) = message.split_once(", expected ").unwrap_or((&message, "TOML"));
    let text = error.span().map_or("", |span| line_text(source, span.start));
    InputError::new(place, format!("{what} in `{text}`"), expected).into()
}

/// The line of the text at an offset, without spaces around it.
fn line_text(source: &str, offset: usize) -> &str {
    source.lines().nth(line_at(source, offset) - 1).unwrap_or_default().trim()
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

    /// The scene as a table with all keys that have a value.
    pub(super) fn to_table(&self) -> Result<Table> {
        Table::try_from(self).map_err(|error| Error::failed(format!("cannot write the scene as TOML: {error}")))
    }

    /// As [`Scene::to_table`], with numbers as a scene file writes them: 0.1 in place of the number nearest to it that the scene
    /// holds in single precision.
    pub(super) fn to_short_table(&self) -> Result<Table> {
        let mut table = self.to_table()?;
        table.iter_mut().for_each(|(_, value)| shorten(value));
        Ok(table)
    }

    /// Checks a scene that was created or changed in memory: ranges, names and relations between fields.
    pub fn validate(&self) -> Result<()> {
        let table = self.to_table()?;
        let fail = |problem: Problem| Error::from(problem.into_error(None));
        check::check_table(&table, &Self::fields(), &mut Vec::new()).map_err(fail)?;
        self.check_relations().map_err(fail)
    }
}
