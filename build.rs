//! Compiles a hash of everything that the results of the program depend on into it. The disk cache names its files by it.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};

fn main() {
    let mut hasher = DefaultHasher::new();
    for root in ["src", "shaders", "materials", "assets", "Cargo.toml", "Cargo.lock", "build.rs"] {
        println!("cargo:rerun-if-changed={root}");
        let mut files = Vec::new();
        list(Path::new(root), &mut files);
        files.sort();
        for file in files {
            file.hash(&mut hasher);
            std::fs::read(&file).unwrap_or_default().hash(&mut hasher);
        }
    }
    for variable in ["TARGET", "PROFILE", "OPT_LEVEL", "CARGO_ENCODED_RUSTFLAGS", "RUSTC_WRAPPER"] {
        println!("cargo:rerun-if-env-changed={variable}");
        std::env::var(variable).unwrap_or_default().hash(&mut hasher);
    }
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    if let Ok(version) = std::process::Command::new(rustc).arg("--version").output() {
        version.stdout.hash(&mut hasher);
    }
    println!("cargo:rustc-env=BISCALE_BUILD={:016x}", hasher.finish());
}

/// Adds the files at or below a path.
fn list(path: &Path, files: &mut Vec<PathBuf>) {
    match std::fs::read_dir(path) {
        Ok(entries) => entries.flatten().for_each(|entry| list(&entry.path(), files)),
        Err(_) => files.push(path.to_owned()),
    }
}
