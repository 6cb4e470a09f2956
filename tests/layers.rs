//! A module imports only from the layers below it.
#![allow(clippy::unwrap_used, reason = "a test may stop where it stands")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The modules of the library, from the lowest layer to the highest. ARCHITECTURE.md describes them in this order.
const LAYERS: &[&str] = &[
    "base",
    "math",
    "metrics",
    "cache",
    "scene",
    "color_map",
    "brdf",
    "geometry",
    "visibility",
    "interreflection",
    "effective",
    "slab",
    "reference",
    "diagnostics",
    "plan",
    "pipeline",
    "render",
    "gpu",
    "export",
    "fit",
    "tuning",
    "report",
    "cli",
    "app",
];

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Rust files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    found
}

/// Returns true for files that hold only tests, which may use every layer.
fn holds_tests(path: &Path) -> bool {
    let is_test = |name: &str| name == "tests" || name.ends_with("_tests") || name == "testing";
    path.with_extension("").iter().any(|part| is_test(&part.to_string_lossy()))
}

/// The code of a file without comments and without its test modules.
fn library_code(text: &str) -> String {
    let mut code = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line.trim() == "#[cfg(test)]" {
            skip_item(&mut lines);
        } else {
            code.push_str(line.split("//").next().unwrap_or_default());
            code.push('\n');
        }
    }
    code
}

/// Skips the item after `#[cfg(test)]`: to a line that closes its braces or ends it with a semicolon.
fn skip_item<'a>(lines: &mut impl Iterator<Item = &'a str>) {
    let mut depth = 0_i32;
    for line in lines {
        depth += line.matches('{').count() as i32 - line.matches('}').count() as i32;
        let ends = line.trim_end().ends_with(['}', ';', ',']);
        if depth <= 0 && ends {
            return;
        }
    }
}

/// Names that follow `crate::`, also those of a group `crate::{a, b::c}`.
fn imported(code: &str) -> BTreeSet<String> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let first_name = |text: &str| text.trim_start().chars().take_while(|c| is_name(*c)).collect::<String>();
    let mut found = BTreeSet::new();
    for (at, prefix) in code.match_indices("crate::") {
        let rest = &code[at + prefix.len()..];
        let Some(group) = rest.strip_prefix('{') else {
            found.insert(first_name(rest));
            continue;
        };
        let mut depth = 0;
        let mut start = 0;
        for (end, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' | ',' if depth == 0 => {
                    found.insert(first_name(&group[start..]));
                    start = end + 1;
                    if c == '}' {
                        break;
                    }
                }
                '}' => depth -= 1,
                _ => {}
            }
        }
    }
    found
}

#[test]
fn every_module_is_a_layer_and_every_layer_is_a_module() {
    let mut modules: Vec<String> = fs::read_dir(sources())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .filter(|name| name != "testing")
        .collect();
    modules.sort();
    let mut layers: Vec<String> = LAYERS.iter().map(|layer| (*layer).to_owned()).collect();
    layers.sort();
    assert_eq!(modules, layers);
}

#[test]
fn modules_import_only_from_the_layers_below_them() {
    let mut faults = Vec::new();
    for (level, layer) in LAYERS.iter().enumerate() {
        for file in files(&sources().join(layer)) {
            if holds_tests(&file) {
                continue;
            }
            for name in imported(&library_code(&fs::read_to_string(&file).unwrap())) {
                let other = LAYERS.iter().position(|layer| *layer == name);
                if other.is_some_and(|other| other > level) {
                    faults.push(format!("{} imports crate::{name}", file.display()));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_check_finds_an_import_from_a_higher_layer() {
    let code = "use crate::base::Result;\n#[cfg(test)]\nmod tests {\n    use crate::app::run;\n}\nfn f() { crate::gpu::open() } // crate::cli\n";
    let names = imported(&library_code(code));
    assert_eq!(names.into_iter().collect::<Vec<_>>(), ["base", "gpu"]);
    let group = imported("use crate::{base::{A, B}, plan, render::Image};");
    assert!(["base", "render"].iter().all(|name| group.contains(*name)), "{group:?}");
}
