//! Named pipes and devices in the place of files: they are refused at once, because reading them may never end.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use super::folder::{CommandLine, FLAT, GROOVES, PAIRS};

/// Runs the program, which must end within half a minute.
fn ends(folder: &CommandLine, cache: &Path, arguments: &[&str]) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_biscale"))
        .args(arguments)
        .env("BISCALE_CACHE", cache)
        .current_dir(folder.path(""))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(30) {
            child.kill().unwrap();
            panic!("{arguments:?} does not end");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().unwrap()
}

fn make_pipe(path: &Path) -> bool {
    Command::new("mkfifo").arg(path).status().is_ok_and(|status| status.success())
}

#[test]
fn pipes_and_devices_are_refused_in_the_place_of_every_input_file() {
    let folder = CommandLine::new();
    let off = Path::new("off");
    folder.write("pairs.csv", PAIRS);
    let brdf = |kind: &str, file: &str| {
        FLAT.replace(
            "kind = \"lambertian\", albedo = [0.2, 0.5, 0.8]",
            &format!("kind = \"{kind}\", path = \"{file}\""),
        )
    };
    let geometry = |text: String| FLAT.replace("kind = \"flat\"", &text);
    let scenes = |file: &str| {
        [
            format!("{FLAT}[light]\nenvironment = \"{file}.hdr\"\n"),
            format!("{FLAT}[light]\nenvironment = \"{file}.exr\"\n"),
            format!("{FLAT}[object]\nkind = \"mesh\"\npath = \"{file}\"\n"),
            geometry(format!("kind = \"mesh\", path = \"{file}\"")),
            geometry(format!("kind = \"heightfield\", path = \"{file}\"")),
            FLAT.replace("[tile]", &format!("[tile]\ncolor_path = \"{file}\"")),
            brdf("merl", file),
            brdf("rgl", file),
            brdf("utia", file),
            brdf("npz", file),
        ]
    };
    let mut kinds = vec![("/dev/zero", "a device")];
    for ending in ["", ".hdr", ".exr"] {
        std::os::unix::fs::symlink("/dev/zero", folder.path(&format!("device{ending}"))).unwrap();
    }
    if ["pipe", "pipe.hdr", "pipe.exr"].into_iter().all(|name| make_pipe(&folder.path(name))) {
        kinds = vec![("pipe", "a named pipe"), ("device", "a device")];
    }
    for (file, found) in kinds {
        let assert_refused = |arguments: &[&str], what: &str| {
            let output = ends(&folder, off, arguments);
            let message = String::from_utf8_lossy(&output.stderr);
            let is_named = message.contains(found) && message.contains(file);
            assert!(output.status.code() == Some(2) && is_named, "{what}: {message}");
        };
        for scene in scenes(file) {
            folder.write("scene.toml", &scene);
            assert_refused(&["render", "scene.toml", "-o", "a.png", "--size", "8x8", "--backend", "cpu"], &scene);
        }
        assert_refused(&["plan", file], "scene");
        folder.write("scene.toml", FLAT);
        assert_refused(&["eval", "scene.toml", "--pairs", file, "-o", "a.csv"], "pairs");
    }
    assert!(!folder.path("a.png").exists() && !folder.path("a.csv").exists());
}

#[test]
fn a_pipe_in_the_place_of_a_cached_result_is_replaced() {
    let folder = CommandLine::new();
    let cache = folder.path("cached");
    let render = |file: &str| {
        let arguments = ["render", "table4_skirt", "-o", file, "--size", "16x16", "--backend", "cpu", "--quiet"];
        // As many facets take several times the least duration of what is cached (100 ms).
        let slow = ["--set", "quality.facets=32768", "--set", "quality.azimuths=64"];
        assert!(ends(&folder, &cache, &[&arguments[..], &slow[..]].concat()).status.success());
        std::fs::read(folder.path(file)).unwrap()
    };
    let first = render("a.png");
    let entries = || -> Vec<_> {
        let files = std::fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().path());
        files.filter(|path| path.extension().is_some_and(|ending| ending == "kept")).collect()
    };
    assert!(!entries().is_empty());
    for entry in entries() {
        std::fs::remove_file(&entry).unwrap();
        if !make_pipe(&entry) {
            return eprintln!("SKIPPED: no mkfifo");
        }
    }
    assert_eq!(render("b.png"), first);
    assert!(entries().iter().all(|entry| entry.is_file()), "the results are cached again");
}

/// Runs `eval` with a file of the folder on standard input.
fn eval_with_input(folder: &CommandLine, scene: &str, pairs: &str, input: &str) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_biscale"))
        .args(["eval", scene, "--pairs", pairs, "-o", "-", "--quiet"])
        .current_dir(folder.path(""))
        .env("BISCALE_CACHE", "off")
        .stdin(std::fs::File::open(folder.path(input)).unwrap())
        .output()
        .unwrap()
}

#[test]
fn pairs_or_the_scene_are_read_from_standard_input() {
    let folder = CommandLine::new();
    folder.write("grooves.toml", GROOVES);
    folder.write("pairs.csv", PAIRS);
    let expected = folder.text(&["eval", "grooves.toml", "--pairs", "pairs.csv", "-o", "-", "--quiet"]);
    for (scene, pairs, input) in [("grooves.toml", "-", "pairs.csv"), ("-", "pairs.csv", "grooves.toml")] {
        let piped = eval_with_input(&folder, scene, pairs, input);
        assert_eq!(String::from_utf8(piped.stdout).unwrap(), expected);
    }
}

#[test]
fn a_scene_on_standard_input_is_refused_by_its_line_and_beside_pairs_on_standard_input() {
    let folder = CommandLine::new();
    folder.write("wrong.toml", "[tile]\ngeometry = 3\n");
    folder.write("grooves.toml", GROOVES);
    folder.write("pairs.csv", PAIRS);
    for (pairs, input, part) in
        [("pairs.csv", "wrong.toml", "standard input: line 2"), ("-", "grooves.toml", "--pairs")]
    {
        let refused = eval_with_input(&folder, "-", pairs, input);
        let message = String::from_utf8_lossy(&refused.stderr);
        assert!(refused.status.code() == Some(2) && message.contains(part), "{message}");
    }
}
