//! What an edit is called: the first place in which two scenes differ, in words.

use crate::scene::Scene;
use toml::{Table, Value};

/// The name of the edit from `old` to `new`: `Depth`, `Roughness of "sides"`, `Turn the view`.
pub fn name_of_edit(old: &Scene, new: &Scene) -> String {
    if old.camera != new.camera {
        return "Move the view".to_owned();
    }
    if old.tile.geometry.kind() != new.tile.geometry.kind() {
        return format!("Change surface to {}", new.tile.geometry.kind());
    }
    if old.materials.len() != new.materials.len() {
        return if old.materials.len() < new.materials.len() { "Add a material" } else { "Remove a material" }
            .to_owned();
    }
    let tables = (Table::try_from(old), Table::try_from(new));
    let (Ok(old), Ok(new)) = tables else { return "Edit".to_owned() };
    let mut path = Vec::new();
    difference(&Value::Table(old), &Value::Table(new), &mut path);
    words(&path)
}

/// Goes down to the first difference; entries of lists are called by their `name`.
fn difference(old: &Value, new: &Value, path: &mut Vec<String>) {
    match (old, new) {
        (Value::Table(old), Value::Table(new)) => {
            let keys = old.keys().chain(new.keys().filter(|key| !old.contains_key(*key)));
            for key in keys {
                match (old.get(key), new.get(key)) {
                    (Some(a), Some(b)) if a == b => {}
                    (Some(a), Some(b)) => {
                        path.push(key.clone());
                        return difference(a, b, path);
                    }
                    _ => return path.push(key.clone()),
                }
            }
        }
        (Value::Array(old), Value::Array(new)) if old.len() == new.len() => {
            let found = old.iter().zip(new).find(|(a, b)| a != b);
            if let Some((a, b)) = found
                && b.is_table()
            {
                if let Some(name) = b.get("name").and_then(Value::as_str) {
                    path.push(format!("\"{name}\""));
                }
                difference(a, b, path);
            }
        }
        _ => {}
    }
}

fn words(path: &[String]) -> String {
    let Some(last) = path.iter().rev().find(|step| !step.starts_with('"')) else {
        return "Edit".to_owned();
    };
    let mut caption = last.trim_end_matches("_deg").replace('_', " ");
    if caption == "kind" {
        caption = match path.iter().rev().nth(1).map(String::as_str) {
            Some("object") => "object".to_owned(),
            _ => "BRDF model".to_owned(),
        };
    }
    if let Some(first) = caption.get_mut(0..1) {
        first.make_ascii_uppercase();
    }
    match path.iter().find(|step| step.starts_with('"')) {
        Some(name) => format!("{caption} of {name}"),
        None => caption,
    }
}
