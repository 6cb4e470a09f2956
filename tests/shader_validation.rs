//! Every shader in `shaders/` parses and validates, whatever the machine: naga needs no adapter.

use std::collections::BTreeSet;
use std::path::Path;

use naga::valid::{Capabilities, ValidationFlags, Validator};

#[test]
fn every_shader_parses_and_validates_with_its_imports() {
    let mut failures = Vec::new();
    for (name, _) in biscale::gpu::SHADERS {
        let source = match biscale::gpu::shader_source(name) {
            Ok(source) => source,
            Err(error) => {
                failures.push(format!("{name}: {error}"));
                continue;
            }
        };
        let module = match naga::front::wgsl::parse_str(&source) {
            Ok(module) => module,
            Err(error) => {
                failures.push(format!("{name}: {}", error.emit_to_string(&source)));
                continue;
            }
        };
        // No optional capabilities: what passes here runs on every adapter.
        if let Err(error) =
            Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module)
        {
            failures.push(format!("{name}: {}", error.emit_to_string(&source)));
        }
    }
    assert!(
        failures.is_empty(),
        "{} shaders fail:\n{}",
        failures.len(),
        failures.join("\n")
    );
}

#[test]
fn the_table_of_shaders_is_the_folder() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let files = std::fs::read_dir(&folder)
        .expect("shaders/ is there")
        .map(|entry| entry.expect("readable").path());
    let files: BTreeSet<_> = files
        .filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()))
        .collect();
    let table: BTreeSet<_> = biscale::gpu::SHADERS
        .iter()
        .map(|(name, _)| format!("{name}.wgsl"))
        .collect();
    assert_eq!(files, table);
}
