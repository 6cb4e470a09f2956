//! Checks a scene's TOML table against the catalogue: unknown keys and kinds, wrong types, values out of range.

use std::fmt::Write as _;

use toml::{Table, Value};

use super::{Field, FieldShape};
use crate::base::InputError;

/// One step into a document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PathStep {
    Key(String),
    /// An entry of a list, with its `name` if it has one.
    Entry(usize, Option<String>),
}

/// The first error in a document.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    pub path: Vec<PathStep>,
    pub found: String,
    pub expected: String,
    pub hint: Option<String>,
    is_unknown_key: bool,
}

impl Problem {
    pub fn new(path: &[PathStep], found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { path: path.to_vec(), found: found.into(), expected: expected.into(), hint: None, is_unknown_key: false }
    }

    /// Adds a hint if the unknown key belongs to the enclosing table. `depth` is the position in the path of the table
    /// with the unknown key, and `fields` are those of the enclosing table.
    fn with_enclosing_table_hint(mut self, fields: &[Field], depth: usize) -> Self {
        if self.is_unknown_key
            && self.path.len() == depth + 1
            && let Some(PathStep::Key(key)) = self.path.last()
            && fields.iter().any(|field| field.key == key)
        {
            let outer = path_text(&self.path[..depth - 1]);
            let place = if outer.is_empty() { "at the top level".to_owned() } else { format!("in `[{outer}]`") };
            self.hint = Some(format!("`{key}` belongs one table up, {place}"));
        }
        self
    }

    /// Converts the problem to an error. `line` is its line in the scene file, if it comes from a file.
    pub fn into_error(self, line: Option<usize>) -> InputError {
        let field = path_text(&self.path);
        let place = match line {
            Some(line) if field.is_empty() => format!("line {line}"),
            Some(line) => format!("line {line}, {field}"),
            None => field,
        };
        let error = InputError::new(place, self.found, self.expected);
        match self.hint {
            Some(hint) => error.with_hint(hint),
            None => error,
        }
    }
}

/// The path as `--set` takes it, such as `material.sides.brdf.roughness`.
pub fn path_text(path: &[PathStep]) -> String {
    let mut text = String::new();
    for step in path {
        if !text.is_empty() {
            text.push('.');
        }
        match step {
            PathStep::Key(key) => text.push_str(key),
            PathStep::Entry(_, Some(name)) => text.push_str(name),
            PathStep::Entry(index, None) => {
                let _ = write!(text, "{index}");
            }
        }
    }
    text
}

/// The candidate most similar to `found`, if its similarity suggests a typing error.
pub fn nearest<'a>(found: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let score = |candidate: &str| strsim::jaro_winkler(&found.to_lowercase(), candidate);
    let best = candidates.into_iter().max_by(|a, b| score(a).total_cmp(&score(b)))?;
    (score(best) > 0.7).then_some(best)
}

fn did_you_mean<'a>(found: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    nearest(found, candidates).map(|name| format!("did you mean `{name}`?"))
}

/// Checks a table against its fields.
pub fn check_table(table: &Table, fields: &[Field], path: &mut Vec<PathStep>) -> Result<(), Problem> {
    check_keys(table, fields, None, path)
}

fn check_keys(table: &Table, fields: &[Field], tag: Option<&str>, path: &mut Vec<PathStep>) -> Result<(), Problem> {
    let known = || tag.into_iter().chain(fields.iter().map(|field| field.key));
    for key in table.keys() {
        if !known().any(|name| name == key) {
            path.push(PathStep::Key(key.clone()));
            let mut problem = Problem::new(path, format!("unknown key `{key}`"), format!("one of {}", list(known())));
            problem.hint = did_you_mean(key, known());
            problem.is_unknown_key = true;
            return Err(problem);
        }
    }
    for field in fields {
        path.push(PathStep::Key(field.key.to_owned()));
        match table.get(field.key) {
            Some(value) => {
                let depth = path.len();
                check_value(value, &field.shape, path)
                    .map_err(|problem| problem.with_enclosing_table_hint(fields, depth))?;
            }
            None if field.required => {
                let mut problem = Problem::new(path, "nothing", format!("`{}`: {}", field.key, field.doc));
                if let Some(tag) = table.get("kind").and_then(Value::as_str) {
                    problem.hint = Some(format!("`{tag}` needs it"));
                }
                return Err(problem);
            }
            None => {}
        }
        path.pop();
    }
    Ok(())
}

fn check_value(value: &Value, shape: &FieldShape, path: &mut Vec<PathStep>) -> Result<(), Problem> {
    match *shape {
        FieldShape::Number { min, max, .. } => check_number(value, min, max, path),
        FieldShape::Integer { min, max } => match value {
            Value::Integer(number) if (min..=max).contains(number) => Ok(()),
            other => Err(Problem::new(path, show(other), format!("a whole number from {min} to {max}"))),
        },
        FieldShape::Color { max } => match value {
            Value::Array(values) if values.len() == 3 => {
                check_entries(values, &FieldShape::Number { min: 0.0, max, soft_max: max }, path)
            }
            Value::Integer(_) | Value::Float(_) => check_number(value, 0.0, max, path),
            other => Err(Problem::new(path, show(other), format!("a number or a triple [r, g, b] from 0 to {max}"))),
        },
        FieldShape::Vector { length, min, max } => match value {
            Value::Array(values) if values.len() == length => {
                check_entries(values, &FieldShape::Number { min, max, soft_max: max }, path)
            }
            other => Err(Problem::new(path, show(other), format!("a list of {length} numbers"))),
        },
        FieldShape::Bool if value.is_bool() => Ok(()),
        FieldShape::Bool => Err(Problem::new(path, show(value), "true or false")),
        FieldShape::Text => check_text(value, "a text", path).map(drop),
        FieldShape::Path => match check_text(value, "a file name", path)? {
            "" => Err(Problem::new(path, "an empty text", "a file name")),
            _ => Ok(()),
        },
        FieldShape::Choice(names) => {
            let expected = format!("one of {}", list(names.iter().copied()));
            let found = check_text(value, &expected, path)?;
            if names.contains(&found) {
                return Ok(());
            }
            let mut problem = Problem::new(path, show(value), expected);
            problem.hint = did_you_mean(found, names.iter().copied());
            Err(problem)
        }
        FieldShape::Stops { max_color } => check_stops(value, max_color, path),
        FieldShape::Table(fields) => match value {
            Value::Table(table) => check_keys(table, &fields(), None, path),
            other => Err(Problem::new(path, show(other), "a table")),
        },
        FieldShape::Tagged(kinds) => {
            let kinds = kinds();
            let names = || kinds.iter().map(|kind| kind.kind);
            let Value::Table(table) = value else {
                return Err(Problem::new(path, show(value), "a table { kind = ..., ... }"));
            };
            path.push(PathStep::Key("kind".to_owned()));
            let expected = format!("one of {}", list(names()));
            let Some(tag) = table.get("kind") else {
                return Err(Problem::new(path, "nothing", expected));
            };
            let tag = check_text(tag, &expected, path)?;
            let Some(kind) = kinds.iter().find(|kind| kind.kind == tag) else {
                let mut problem = Problem::new(path, format!("unknown kind \"{tag}\""), expected);
                problem.hint = did_you_mean(tag, names());
                return Err(problem);
            };
            path.pop();
            check_keys(table, &kind.fields, Some("kind"), path)
        }
        FieldShape::List { of, min, max } => match value {
            Value::Array(values) if (min..=max).contains(&values.len()) => check_entries(values, of, path),
            Value::Array(values) => {
                Err(Problem::new(path, format!("{} entries", values.len()), format!("{min} to {max} entries")))
            }
            other => Err(Problem::new(path, show(other), "a list")),
        },
        FieldShape::AnyOf(shapes) => {
            let fitting = shapes.iter().find(|shape| takes_type(shape, value));
            match fitting.or(shapes.first()) {
                Some(shape) => check_value(value, shape, path),
                None => Ok(()),
            }
        }
    }
}

/// Maximum number of stops of a colour map, and the largest value of a stop.
const MAX_STOPS: usize = 256;
const MAX_STOP: f64 = 1e9;

fn check_stops(value: &Value, max_color: f64, path: &mut Vec<PathStep>) -> Result<(), Problem> {
    let expected = format!("1 to {MAX_STOPS} stops [value, [r, g, b]] of ascending values");
    let stops = match value {
        Value::Array(stops) if (1..=MAX_STOPS).contains(&stops.len()) => stops,
        Value::Array(stops) => return Err(Problem::new(path, format!("{} stops", stops.len()), expected)),
        other => return Err(Problem::new(path, show(other), expected)),
    };
    let mut last = f64::NEG_INFINITY;
    for (index, stop) in stops.iter().enumerate() {
        path.push(PathStep::Entry(index, None));
        let Some([at, color]) = stop.as_array().map(Vec::as_slice) else {
            return Err(Problem::new(path, show(stop), "a stop [value, [r, g, b]]"));
        };
        check_number(at, -MAX_STOP, MAX_STOP, path)?;
        check_value(color, &FieldShape::Color { max: max_color }, path)?;
        let at = at.as_float().or(at.as_integer().map(|at| at as f64)).unwrap_or(f64::NAN);
        if at < last {
            return Err(Problem::new(path, format!("the value {at} after {last}"), "ascending values"));
        }
        last = at;
        path.pop();
    }
    Ok(())
}

fn check_entries(values: &[Value], of: &FieldShape, path: &mut Vec<PathStep>) -> Result<(), Problem> {
    for (index, value) in values.iter().enumerate() {
        let name = value.get("name").and_then(Value::as_str).filter(|name| !name.is_empty());
        path.push(PathStep::Entry(index, name.map(str::to_owned)));
        check_value(value, of, path)?;
        path.pop();
    }
    Ok(())
}

fn check_number(value: &Value, min: f64, max: f64, path: &[PathStep]) -> Result<(), Problem> {
    let number = match value {
        Value::Integer(number) => *number as f64,
        Value::Float(number) => *number,
        other => {
            return Err(Problem::new(path, show(other), format!("a number from {min} to {max}")));
        }
    };
    // Scenes store f32, so a value that rounds to the end of the range is accepted.
    let in_range = number as f32 >= min as f32 && number as f32 <= max as f32;
    if in_range { Ok(()) } else { Err(Problem::new(path, show(value), format!("a number from {min} to {max}"))) }
}

fn check_text<'a>(value: &'a Value, expected: &str, path: &[PathStep]) -> Result<&'a str, Problem> {
    value.as_str().ok_or_else(|| Problem::new(path, show(value), expected))
}

fn takes_type(shape: &FieldShape, value: &Value) -> bool {
    match shape {
        FieldShape::Number { .. } | FieldShape::Integer { .. } => {
            matches!(value, Value::Integer(_) | Value::Float(_))
        }
        FieldShape::Bool => value.is_bool(),
        FieldShape::Text | FieldShape::Path | FieldShape::Choice(_) => value.is_str(),
        FieldShape::Table(_) | FieldShape::Tagged(_) => value.is_table(),
        FieldShape::List { .. } | FieldShape::Vector { .. } | FieldShape::Color { .. } | FieldShape::Stops { .. } => {
            value.is_array()
        }
        FieldShape::AnyOf(shapes) => shapes.iter().any(|shape| takes_type(shape, value)),
    }
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}

/// The value as text for a message; long texts are truncated.
fn show(value: &Value) -> String {
    match value {
        Value::Array(values) => format!("a list of {} entries", values.len()),
        Value::Table(_) => "a table".to_owned(),
        Value::String(text) if text.chars().count() > 60 => {
            format!("\"{}...\"", text.chars().take(60).collect::<String>())
        }
        Value::String(text) => format!("\"{text}\""),
        other => other.to_string(),
    }
}
