//! `--set key.path=value`: changes to a scene's table before it is checked.

use std::path::Path;

use toml::{Table, Value};

use super::check::Step;
use super::{Geometry, Kind, TermSpec};
use crate::base::{Error, InputError, Result};

/// Applies one override. Lists are indexed by number, by `name`, or by `*` for every entry; missing tables are made.
/// The value is TOML, or else a bare text. A new `kind` drops the keys that only the old kind had; a `path` set on a
/// BRDF without files makes it a measured one, by the file's ending.
pub fn apply(root: &mut Table, text: &str) -> Result<()> {
    let (keys, mut value) = split(text)?;
    absolutize(keys.last().copied().unwrap_or_default(), &mut value);
    set_in_table(root, &keys, &value).map_err(|(found, expected, hint)| {
        let error = InputError::new(format!("--set {text}"), found, expected);
        Error::from(match hint {
            Some(hint) => error.with_hint(hint),
            None => error,
        })
    })
}

/// Did this override set the place of a problem, something in it, or something around it?
pub fn touches(text: &str, path: &[Step]) -> bool {
    let Ok((keys, _)) = split(text) else {
        return false;
    };
    !path.is_empty()
        && keys.iter().zip(path).all(|(key, step)| match step {
            Step::Key(name) => name == key,
            Step::Entry(index, name) => *key == "*" || key.parse() == Ok(*index) || name.as_deref() == Some(*key),
        })
}

fn split(text: &str) -> Result<(Vec<&str>, Value)> {
    let complain = || InputError::new(format!("--set {text}"), format!("`{text}`"), "key.path=value");
    let (key, value) = text.split_once('=').ok_or_else(complain)?;
    let keys: Vec<&str> = key.trim().split('.').map(str::trim).collect();
    if keys.iter().any(|key| key.is_empty()) {
        return Err(complain().into());
    }
    Ok((keys, parse_value(value.trim())))
}

fn parse_value(text: &str) -> Value {
    let parsed = toml::from_str::<Table>(&format!("value = {text}")).ok().filter(|table| table.len() == 1);
    parsed.and_then(|mut table| table.remove("value")).unwrap_or_else(|| Value::String(text.to_owned()))
}

/// Files named on the command line are found from where the command runs, not only from the scene's folder.
fn absolutize(key: &str, value: &mut Value) {
    match value {
        Value::String(text) if matches!(key, "path" | "color_path" | "slot_path" | "environment") => {
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

/// What was found, what was expected, and a hint.
type Complaint = (String, String, Option<String>);

fn set_in_table(table: &mut Table, keys: &[&str], value: &Value) -> std::result::Result<(), Complaint> {
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

fn set_in_value(place: &mut Value, keys: &[&str], value: &Value) -> std::result::Result<(), Complaint> {
    match place {
        Value::Table(table) => set_in_table(table, keys, value),
        Value::Array(entries) => set_in_list(entries, keys, value),
        other => {
            Err((format!("a {}", other.type_str()), format!("a table that could hold `{}`", keys.join(".")), None))
        }
    }
}

fn set_in_list(entries: &mut Vec<Value>, keys: &[&str], value: &Value) -> std::result::Result<(), Complaint> {
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
        return entries.iter_mut().try_for_each(set);
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
    // A name close to one that is there is a slip; any other is a new material.
    let names: Vec<String> = entries.iter().filter_map(name_of).collect();
    if let Some(name) = names.iter().find(|name| strsim::damerau_levenshtein(name, key) <= 2) {
        return Err((
            format!("`{key}`"),
            format!("one of {}", names.join(", ")),
            Some(format!("did you mean `{name}`?")),
        ));
    }
    if !entries.iter().all(Value::is_table) {
        return Err((format!("`{key}`"), "an index".to_owned(), None));
    }
    let mut entry = Value::Table(Table::from_iter([("name".to_owned(), Value::String(key.to_owned()))]));
    set(&mut entry)?;
    entries.push(entry);
    Ok(())
}

/// Where a table changes its kind, keys of the old kind would be unknown to the new one.
fn drop_keys_of_other_kinds(table: &mut Table, kind: &Value) {
    let find = |kinds: Vec<Kind>, name: &str| kinds.into_iter().find(|kind| kind.kind == name);
    for kinds in [Geometry::kinds, TermSpec::kinds] {
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

/// `brdf.kind` and `brdf.path` apply to a whole BRDF: a sum of terms becomes one term, an analytic one a measured one.
fn set_brdf_file_or_kind(material: &mut Table, field: &str, value: &Value) -> std::result::Result<(), Complaint> {
    let brdf = material.entry("brdf").or_insert_with(|| Value::Table(Table::new()));
    if !brdf.is_table() {
        *brdf = Value::Table(Table::new());
    }
    let Value::Table(table) = brdf else {
        return Ok(());
    };
    if field == "path" {
        let measured = matches!(table.get("kind").and_then(Value::as_str), Some("merl" | "rgl"));
        let ending = value.as_str().and_then(|path| Path::new(path).extension()).and_then(|ending| ending.to_str());
        let by_ending = match ending {
            Some("bsdf") => Some("rgl"),
            Some("binary") => Some("merl"),
            _ if measured => None,
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
