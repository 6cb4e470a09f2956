//! A standard error that is closed or full: files and exit codes are those of an open one.

use std::process::{Command, Stdio};

use super::folder::{CommandLine, GROOVES, PAIRS};

/// A stream that refuses every write: the pipe of a reader that has ended, and a full device.
fn refusing() -> Vec<Stdio> {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full");
    [Ok(writer.into()), full.map(Stdio::from)].into_iter().flatten().collect()
}

fn program(folder: &CommandLine, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_biscale"));
    command.args(arguments).env("BISCALE_CACHE", "off").current_dir(folder.path(""));
    command.stdout(Stdio::null());
    command
}

#[test]
fn a_standard_error_that_refuses_writes_changes_neither_files_nor_exit_codes() {
    let folder = CommandLine::new();
    // This scene has a warning, so that every command prints something.
    let loud =
        GROOVES.replace("kind = \"cook_torrance\", roughness = 0.3, f0 = 0.9", "kind = \"lambertian\", albedo = 2");
    folder.write("loud.toml", loud);
    folder.write("pairs.csv", PAIRS);
    for (arguments, file, code) in [
        (&["render", "loud.toml", "-o", "a.png", "--size", "16x16", "--backend", "cpu"][..], "a.png", 0),
        (&["eval", "loud.toml", "--pairs", "pairs.csv", "-o", "a.csv"], "a.csv", 0),
        (&["eval", "loud.toml", "--pairs", "pairs.csv", "-o", "b.csv", "--target-db", "20"], "b.csv", 0),
        (&["export", "loud.toml", "-o", "a.bsdf", "--resolution", "4x8"], "a.bsdf", 0),
        (&["tile", "loud.toml", "-o", "a.png"], "a.png", 0),
        (&["plan", "loud.toml"], "", 0),
        (&["plan", "no_such_scene"], "", 2),
        (&["plan", "loud.toml", "--no-such-option"], "", 2),
        (&["render", "loud.toml", "-o", "missing/a.png", "--size", "8x8"], "", 2),
    ] {
        let output = program(&folder, arguments).stderr(Stdio::piped()).output().unwrap();
        assert!(!output.stderr.is_empty() || arguments[0] == "tile", "{arguments:?} prints nothing");
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        let read = || (!file.is_empty()).then(|| std::fs::read(folder.path(file)).unwrap());
        let expected = read();
        for stderr in refusing() {
            if expected.is_some() {
                std::fs::remove_file(folder.path(file)).unwrap();
            }
            let status = program(&folder, arguments).stderr(stderr).status().unwrap();
            assert_eq!(status.code(), Some(code), "{arguments:?}");
            assert_eq!(read(), expected, "{arguments:?}");
        }
    }
}

#[test]
fn a_reader_of_both_streams_that_has_ended_is_no_failure() {
    let folder = CommandLine::new();
    folder.write("grooves.toml", GROOVES);
    for arguments in [
        &["render", "grooves.toml", "-o", "a.png", "--size", "16x16", "--backend", "cpu", "--json"][..],
        &["fit", "grooves.toml", "-o", "a.json"],
        &["plan", "grooves.toml"],
    ] {
        let mut command = program(&folder, arguments);
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        command.stdout(writer.try_clone().unwrap()).stderr(writer);
        assert_eq!(command.status().unwrap().code(), Some(0), "{arguments:?}");
    }
    assert!(folder.path("a.png").exists() && folder.path("a.json").exists());
}
