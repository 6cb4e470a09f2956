//! A folder in which the program runs, and small scenes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// Runs the program in a folder of its own, which is removed in the end.
pub struct CommandLine {
    folder: TempDir,
}

impl CommandLine {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// Runs the program in the folder, on the CPU.
    pub fn run(&self, arguments: &[&str]) -> Output {
        self.run_with(arguments, &[])
    }

    pub fn run_with(&self, arguments: &[&str], variables: &[(&str, &str)]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_biscale"))
            .args(arguments)
            .env("BISCALE_CACHE", "off")
            .envs(variables.iter().copied())
            .current_dir(self.folder.path())
            .output()
            .unwrap()
    }

    /// Runs the program, which must succeed, and returns its standard output.
    pub fn text(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    pub fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&self.text(arguments)).unwrap()
    }

    /// Checks that the program fails with exit code 2, that its message contains all of `parts`, and that its standard
    /// output is empty.
    pub fn assert_refused(&self, arguments: &[&str], parts: &[&str]) {
        let output = self.run(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        for part in parts {
            assert!(message.contains(part), "{arguments:?}: `{message}` does not contain `{part}`");
        }
        assert!(!message.contains("panicked"), "{message}");
        assert!(output.stdout.is_empty(), "{arguments:?} printed {:?}", String::from_utf8_lossy(&output.stdout));
    }

    /// Returns the names of all files in the folder.
    pub fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(self.folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

pub const FLAT: &str = r#"
[tile]
geometry = { kind = "flat" }
[[material]]
name = "default"
brdf = { kind = "lambertian", albedo = [0.2, 0.5, 0.8] }
"#;

pub const GROOVES: &str = r#"
[tile]
geometry = { kind = "grooves", profile = "v", count = 4, depth = 0.1, side_angle_deg = 40 }
[[material]]
name = "default"
brdf = { kind = "cook_torrance", roughness = 0.3, f0 = 0.9 }
[object]
kind = "sphere"
[light]
environment = "sun"
count = 4
[quality]
preset = "draft"
facets = 256
"#;

pub const PAIRS: &str = "theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n0.5,1,0.7,2\n1.2,-1,1.0,4\n1.5,0.3,0.2,0.1\n";

/// Returns the numbers of a CSV file without its header.
pub fn rows(text: &str) -> Vec<Vec<f64>> {
    text.lines().skip(1).map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect()
}

/// Returns the name of a file without its folder.
pub fn name(path: &Path) -> &str {
    path.file_name().unwrap().to_str().unwrap()
}
