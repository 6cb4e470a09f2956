//! All keys of a scene in one list, each with its value and its entry in the catalogue.

use serde::Serialize;
use toml::{Table, Value};

use super::load::shortest;
use super::{Field, FieldShape, Scene};
use crate::base::Result;

/// A key of a scene, as `--set` takes it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KeyEntry {
    /// `tile.geometry.depth`, `material.sides.brdf.roughness`.
    pub key: String,
    /// Unit such as `tile units` or `degrees`, or empty.
    pub unit: &'static str,
    /// Type of the value: `number`, `integer`, `color`, `vector`, `bool`, `text`, `path`, `choice`, `list`, `stops`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Smallest and largest number.
    pub range: Option<[f64; 2]>,
    /// The names that the value may have.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub choices: Option<Vec<&'static str>>,
    /// Default of a numeric key.
    pub default: Option<f64>,
    pub doc: &'static str,
    /// Value in the scene; absent if an optional key is not set.
    pub value: Option<Value>,
}

/// The keys that apply to a scene, in the order of the catalogue. Tables with a `kind` list the keys of their own kind.
///
/// # Errors
/// The scene has no form as TOML.
pub fn keys_of(scene: &Scene) -> Result<Vec<KeyEntry>> {
    let mut entries = Vec::new();
    of_table(&scene.to_short_table()?, &Scene::fields(), "", &mut entries);
    Ok(entries)
}

fn of_table(table: &Table, fields: &[Field], path: &str, out: &mut Vec<KeyEntry>) {
    for field in fields {
        let key = if path.is_empty() { field.key.to_owned() } else { format!("{path}.{}", field.key) };
        of_value(table.get(field.key), &field.shape, key, field, out);
    }
}

fn of_value(value: Option<&Value>, shape: &FieldShape, key: String, field: &Field, out: &mut Vec<KeyEntry>) {
    match (shape, value) {
        (FieldShape::Table(fields), value) => {
            // A table that is not set has keys as well.
            let empty = Table::new();
            of_table(value.and_then(Value::as_table).unwrap_or(&empty), &fields(), &key, out);
        }
        (FieldShape::Tagged(kinds), Some(Value::Table(table))) => {
            let kinds = kinds();
            let names: Vec<&'static str> = kinds.iter().map(|kind| kind.kind).collect();
            let value = table.get("kind").cloned();
            let tag = value.as_ref().and_then(Value::as_str).and_then(|tag| kinds.iter().find(|kind| kind.kind == tag));
            let kind_key = format!("{key}.kind");
            let doc = tag.map_or(field.doc, |tag| tag.doc);
            let fields = tag.map(|tag| tag.fields.clone()).unwrap_or_default();
            let choices = Some(names);
            let (unit, range, default, kind) = ("", None, None, "choice");
            out.push(KeyEntry { key: kind_key, unit, kind, range, choices, default, doc, value });
            of_table(table, &fields, &key, out);
        }
        (FieldShape::List { of, .. }, Some(Value::Array(entries))) if is_table(of) => {
            for (index, entry) in entries.iter().enumerate() {
                // A dot would divide a name, and a number is an index.
                let is_key = |name: &&str| !name.contains('.') && name.parse::<usize>().is_err() && *name != "*";
                let name = entry.get("name").and_then(Value::as_str).filter(is_key);
                let key = name.map_or_else(|| format!("{key}.{index}"), |name| format!("{key}.{name}"));
                of_value(Some(entry), of, key, field, out);
            }
        }
        (FieldShape::AnyOf(shapes), Some(value)) if value.is_table() || holds_tables(value) => {
            match shapes.iter().find(|shape| is_table(shape) == value.is_table()) {
                Some(shape) => of_value(Some(value), shape, key, field, out),
                None => out.push(leaf(key, field, shape, Some(value))),
            }
        }
        _ => out.push(leaf(key, field, shape, value)),
    }
}

fn is_table(shape: &FieldShape) -> bool {
    matches!(shape, FieldShape::Table(_) | FieldShape::Tagged(_))
}

fn holds_tables(value: &Value) -> bool {
    value.as_array().is_some_and(|entries| entries.iter().any(Value::is_table))
}

fn leaf(key: String, field: &Field, shape: &FieldShape, value: Option<&Value>) -> KeyEntry {
    // The first alternative describes the others.
    let mut shape = shape;
    while let FieldShape::AnyOf([first, ..]) = shape {
        shape = first;
    }
    let (kind, range, choices) = match *shape {
        FieldShape::Number { min, max, .. } => ("number", Some([min, max]), None),
        FieldShape::Integer { min, max } => ("integer", Some([min as f64, max as f64]), None),
        FieldShape::Color { max } => ("color", Some([0.0, max]), None),
        FieldShape::Vector { min, max, .. } => ("vector", Some([min, max]), None),
        FieldShape::Bool => ("bool", None, None),
        FieldShape::Text => ("text", None, None),
        FieldShape::Path => ("path", None, None),
        FieldShape::Choice(names) => ("choice", None, Some(names.to_vec())),
        FieldShape::Stops { max_color } => ("stops", Some([0.0, max_color]), None),
        FieldShape::Table(_) | FieldShape::Tagged(_) => ("table", None, None),
        FieldShape::List { .. } | FieldShape::AnyOf(_) => ("list", None, None),
    };
    let Field { unit, doc, .. } = *field;
    let default = field.default.map(shortest);
    KeyEntry { key, unit, kind, range, choices, default, doc, value: value.cloned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, shipped};

    #[test]
    fn every_number_in_the_list_is_in_its_range_and_can_be_set_by_its_key() {
        for name in shipped::names() {
            let mut editable = scene::EditableScene::open(name).unwrap();
            let entries = keys_of(&editable.loaded().scene).unwrap();
            let before = editable.to_toml().unwrap();
            let mut numbers = 0;
            for KeyEntry { key, kind, range, value, .. } in entries {
                let Some(value) = value else { continue };
                if let (Some([min, max]), "number", Some(number)) = (range, kind, value.as_float()) {
                    assert!((min..=max).contains(&number), "{name}: {key}");
                    editable.set(&[(key.clone(), value)]).unwrap_or_else(|error| panic!("{name}: {key}: {error}"));
                    numbers += 1;
                }
            }
            assert!(numbers > 0, "{name}");
            assert_eq!(editable.to_toml().unwrap(), before, "{name}");
        }
    }

    #[test]
    fn the_list_names_materials_and_states_units() {
        let entries = keys_of(&scene::open("default", &[]).unwrap().scene).unwrap();
        let find = |key: &str| entries.iter().find(|entry| entry.key == key).unwrap_or_else(|| panic!("{key}"));
        assert_eq!(find("tile.geometry.kind").value, Some(Value::String("grooves".into())));
        assert_eq!(find("tile.geometry.depth").unit, "tile units");
        assert_eq!(find("material.default.brdf.roughness").kind, "number");
        assert_eq!(find("camera.exposure_ev").kind, "number");
        assert_eq!(find("material.default.brdf.roughness").default, Some(0.3));
    }
}
