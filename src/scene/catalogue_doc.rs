//! The part of `docs/guide/scene-format.md` that lists all keys, generated from the catalogue.
//!
//! `BISCALE_BLESS=1 cargo test --lib catalogue_doc` writes that part again.

use std::fmt::Write as _;
use std::path::Path;

use toml::{Table, Value};

use super::*;

const BEGIN: &str = "<!-- catalogue:begin -->\n";
const END: &str = "<!-- catalogue:end -->";

#[test]
fn the_guide_lists_the_keys_of_the_catalogue() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/guide/scene-format.md");
    let text = std::fs::read_to_string(&path).unwrap().replace("\r\n", "\n");
    let (head, rest) = text.split_once(BEGIN).unwrap();
    let (listed, tail) = rest.split_once(END).unwrap();
    let mut generated = String::new();
    write_table(&mut generated, "", "[top level]", &Scene::fields());
    let generated = generated.trim_start_matches('\n');
    if std::env::var_os("BISCALE_BLESS").is_some_and(|value| value == "1") {
        std::fs::write(&path, format!("{head}{BEGIN}{generated}{END}{tail}")).unwrap();
        return;
    }
    let different = generated.lines().zip(listed.lines()).find(|(new, old)| new != old);
    assert!(generated == listed, "BISCALE_BLESS=1 updates {}; the first difference: {different:?}", path.display());
}

/// Writes the table of `fields`, then the tables that the fields contain.
fn write_table(out: &mut String, path: &str, heading: &str, fields: &[Field]) {
    let _ = write!(out, "\n### {heading}\n");
    write_rows(out, fields, &defaults(path, None));
    for field in fields {
        let inner = if path.is_empty() { field.key.to_owned() } else { format!("{path}.{}", field.key) };
        write_shape(out, &inner, field.shape, false);
    }
}

/// Writes the tables that a value of this shape contains.
fn write_shape(out: &mut String, path: &str, shape: FieldShape, is_entry: bool) {
    match shape {
        FieldShape::Table(fields) if is_entry => write_table(out, path, &format!("[[{path}]]"), &fields()),
        FieldShape::Table(fields) => write_table(out, path, &format!("[{path}]"), &fields()),
        FieldShape::Tagged(kinds) => {
            for Kind { kind, doc, fields } in kinds() {
                let _ = write!(out, "\n### [{path}] kind = \"{kind}\"\n\n{doc}\n");
                write_rows(out, &fields, &defaults(path, Some(kind)));
            }
        }
        FieldShape::List { of, .. } => write_shape(out, path, *of, true),
        FieldShape::AnyOf([first, ..]) => write_shape(out, path, *first, is_entry),
        _ => {}
    }
}

fn write_rows(out: &mut String, fields: &[Field], defaults: &Table) {
    if fields.is_empty() {
        out.push_str("\nThere are no keys.\n");
        return;
    }
    out.push_str("\n| key | kind | range | default | meaning |\n|---|---|---|---|---|\n");
    for field in fields {
        let (kind, range) = kind_and_range(field.shape, field.unit);
        let default = match defaults.get(field.key) {
            _ if field.required => "required".to_owned(),
            Some(value) => default_text(value),
            None => String::new(),
        };
        let _ = writeln!(out, "| `{}` | {kind} | {range} | {default} | {} |", field.key, field.doc);
    }
}

/// Default values of a table, by key.
fn defaults(path: &str, kind: Option<&str>) -> Table {
    let of = |table: std::result::Result<Table, toml::ser::Error>| table.unwrap();
    match (path, kind) {
        ("", _) => Table::from_iter([("version".to_owned(), Value::Integer(1))]),
        ("tile", _) => of(Table::try_from(Tile::of(Geometry::Flat(Flat::default())))),
        ("tile.geometry", Some(kind)) => of(Table::try_from(Geometry::with_defaults(kind).unwrap())),
        ("material", _) => of(Table::try_from(toml::from_str::<MaterialSpec>("name = \"a\"").unwrap())),
        ("material.brdf", Some(kind)) => {
            let fields = TermSpec::kinds().into_iter().find(|known| known.kind == kind).unwrap().fields;
            let required = fields.iter().filter(|field| field.required).map(|field| (field.key, "file"));
            let mut table = Table::from_iter([("kind".to_owned(), Value::String(kind.to_owned()))]);
            table.extend(required.map(|(key, value)| (key.to_owned(), Value::String(value.to_owned()))));
            of(Table::try_from(table.try_into::<TermSpec>().unwrap()))
        }
        ("object", _) => of(Table::try_from(Object::default())),
        ("light", _) => of(Table::try_from(Light::default())),
        ("light.directional", _) => Table::new(),
        ("camera", _) => of(Table::try_from(Camera::default())),
        ("color_map", _) => of(Table::try_from(ColorMap::default())),
        ("color_map.surface", _) => of(Table::try_from(GaussianSurface::default())),
        ("color_map.layer", _) => Table::from_iter([
            ("unit".to_owned(), Value::String("deviation".to_owned())),
            ("weight".to_owned(), Value::Float(1.0)),
        ]),
        ("color_map.layer.driver", Some(kind)) | ("color_map.layer.driver.terms.driver", Some(kind)) => match kind {
            "texture" => of(Table::try_from(TextureDriver::default())),
            "noise" => of(Table::try_from(NoiseDriver::default())),
            "height" => of(Table::try_from(HeightDriver::default())),
            "slope" => of(Table::try_from(SlopeAlong::default())),
            _ => Table::new(),
        },
        ("quality", _) => of(Table::try_from(Quality::default())),
        ("effects", _) => of(Table::try_from(Effects::default())),
        ("slab", _) => of(Table::try_from(SlabSpec::default())),
        ("slab.top" | "slab.bottom", Some(kind)) => of(Table::try_from(SlabFace::with_defaults(kind).unwrap())),
        ("background", Some(kind)) => of(Table::try_from(Background::with_defaults(kind).unwrap())),
        _ => panic!("no defaults for [{path}]"),
    }
}

/// A default as a scene file writes it; empty for an empty text and for a table.
fn default_text(value: &Value) -> String {
    fn text(value: &Value) -> String {
        match value {
            Value::Float(number) => (*number as f32).to_string(),
            Value::Array(values) => format!("[{}]", values.iter().map(text).collect::<Vec<_>>().join(", ")),
            other => other.to_string(),
        }
    }
    match value {
        Value::Table(_) => String::new(),
        Value::String(empty) if empty.is_empty() => String::new(),
        value => format!("`{}`", text(value)),
    }
}

/// Type and range of a shape, as the table's columns show them.
fn kind_and_range(shape: FieldShape, unit: &str) -> (String, String) {
    let range = |min: f64, max: f64| format!("{min} to {max} {unit}").trim_end().to_owned();
    let (kind, range) = match shape {
        FieldShape::Number { min, max, .. } => ("number", range(min, max)),
        FieldShape::Integer { min, max } => ("integer", format!("{min} to {max} {unit}").trim_end().to_owned()),
        FieldShape::Color { max } => ("colour", range(0.0, max)),
        FieldShape::Vector { length, min, max } => return (format!("{length} numbers"), range(min, max)),
        FieldShape::Bool => ("true or false", String::new()),
        FieldShape::Text => ("text", String::new()),
        FieldShape::Path => ("file", String::new()),
        FieldShape::Choice(names) => {
            ("choice", names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "))
        }
        FieldShape::Stops { max_color } => ("stops", format!("colours from 0 to {max_color}")),
        FieldShape::Table(_) => ("table", String::new()),
        FieldShape::Tagged(_) => ("table", "the kinds below".to_owned()),
        FieldShape::List { of, min, max } => {
            let (kind, inner) = kind_and_range(*of, unit);
            return match *of {
                FieldShape::List { of: value, min: least, max: most } => {
                    let (kind, values) = match *value {
                        FieldShape::Integer { min: 0, max: 1 } => ("integer", "values 0 or 1".to_owned()),
                        value => ("number", format!("values, each {}", kind_and_range(value, unit).1)),
                    };
                    (format!("rows of {kind}s"), format!("{min} to {max} rows of {least} to {most} {values}"))
                }
                _ if min == max => (format!("{min} {kind}s"), inner),
                _ => (format!("list of {kind}s"), format!("{min} to {max} entries")),
            };
        }
        FieldShape::AnyOf(shapes) => {
            let (kinds, ranges): (Vec<_>, Vec<_>) = shapes.iter().map(|shape| kind_and_range(*shape, unit)).unzip();
            let mut distinct: Vec<String> = ranges.into_iter().filter(|range| !range.is_empty()).collect();
            distinct.dedup();
            return (kinds.join(" or "), distinct.join(", or "));
        }
    };
    (kind.to_owned(), range)
}
