//! The open scene as lines of Python that compute its BRDF.

use std::path::Path;

use toml::Value;

use super::document::Document;
use crate::scene::{self, Painted, Scene, assignments};

/// Lines that open the scene of a document, repeat its edits and evaluate its BRDF.
pub fn python_lines(document: &Document) -> String {
    let edited = document.scene();
    let mut lines = vec!["import biscale as bs".to_owned(), String::new()];
    match base(document).and_then(|(name, base)| Some((name, assignments(&base, edited)?))) {
        Some((name, edits)) => {
            lines.push(format!("scene = bs.Scene({})", text(&name)));
            lines.extend(edits.iter().map(|(key, value)| format!("scene[{}] = {}", text(key), python(value))));
        }
        None => lines.push(format!("scene = bs.Scene.parse({})", text(&edited.to_toml().unwrap_or_default()))),
    }
    if *document.painted() != Painted::default() {
        lines.push("# What is painted on the tile is not in these lines: save the scene first.".to_owned());
    }
    lines.push("brdf = scene.effective()".to_owned());
    lines.push("light, viewer = bs.from_angles(0.5, 0.0), bs.from_angles(0.3, 3.14159)  # radians".to_owned());
    lines.push("print(brdf.eval(light, viewer))  # RGB [1/sr], the cosine of the light included".to_owned());
    lines.join("\n") + "\n"
}

/// The scene that the lines open, by its file or its shipped name.
fn base(document: &Document) -> Option<(String, Scene)> {
    let name = match &document.path {
        Some(path) => path.to_str()?.to_owned(),
        None => scene::shipped::names().find(|name| *name == document.name)?.to_owned(),
    };
    let is_there = document.path.as_deref().is_none_or(Path::is_file);
    let loaded = scene::open(&name, &[]).ok().filter(|_| is_there)?;
    Some((name, loaded.scene))
}

/// A text as Python writes it.
fn text(text: &str) -> String {
    // A string of JSON is one of Python.
    serde_json::to_string(text).unwrap_or_default()
}

fn python(value: &Value) -> String {
    match value {
        Value::String(string) => text(string),
        Value::Boolean(true) => "True".to_owned(),
        Value::Boolean(false) => "False".to_owned(),
        Value::Float(number) => format!("{number:?}"),
        Value::Array(values) => format!("[{}]", values.iter().map(python).collect::<Vec<_>>().join(", ")),
        Value::Table(table) => {
            let entries: Vec<String> =
                table.iter().map(|(key, value)| format!("{}: {}", text(key), python(value))).collect();
            format!("{{{}}}", entries.join(", "))
        }
        Value::Integer(_) | Value::Datetime(_) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lines_repeat_the_edits_of_a_shipped_scene() {
        let mut document = Document::open("fig4b_bicolor_cup").unwrap();
        let mut scene = (**document.scene()).clone();
        scene.materials[0].color = glam::Vec3::new(0.5, 0.25, 1.0);
        scene.quality.preset = "draft".to_owned();
        document.edit(scene);
        let name = &document.scene().materials[0].name;
        let expected = format!(
            "import biscale as bs\n\nscene = bs.Scene(\"fig4b_bicolor_cup\")\nscene[\"material.{name}.color\"] = [0.5, 0.25, 1.0]\n\
             scene[\"quality.preset\"] = \"draft\"\nbrdf = scene.effective()\n"
        );
        let lines = python_lines(&document);
        assert!(lines.starts_with(&expected), "{lines}");
    }

    #[test]
    fn a_scene_that_no_edits_describe_is_written_whole() {
        let mut document = Document::open("fig4b_bicolor_cup").unwrap();
        let mut scene = (**document.scene()).clone();
        scene.materials.truncate(1);
        scene.materials[0].name = "default".to_owned();
        document.edit(scene);
        let lines = python_lines(&document);
        let quoted =
            lines.lines().find_map(|line| line.strip_prefix("scene = bs.Scene.parse(")?.strip_suffix(')')).unwrap();
        let parsed: String = serde_json::from_str(quoted).unwrap();
        assert_eq!(crate::scene::parse(&parsed).unwrap(), **document.scene());
    }
}
