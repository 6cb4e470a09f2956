//! Names of history entries: the first setting in which two scenes differ.

use crate::base::capitalized;
use crate::scene::Scene;
use toml::{Table, Value};

/// Returns the name of the edit from `old` to `new`: `Depth`, `Roughness of "sides"`, `Move the view`.
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
    first_difference(&Value::Table(old), &Value::Table(new), &mut path);
    caption_of(&path)
}

/// Appends the path of the first difference. List entries appear by their `name`.
fn first_difference(old: &Value, new: &Value, path: &mut Vec<String>) {
    match (old, new) {
        (Value::Table(old), Value::Table(new)) => {
            // Another kind has other keys.
            if old.get("kind").zip(new.get("kind")).is_some_and(|(old, new)| old != new) {
                return path.push("kind".to_owned());
            }
            let keys = old.keys().chain(new.keys().filter(|key| !old.contains_key(*key)));
            for key in keys {
                match (old.get(key), new.get(key)) {
                    (Some(a), Some(b)) if a == b => {}
                    (Some(a), Some(b)) => {
                        path.push(key.clone());
                        return first_difference(a, b, path);
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
                first_difference(a, b, path);
            }
        }
        _ => {}
    }
}

fn caption_of(path: &[String]) -> String {
    let Some(last) = path.iter().rev().find(|step| !step.starts_with('"')) else {
        return "Edit".to_owned();
    };
    let mut caption = last.trim_end_matches("_deg").replace('_', " ");
    if caption == "kind" {
        caption = match path.iter().rev().nth(1).map(String::as_str) {
            Some(part @ ("object" | "driver" | "background")) => part.to_owned(),
            Some(side @ ("top" | "bottom")) => format!("{side} face"),
            _ => "BRDF model".to_owned(),
        };
    }
    let caption = capitalized(&caption);
    match path.iter().find(|step| step.starts_with('"')) {
        Some(name) => format!("{caption} of {name}"),
        None => caption,
    }
}
