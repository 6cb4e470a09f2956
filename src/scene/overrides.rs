//! Overrides `--set key.path=value`, applied to a scene's table before its check.

use std::path::Path;

use toml::{Table, Value};

use super::check::PathStep;
use super::{DEFAULT_MATERIAL, Driver, Geometry, Kind, SlabFace, TermSpec};
use crate::base::{Error, InputError, Result};

/// Applies one override. Lists are indexed by number, by `name`, or by `*` for every entry; missing tables are created.
/// The value is TOML, or else a bare text. A new `kind` drops the keys that only the old kind has. A `path` turns an
/// analytic BRDF into a measured one; the file's extension selects its kind.
pub fn apply(root: &mut Table, text: &str) -> Result<()> {
    let place = || format!("--set {text}");
    let (keys, value) = split(text).ok_or_else(|| InputError::new(place(), format!("`{text}`"), "key.path=value"))?;
    set(root, &keys, value, place)
}

/// Applies one override whose value is not a text. Errors name the key.
pub fn apply_value(root: &mut Table, key: &str, value: Value) -> Result<()> {
    let place = || key.to_owned();
    let keys = split_key(key).ok_or_else(|| InputError::new(place(), format!("`{key}`"), "key.path"))?;
    set(root, &keys, value, place)
}

fn set(root: &mut Table, keys: &[&str], mut value: Value, place: impl Fn() -> String) -> Result<()> {
    absolutize(keys.last().copied().unwrap_or_default(), &mut value);
    set_in_table(root, keys, &value).map_err(|(found, expected, hint)| {
        let error = InputError::new(place(), found, expected);
        Error::from(match hint {
            Some(hint) => error.with_hint(hint),
            None => error,
        })
    })
}

/// Returns true if this override sets the place of a problem, a part of it, or a table that contains it.
pub fn touches(text: &str, path: &[PathStep]) -> bool {
    let Some((keys, _)) = split(text) else {
        return false;
    };
    !path.is_empty()
        && keys.iter().zip(path).all(|(key, step)| match step {
            PathStep::Key(name) => name == key,
            PathStep::Entry(index, name) => *key == "*" || key.parse() == Ok(*index) || name.as_deref() == Some(*key),
        })
}

fn split(text: &str) -> Option<(Vec<&str>, Value)> {
    let (key, value) = text.split_once('=')?;
    Some((split_key(key)?, parse_value(value.trim())))
}

/// The parts of a key; `None` if one is empty.
pub(super) fn split_key(key: &str) -> Option<Vec<&str>> {
    let keys: Vec<&str> = key.trim().split('.').map(str::trim).collect();
    keys.iter().all(|key| !key.is_empty()).then_some(keys)
}

fn parse_value(text: &str) -> Value {
    let parsed = toml::from_str::<Table>(&format!("value = {text}")).ok().filter(|table| table.len() == 1);
    parsed.and_then(|mut table| table.remove("value")).unwrap_or_else(|| Value::String(text.to_owned()))
}

/// Makes paths absolute that exist relative to the working directory; other paths are relative to the scene's folder.
fn absolutize(key: &str, value: &mut Value) {
    match value {
        Value::String(text) if matches!(key, "path" | "color_path" | "slot_path" | "environment" | "scene") => {
            let path = Path::new(text.as_str());
            if path.is_relative()
                && path.is_file()
                && let Ok(absolute) = std::path::absolute(path)
                && let Some(absolute) = absolute.to_str()
            {
                *text = absolute.to_owned();
            }
        }
        Value::Table(table) => table.iter_mut().for_each(|(key, value)| absolutize(key, value)),
        Value::Array(values) => values.iter_mut().for_each(|value| absolutize(key, value)),
        _ => {}
    }
}

/// An error as found text, expected text and hint.
type OverrideError = (String, String, Option<String>);

fn set_in_table(table: &mut Table, keys: &[&str], value: &Value) -> std::result::Result<(), OverrideError> {
    let Some((&key, rest)) = keys.split_first() else {
        return Ok(());
    };
    if rest.is_empty() {
        if key == "kind" {
            drop_keys_of_other_kinds(table, value);
        }
        table.insert(key.to_owned(), value.clone());
        return Ok(());
    }
    if key == "brdf"
        && let [field @ ("kind" | "path")] = rest
    {
        return set_brdf_file_or_kind(table, field, value);
    }
    let missing = || {
        if key == "material" { Value::Array(Vec::new()) } else { Value::Table(Table::new()) }
    };
    set_in_value(table.entry(key).or_insert_with(missing), rest, value)
}

fn set_in_value(place: &mut Value, keys: &[&str], value: &Value) -> std::result::Result<(), OverrideError> {
    match place {
        Value::Table(table) => set_in_table(table, keys, value),
        Value::Array(entries) => set_in_list(entries, keys, value),
        other => {
            Err((format!("a {}", other.type_str()), format!("a table that could hold `{}`", keys.join(".")), None))
        }
    }
}

fn set_in_list(entries: &mut Vec<Value>, keys: &[&str], value: &Value) -> std::result::Result<(), OverrideError> {
    let Some((&key, rest)) = keys.split_first() else {
        return Ok(());
    };
    let set = |entry: &mut Value| {
        if rest.is_empty() {
            *entry = value.clone();
            return Ok(());
        }
        set_in_value(entry, rest, value)
    };
    if key == "*" {
        // A material without a BRDF has that of `default`, which is changed as well.
        let is_default = |entry: &Value| entry.get("name").and_then(Value::as_str) == Some(DEFAULT_MATERIAL);
        let inherits = entries.iter().any(|entry| is_default(entry) && entry.get("brdf").is_some());
        let skips = |entry: &Value| {
            inherits && rest.len() > 1 && rest[0] == "brdf" && entry.is_table() && entry.get("brdf").is_none()
        };
        return entries.iter_mut().filter(|entry| !skips(entry)).try_for_each(set);
    }
    let count = entries.len();
    if let Ok(index) = key.parse::<usize>() {
        let expected =
            if count == 0 { "a list with entries".to_owned() } else { format!("an index from 0 to {}", count - 1) };
        return set(entries.get_mut(index).ok_or_else(|| (format!("index {index}"), expected, None))?);
    }
    let name_of = |entry: &Value| entry.get("name").and_then(Value::as_str).map(str::to_owned);
    if let Some(entry) = entries.iter_mut().find(|entry| name_of(entry).as_deref() == Some(key)) {
        return set(entry);
    }
    // A name similar to an existing one is a typing error; any other name creates a new material. `paint_1` and `paint_2`
    // are two names.
    let names: Vec<String> = entries.iter().filter_map(name_of).collect();
    let is_typing_error = |name: &&String| {
        let [text, other] =
            [name.as_str(), key].map(|name| name.trim_end_matches(|letter: char| letter.is_ascii_digit()));
        (text != other || text.len() == name.len().min(key.len())) && strsim::damerau_levenshtein(name, key) <= 2
    };
    if let Some(name) = names.iter().find(is_typing_error) {
        return Err((
            format!("`{key}`"),
            format!("one of {}", names.join(", ")),
            Some(format!("did you mean `{name}`?")),
        ));
    }
    if !entries.iter().all(Value::is_table) || names.len() < count {
        return Err((format!("`{key}`"), format!("an index from 0 to {}, or `*` for all", count - 1), None));
    }
    let mut entry = Value::Table(Table::from_iter([("name".to_owned(), Value::String(key.to_owned()))]));
    set(&mut entry)?;
    entries.push(entry);
    Ok(())
}

/// Removes the keys that only the table's old kind has, because they would be unknown keys of the new kind.
fn drop_keys_of_other_kinds(table: &mut Table, kind: &Value) {
    let find = |kinds: Vec<Kind>, name: &str| kinds.into_iter().find(|kind| kind.kind == name);
    for kinds in [Geometry::kinds, TermSpec::kinds, SlabFace::kinds, Driver::kinds] {
        let old = table.get("kind").and_then(Value::as_str).and_then(|name| find(kinds(), name));
        let new = kind.as_str().and_then(|name| find(kinds(), name));
        if let (Some(old), Some(new)) = (old, new) {
            table.retain(|key, _| {
                let is_in = |kind: &Kind| kind.fields.iter().any(|field| field.key == key);
                is_in(&new) || !is_in(&old)
            });
        }
    }
}

/// Sets `brdf.kind` or `brdf.path`, which apply to a whole BRDF: a sum of terms becomes one term, and an analytic term
/// with a path becomes a measured one.
fn set_brdf_file_or_kind(material: &mut Table, field: &str, value: &Value) -> std::result::Result<(), OverrideError> {
    let brdf = material.entry("brdf").or_insert_with(|| Value::Table(Table::new()));
    if !brdf.is_table() {
        *brdf = Value::Table(Table::new());
    }
    let Value::Table(table) = brdf else {
        return Ok(());
    };
    if field == "path" {
        let measured = table.get("kind").and_then(Value::as_str).is_some_and(is_measured);
        let ending = value.as_str().and_then(|path| Path::new(path).extension()).and_then(|ending| ending.to_str());
        let by_ending = match ending {
            Some("bsdf") => Some("rgl"),
            Some("binary") => Some("merl"),
            _ if measured => None,
            Some("bin") => Some("utia"),
            Some("npz") => Some("npz"),
            _ => Some("merl"),
        };
        if let Some(kind) = by_ending {
            let kind = Value::String(kind.to_owned());
            drop_keys_of_other_kinds(table, &kind);
            table.insert("kind".to_owned(), kind);
        }
    } else {
        drop_keys_of_other_kinds(table, value);
    }
    table.insert(field.to_owned(), value.clone());
    Ok(())
}

/// Returns true for the kinds of BRDF that read a file.
fn is_measured(kind: &str) -> bool {
    let reads_file = |term: &Kind| term.fields.iter().any(|field| field.key == "path");
    TermSpec::kinds().iter().any(|term| term.kind == kind && reads_file(term))
}
