//! A mesh of a million triangles through all stages, from its OBJ file to its values.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use biscale::metrics::{compare, mirror_biased_pairs};
use biscale::pipeline::Pipeline;
use biscale::scene;
use biscale::scene::{LoadedScene, Painted};
use glam::Vec3;

/// Writes a sheet of `2 n²` triangles over the tile, with points `position(u, v)` for `u` and `v` from 0 to 1.
fn write_sheet(path: &Path, n: usize, position: fn(f64, f64) -> [f64; 3]) {
    let mut text = String::with_capacity(64 * n * n);
    for k in 0..(n + 1) * (n + 1) {
        let [x, y, z] = position((k % (n + 1)) as f64 / n as f64, (k / (n + 1)) as f64 / n as f64);
        writeln!(text, "v {x:.7} {y:.7} {z:.7}").unwrap();
    }
    for k in 0..n * n {
        let a = k / n * (n + 1) + k % n + 1;
        let b = a + n + 1;
        writeln!(text, "f {a} {} {}\nf {a} {} {b}", a + 1, b + 1, b + 1).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

fn bumps(u: f64, v: f64) -> [f64; 3] {
    [u, v, 0.08 * (TAU * u).sin() * (2.0 * TAU * v).cos()]
}

/// Returns a point of waves that overhang their troughs.
fn breakers(u: f64, v: f64) -> [f64; 3] {
    let height = (2.0 * TAU * u).sin();
    [u + 0.12 * (2.0 * TAU * u).cos(), v, 0.1 * height + 0.02 * (TAU * v).sin()]
}

fn values(folder: &Path) -> (Vec<Vec3>, bool) {
    let text = "[tile]\ngeometry = { kind = \"mesh\", path = \"sheet.obj\" }\n[[material]]\nname = \"default\"\nbrdf = { kind = \
                \"cook_torrance\", roughness = 0.5, f0 = 0.9 }\n[quality]\npreset = \"draft\"\nbackend = \"cpu\"\n";
    let scene = scene::parse(text).unwrap();
    let loaded = LoadedScene { scene, base_dir: folder.to_owned(), name: String::new(), painted: Painted::default() };
    let pipeline = Pipeline::new();
    let outcome = pipeline.effective(&loaded).unwrap();
    let found = mirror_biased_pairs(200, 9).iter().map(|p| outcome.brdf.eval(p.i, p.o)).collect();
    let health = outcome.health();
    assert!(health.result.unsound_values == 0 && !health.surface.has_holes, "{:?}", health.warnings);
    (found, pipeline.mesh(&loaded).unwrap().is_height_field())
}

/// Returns the peak memory of this process in megabytes, if the system reports it. It includes other tests of the same
/// run.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? >> 10)
}

#[test]
#[ignore = "a million triangles, twice: files of 50 MB and half a minute"]
fn a_million_triangles_reflect_like_the_same_shape_in_twenty_thousand() {
    let folder = tempfile::tempdir().unwrap();
    for (name, position, is_height_field) in
        [("bumps", bumps as fn(f64, f64) -> [f64; 3], true), ("breakers that lean over", breakers, false)]
    {
        let mut found = Vec::new();
        for n in [100, 708] {
            write_sheet(&folder.path().join("sheet.obj"), n, position);
            let start = Instant::now();
            let (values, found_height_field) = values(folder.path());
            let seconds = start.elapsed().as_secs_f64();
            assert_eq!(found_height_field, is_height_field, "{name}");
            assert!(values.iter().all(|value| value.is_finite() && value.min_element() >= 0.0), "{name}");
            println!(
                "{name}: {} triangles in {seconds:.1} s; peak memory {} MB",
                2 * n * n,
                peak_memory().unwrap_or(0)
            );
            found.push(values);
        }
        // The two results have different samples of 2,048 facets.
        let difference = compare(&found[1], &found[0]).rel_l2;
        println!("{name}: difference {:.2} %", 100.0 * difference);
        assert!(difference < 0.08, "{name}: {difference}");
    }
}
