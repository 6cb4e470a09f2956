//! The keys in which two scenes differ, as assignments that turn one into the other.

use toml::{Table, Value};

use super::{Scene, load_with_overrides};

/// The keys and values that turn `base` into `edited`, as `--set` takes them. `None` if no assignments do so, as after
/// a key was removed or a material was added.
pub fn assignments(base: &Scene, edited: &Scene) -> Option<Vec<(String, Value)>> {
    let (before, after) = (base.to_short_table().ok()?, edited.to_short_table().ok()?);
    let mut found = Vec::new();
    compare_tables("", &before, &after, &mut found)?;
    let overrides: Vec<String> = found.iter().map(|(key, value)| format!("{key}={value}")).collect();
    let again = load_with_overrides(&base.to_toml().ok()?, &overrides).ok()?;
    (again == *edited).then_some(found)
}

/// Adds the differences of two tables at `path`, which ends in a dot unless it is empty.
fn compare_tables(path: &str, before: &Table, after: &Table, found: &mut Vec<(String, Value)>) -> Option<()> {
    if before.keys().any(|key| !after.contains_key(key)) {
        return None;
    }
    for (key, value) in after {
        let key = format!("{path}{key}");
        match (before.get(key.rsplit('.').next()?), value) {
            (Some(old), new) if old == new => {}
            // A table of another kind has other keys.
            (Some(Value::Table(old)), Value::Table(new)) if old.get("kind") == new.get("kind") => {
                let mut inside = Vec::new();
                match compare_tables(&format!("{key}."), old, new, &mut inside) {
                    Some(()) => found.append(&mut inside),
                    None => found.push((key, value.clone())),
                }
            }
            (Some(Value::Array(old)), Value::Array(new)) if is_named(old) && is_named(new) => {
                compare_named(&key, old, new, found)?;
            }
            _ => found.push((key, value.clone())),
        }
    }
    Some(())
}

/// The name of an entry of an array of tables such as `[[material]]`.
fn name(entry: &Value) -> Option<&str> {
    entry.as_table()?.get("name")?.as_str()
}

fn is_named(entries: &[Value]) -> bool {
    !entries.is_empty() && entries.iter().all(|entry| name(entry).is_some())
}

/// Adds the differences of entries that a path names, as in `material.default.color`.
fn compare_named(path: &str, before: &[Value], after: &[Value], found: &mut Vec<(String, Value)>) -> Option<()> {
    let names = |entries: &[Value]| entries.iter().map(|entry| name(entry).map(str::to_owned)).collect::<Vec<_>>();
    if names(before) != names(after) {
        return None;
    }
    for (old, new) in before.iter().zip(after) {
        compare_tables(&format!("{path}.{}.", name(new)?), old.as_table()?, new.as_table()?, found)?;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, parse};

    const BASE: &str = "[tile]\ngeometry = { kind = \"grooves\", count = 4, depth = 0.2 }\n[[material]]\nname = \"default\"\n\
                        brdf = { kind = \"ggx\", roughness = 0.2, f0 = [0.9, 0.6, 0.3] }\n[[material]]\nname = \"bottom\"\ncolor = [0.1, 0.8, 0.2]\n";

    #[test]
    fn assignments_name_the_changed_keys_and_nothing_else() {
        let base = parse(BASE).unwrap();
        assert_eq!(assignments(&base, &base), Some(Vec::new()));
        let edited =
            parse(&BASE.replace("depth = 0.2", "depth = 0.35").replace("roughness = 0.2", "roughness = 0.1")).unwrap();
        let keys: Vec<(String, String)> =
            assignments(&base, &edited).unwrap().into_iter().map(|(key, value)| (key, value.to_string())).collect();
        let expected = [("material.default.brdf.roughness", "0.1"), ("tile.geometry.depth", "0.35")];
        let expected: Vec<(String, String)> = expected.map(|(key, value)| (key.to_owned(), value.to_owned())).to_vec();
        let mut sorted = keys;
        sorted.sort();
        assert_eq!(sorted, expected);
    }

    #[test]
    fn another_kind_of_surface_is_one_assignment_and_another_material_is_none() {
        let base = parse(BASE).unwrap();
        let mut edited = base.clone();
        edited.tile.geometry = Geometry::with_defaults("pyramids").unwrap();
        let found = assignments(&base, &edited).unwrap();
        assert_eq!(found.iter().map(|(key, _)| key.as_str()).collect::<Vec<_>>(), ["tile.geometry"]);
        let mut fewer = base.clone();
        fewer.materials.pop();
        assert_eq!(assignments(&base, &fewer), None);
    }
}
