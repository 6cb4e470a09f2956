//! Inputs that take long: polygons of many corners, many facets, many threads.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::folder::{CommandLine, FLAT, GROOVES, PAIRS};

#[test]
fn a_polygon_of_a_hundred_thousand_corners_is_read_in_seconds() {
    const CORNERS: usize = 100_000;
    let folder = CommandLine::new();
    let mut text = String::new();
    for k in 0..CORNERS {
        // A star, so that every other corner is reflex.
        let (angle, radius) = (std::f64::consts::TAU * k as f64 / CORNERS as f64, if k % 2 == 0 { 0.5 } else { 0.3 });
        let _ = writeln!(text, "v {} {} 0", 0.5 + radius * angle.cos(), 0.5 + radius * angle.sin());
    }
    text.push('f');
    (1..=CORNERS).for_each(|k| text.push_str(&format!(" {k}")));
    folder.write("star.obj", text + "\n");
    folder.write("scene.toml", FLAT.replace("kind = \"flat\"", "kind = \"mesh\", path = \"star.obj\""));
    let start = Instant::now();
    folder.text(&["tile", "scene.toml", "-o", "star.stl", "--quiet"]);
    let seconds = start.elapsed().as_secs_f64();
    // The whole command reads and writes some megabytes besides. In n² steps it takes minutes.
    assert!(seconds < 15.0, "{seconds} s");
}

#[test]
fn a_long_computation_tells_its_time_and_ends_at_a_signal() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
    folder.write(
        "rods.toml",
        "[tile]\ngeometry = { kind = \"rods\" }\n[[material]]\nname = \"default\"\nbrdf = { kind = \"lambertian\" }\n",
    );
    for scene in
        [&["rods.toml", "--set", "quality.facets=1000000"][..], &["fig8b_ripples", "--set", "quality.visibility=maps"]]
    {
        let mut child = Command::new(env!("CARGO_BIN_EXE_biscale"))
            .arg("eval")
            .args(scene)
            .args(["--pairs", "pairs.csv", "-o", "a.csv", "--backend", "cpu", "--seed", "1"])
            .env("BISCALE_CACHE", "off")
            .current_dir(folder.path(""))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
        assert!(line.starts_with("note: visibility takes ") && line.contains("quality.facets"), "{scene:?}: {line}");
        // Shells start background commands with interrupts ignored, which the program inherits, but not this signal.
        let signal = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
        assert!(signal.is_ok_and(|status| status.success()));
        let start = Instant::now();
        while child.try_wait().unwrap().is_none() {
            assert!(start.elapsed() < Duration::from_secs(10), "{scene:?}: the signal has no effect");
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(!child.wait().unwrap().success());
        assert_eq!(folder.files(), ["pairs.csv", "rods.toml"], "nothing is left");
    }
}

#[test]
fn maps_of_a_level_tile_are_computed_only_if_visibility_is_forced() {
    let folder = CommandLine::new();
    folder.write("flat.toml", FLAT);
    let is_on = |extra: &[&str]| {
        let maps = ["plan", "flat.toml", "--json", "--quiet", "--set", "quality.visibility=maps", "--quality", "draft"];
        let plan = folder.json(&[&maps, extra].concat());
        let runs = plan["runs"]["visibility"].as_u64().unwrap();
        let visibility =
            plan["effects"].as_array().unwrap().iter().find(|effect| effect["name"] == "visibility").unwrap();
        (visibility["on"].as_bool().unwrap(), runs)
    };
    assert_eq!(is_on(&[]), (false, 0));
    assert_eq!(is_on(&["--effect", "visibility=on", "--backend", "cpu"]), (true, 1));
}

#[test]
fn twenty_thousand_threads_are_capped() {
    let folder = CommandLine::new();
    folder.write("grooves.toml", GROOVES);
    folder.write("pairs.csv", PAIRS);
    let arguments = ["eval", "grooves.toml", "--pairs", "pairs.csv", "-o", "-", "--quiet", "--backend", "cpu"];
    let mut child = Command::new(env!("CARGO_BIN_EXE_biscale"))
        .args(arguments)
        .envs([("BISCALE_CACHE", "off"), ("RAYON_NUM_THREADS", "20000")])
        .current_dir(folder.path(""))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(60) {
            child.kill().unwrap();
            panic!("the program does not end");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output().unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), folder.text(&arguments));
}
