//! The built program from outside: what it prints, what it writes, and what it says about bad input.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may stop where it stands")]

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// A folder with files to hand to the program.
struct Desk {
    folder: TempDir,
}

impl Desk {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// Runs the program in the folder, on the CPU.
    fn run(&self, arguments: &[&str]) -> Output {
        self.run_with(arguments, &[])
    }

    fn run_with(&self, arguments: &[&str], variables: &[(&str, &str)]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_biscale"))
            .args(arguments)
            .envs(variables.iter().copied())
            .current_dir(self.folder.path())
            .output()
            .unwrap()
    }

    /// Runs the program, which must succeed; its standard output.
    fn text(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&self.text(arguments)).unwrap()
    }

    /// The program must refuse with exit code 2, say all of `words`, and print nothing else.
    fn refused(&self, arguments: &[&str], words: &[&str]) {
        let output = self.run(arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{arguments:?} said `{said}`, without `{word}`");
        }
        assert!(!said.contains("panicked"), "{said}");
        assert!(output.stdout.is_empty(), "{arguments:?} printed {:?}", String::from_utf8_lossy(&output.stdout));
    }

    /// Names of all files in the folder.
    fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(self.folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

const FLAT: &str = r#"
[tile]
geometry = { kind = "flat" }
[[material]]
name = "default"
brdf = { kind = "lambertian", albedo = [0.2, 0.5, 0.8] }
"#;

const GROOVES: &str = r#"
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

const PAIRS: &str = "theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n0.5,1,0.7,2\n1.2,-1,1.0,4\n1.5,0.3,0.2,0.1\n";

fn rows(text: &str) -> Vec<Vec<f64>> {
    text.lines().skip(1).map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect()
}

fn name(path: &Path) -> &str {
    path.file_name().unwrap().to_str().unwrap()
}

#[test]
fn materials_lists_at_least_sixteen_names_with_what_they_show() {
    let desk = Desk::new();
    let text = desk.text(&["materials"]);
    assert!(text.lines().count() >= 16, "{text}");
    let listed = desk.json(&["materials", "--json"]);
    let listed = listed.as_array().unwrap();
    assert_eq!(listed.len(), text.lines().count());
    for row in listed {
        assert!(!row["description"].as_str().unwrap().is_empty(), "{row}");
    }
    let names: Vec<&str> = listed.iter().map(|row| row["name"].as_str().unwrap()).collect();
    for table in ["plate", "teapot", "pillow", "cup", "skirt"] {
        assert!(names.contains(&format!("table4_{table}").as_str()), "{table} of Table 4 is missing");
    }
}

#[test]
fn plan_has_the_shape_of_the_contract_and_a_reason_for_everything() {
    let desk = Desk::new();
    desk.write("grooves.toml", GROOVES);
    let plan = desk.json(&["plan", "grooves.toml", "--json", "--quiet"]);
    let effects = plan["effects"].as_array().unwrap();
    assert!(effects.len() >= 5);
    for effect in effects {
        assert!(effect["name"].is_string() && effect["on"].is_boolean(), "{effect}");
        assert!(effect["reason"].as_str().unwrap().len() > 5, "{effect}");
        assert!(effect["predicted_ms"].as_f64().unwrap() >= 0.0);
        assert!(effect["measured_ms"].is_null() || effect["measured_ms"].as_f64().unwrap() >= 0.0);
    }
    let find = |plan: &Value, name: &str| {
        plan["effects"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap()["on"] == true
    };
    assert!(find(&plan, "visibility"));
    desk.write("flat.toml", FLAT);
    let flat = desk.json(&["plan", "flat.toml", "--json", "--quiet"]);
    assert!(!find(&flat, "visibility"), "a flat tile blocks nothing");
}

#[test]
fn a_flat_lambertian_tile_is_albedo_over_pi_times_the_cosine() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    desk.write("pairs.csv", PAIRS);
    desk.text(&["eval", "flat.toml", "--pairs", "pairs.csv", "-o", "out.csv"]);
    let text = std::fs::read_to_string(desk.path("out.csv")).unwrap();
    assert_eq!(text.lines().next(), Some("theta_i,phi_i,theta_o,phi_o,r,g,b"));
    let (given, got) = (rows(PAIRS), rows(&text));
    assert_eq!(given.len(), got.len());
    for (given, got) in given.iter().zip(&got) {
        assert_eq!(given[..], got[..4]);
        for (value, albedo) in got[4..].iter().zip([0.2, 0.5, 0.8]) {
            let want = albedo / PI * given[0].cos();
            assert!((value - want).abs() < 2e-6 * want + 1e-8, "{got:?}: {want}");
        }
    }
    let printed = desk.text(&["eval", "flat.toml", "--pairs", "pairs.csv", "-o", "-"]);
    assert_eq!(printed, text, "`-o -` prints what a file would hold");
    assert_eq!(desk.files(), ["flat.toml", "out.csv", "pairs.csv"]);
}

#[test]
fn directions_at_and_under_the_horizon_reflect_nothing() {
    let desk = Desk::new();
    desk.write("grooves.toml", GROOVES);
    let right = std::f64::consts::FRAC_PI_2;
    let header = "theta_i,phi_i,theta_o,phi_o\n";
    desk.write(
        "pairs.csv",
        format!("{header}{right},0,0.3,0\n0.3,0,{right},1\n2,0,0.1,0\n0.1,0,3.1,0\n{right},0,{right},0\n"),
    );
    for scene in
        [GROOVES.to_owned(), FLAT.to_owned(), GROOVES.replace("facets = 256", "facets = 256\nmethod = \"low_rank\"")]
    {
        desk.write("scene.toml", scene);
        let text = desk.text(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "-", "--quiet"]);
        for row in rows(&text) {
            assert_eq!(row[4..], [0.0, 0.0, 0.0], "{row:?}");
        }
    }
}

#[test]
fn columns_may_stand_in_any_order_and_standard_errors_come_on_request() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    desk.write("pairs.csv", "# angles\nphi_o, theta_o, phi_i, theta_i\n0,0,0,1\n\n");
    let text = desk.text(&[
        "eval",
        "flat.toml",
        "--pairs",
        "pairs.csv",
        "-o",
        "-",
        "--standard-error",
        "--quality",
        "reference",
    ]);
    assert_eq!(text.lines().next(), Some("theta_i,phi_i,theta_o,phi_o,r,g,b,se_r,se_g,se_b"));
    let row = &rows(&text)[0];
    assert_eq!(row[..4], [1.0, 0.0, 0.0, 0.0]);
    assert!((row[4] - 0.2 / PI * 1_f64.cos()).abs() < 1e-6 && row[7] < 1e-6, "{row:?}");
}

#[test]
fn the_same_seed_gives_the_same_bytes_with_any_number_of_threads() {
    let desk = Desk::new();
    desk.write("pairs.csv", PAIRS);
    let pyramids = GROOVES.replace(
        r#"{ kind = "grooves", profile = "v", count = 4, depth = 0.1, side_angle_deg = 40 }"#,
        r#"{ kind = "pyramids" }"#,
    );
    for (scene, method) in [(GROOVES, "direct"), (pyramids.as_str(), "low_rank")] {
        desk.write("scene.toml", scene);
        let method = format!("quality.method=\"{method}\"");
        let arguments = [
            "eval",
            "scene.toml",
            "--pairs",
            "pairs.csv",
            "-o",
            "-",
            "--quiet",
            "--backend",
            "cpu",
            "--set",
            &method,
            "--seed",
            "7",
        ];
        let runs: Vec<Vec<u8>> = ["1", "2", "3"]
            .iter()
            .map(|threads| desk.run_with(&arguments, &[("RAYON_NUM_THREADS", threads)]).stdout)
            .collect();
        assert!(!runs[0].is_empty() && runs.iter().all(|run| *run == runs[0]), "{method}");
    }
}

#[test]
fn another_seed_moves_the_facets() {
    let desk = Desk::new();
    desk.write("pairs.csv", PAIRS);
    desk.write("scene.toml", GROOVES);
    let run = |seed| desk.text(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "-", "--quiet", "--seed", seed]);
    assert_ne!(run("1"), run("2"));
}

#[test]
fn render_writes_pictures_of_the_size_asked_for() {
    let desk = Desk::new();
    desk.write("scene.toml", GROOVES);
    for file in ["picture.png", "picture.exr"] {
        desk.text(&[
            "render",
            "scene.toml",
            "-o",
            file,
            "--size",
            "48x32",
            "--samples",
            "1",
            "--backend",
            "cpu",
            "--quiet",
        ]);
    }
    let picture = image::open(desk.path("picture.png")).unwrap().to_rgb8();
    assert_eq!(picture.dimensions(), (48, 32));
    let distinct: std::collections::BTreeSet<[u8; 3]> = picture.pixels().map(|pixel| pixel.0).collect();
    assert!(distinct.len() > 20, "a shaded sphere has more than {} colours", distinct.len());
    let exr = exr::prelude::read_first_rgba_layer_from_file(
        desk.path("picture.exr"),
        |size, _| (size, Vec::<f32>::new()),
        |(_, values), _, (r, g, b, _): (f32, f32, f32, f32)| values.extend([r, g, b]),
    )
    .unwrap();
    let (size, values) = exr.layer_data.channel_data.pixels;
    assert_eq!((size.width(), size.height()), (48, 32));
    assert!(values.iter().all(|value| value.is_finite() && *value >= 0.0));
}

#[test]
fn basis_has_a_row_a_material_with_the_columns_of_table_3() {
    let desk = Desk::new();
    desk.write("scene.toml", GROOVES);
    let table = desk.json(&["basis", "scene.toml", "--json", "--quality", "draft"]);
    let table = table.as_array().unwrap();
    assert_eq!(table.len(), 1);
    let row = &table[0];
    assert_eq!(row["material"], "default");
    for column in ["rows", "columns", "rank"] {
        assert!(row[column].as_u64().unwrap() > 0, "{column}: {row}");
    }
    for column in ["full_mb", "kept_mb", "seconds"] {
        assert!(row[column].as_f64().unwrap() > 0.0, "{column}: {row}");
    }
    assert!(row["kept_mb"].as_f64().unwrap() < row["full_mb"].as_f64().unwrap());
}

#[test]
fn profile_lists_the_stages_downstream_of_the_edit_and_no_others() {
    let desk = Desk::new();
    desk.write("scene.toml", GROOVES);
    let stages = |edit: &[&str]| -> Vec<String> {
        let mut arguments = vec!["profile", "scene.toml", "--json", "--repeat", "1", "--quiet"];
        arguments.extend(edit);
        let report = desk.json(&arguments);
        assert!(report["total_ms"].as_f64().unwrap() >= 0.0);
        assert!(report["stages"].as_object().unwrap().values().all(|ms| ms.as_f64().unwrap() >= 0.0));
        report["stages"].as_object().unwrap().keys().cloned().collect()
    };
    assert_eq!(stages(&[]), ["facets", "geometry", "materials", "product", "visibility"]);
    assert_eq!(stages(&["--edit", "geometry"]), ["facets", "geometry", "product", "visibility"]);
    assert_eq!(stages(&["--edit", "brdf"]), ["materials", "product"]);
    assert_eq!(stages(&["--edit", "color"]), ["materials", "product"]);
    assert_eq!(stages(&["--edit", "camera"]), ["g_buffer", "shading", "shadows"]);
}

#[test]
fn scenes_that_cannot_be_used_are_refused_with_file_field_found_and_expected() {
    let desk = Desk::new();
    desk.write("pairs.csv", PAIRS);
    let eval = |desk: &Desk, scene: &str, words: &[&str]| {
        desk.refused(&["eval", scene, "--pairs", "pairs.csv", "-o", "out.csv"], words);
    };
    eval(&desk, "missing.toml", &["missing.toml", "found", "expected"]);
    eval(&desk, "table4_plat", &["did you mean `table4_plate`?"]);
    for (find, replace, words) in [
        ("depth", "depht", &["depht", "depth", "tile.geometry"][..]),
        ("0.1,", "nan,", &["depth", "nan", "expected"]),
        ("roughness = 0.3", "roughness = inf", &["roughness", "inf", "expected"]),
        ("roughness = 0.3", "roughness = -1", &["roughness", "-1", "expected"]),
        ("facets = 256", "facets = 99999999999", &["facets", "99999999999", "expected"]),
        ("\"grooves\"", "\"grove\"", &["grove", "grooves"]),
        ("[object]", "[objekt]", &["objekt", "object"]),
        ("[tile]", "[tile", &["found", "expected"]),
        ("\"cook_torrance\"", "\"merl\"", &["path"]),
    ] {
        assert!(GROOVES.contains(find));
        desk.write("bad.toml", GROOVES.replacen(find, replace, 1));
        let mut all = vec!["bad.toml"];
        all.extend(words);
        eval(&desk, "bad.toml", &all);
    }
    desk.write("grooves.toml", GROOVES);
    desk.refused(&["plan", "grooves.toml", "--set", "tile.geometry.depth=9e9"], &["depth", "expected"]);
    desk.refused(&["plan", "grooves.toml", "--set", "tile.geometry.dept=0.1"], &["dept", "depth"]);
    assert!(!desk.path("out.csv").exists());
}

#[test]
fn measured_files_and_meshes_that_are_broken_are_refused_and_named() {
    let desk = Desk::new();
    desk.write("pairs.csv", PAIRS);
    let header: Vec<u8> = [90_i32, 90, 180].iter().flat_map(|n| n.to_le_bytes()).collect();
    let merl = |name: &str| {
        FLAT.replace("kind = \"lambertian\", albedo = [0.2, 0.5, 0.8]", &format!("kind = \"merl\", path = \"{name}\""))
    };
    let mesh = |name: &str| FLAT.replace("kind = \"flat\"", &format!("kind = \"mesh\", path = \"{name}\""));
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let files: [(&str, Vec<u8>, &[&str]); 9] = [
        ("short.binary", [header.clone(), vec![0; 1000]].concat(), &["1012", "expected"]),
        (
            "shape.binary",
            [[90_i32, 90, 90].iter().flat_map(|n| n.to_le_bytes()).collect(), vec![0; 1000]].concat(),
            &["90", "180"],
        ),
        ("empty.binary", Vec::new(), &["expected"]),
        ("points.obj", square.into(), &["no faces"]),
        ("range.obj", format!("{square}f 1 2 3\nf 1 2 9\n").into(), &["line 6", "9", "expected"]),
        ("nan.obj", format!("v nan 0 0\n{square}f 1 2 3\n").into(), &["line 1", "nan", "finite"]),
        ("zero.obj", format!("{square}f 0 1 2\n").into(), &["line 5", "expected"]),
        ("text.obj", b"hello\n".to_vec(), &["expected"]),
        ("binary.obj", vec![0, 159, 146, 150, 255], &["expected"]),
    ];
    for (file, bytes, words) in files {
        desk.write(file, bytes);
        desk.write("scene.toml", if file.ends_with("obj") { mesh(file) } else { merl(file) });
        let mut all = vec![file, "found"];
        all.extend(words);
        desk.refused(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "out.csv"], &all);
    }
    for (scene, file) in [(merl("none.binary"), "none.binary"), (mesh("none.obj"), "none.obj")] {
        desk.write("scene.toml", scene);
        desk.refused(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "out.csv"], &[file]);
    }
    assert!(!desk.path("out.csv").exists());
}

#[test]
fn bad_pairs_are_refused_with_their_line() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    for (text, words) in [
        ("", &["line 1", "theta_i,phi_i,theta_o,phi_o"][..]),
        ("theta_i,phi_i,theta_o\n0,0,0\n", &["line 1", "expected"]),
        ("theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n0,0,x,0\n", &["line 3", "`x`", "theta_o"]),
        ("theta_i,phi_i,theta_o,phi_o\n0,0,nan,0\n", &["line 2", "nan"]),
        ("theta_i,phi_i,theta_o,phi_o\n0,0,0\n", &["line 2", "3 values", "4 values"]),
    ] {
        desk.write("pairs.csv", text);
        let mut all = vec!["pairs.csv"];
        all.extend(words);
        desk.refused(&["eval", "flat.toml", "--pairs", "pairs.csv", "-o", "out.csv"], &all);
    }
    desk.refused(&["eval", "flat.toml", "--pairs", "none.csv", "-o", "out.csv"], &["none.csv"]);
    assert!(!desk.path("out.csv").exists());
}

#[test]
fn an_output_that_cannot_be_written_fails_and_leaves_what_was_there() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    let pairs = desk.write("pairs.csv", PAIRS);
    let nowhere = "no/such/folder/out.csv";
    desk.refused(&["eval", "flat.toml", "--pairs", name(&pairs), "-o", nowhere], &[nowhere]);
    desk.refused(&["render", "flat.toml", "-o", "picture.bmp", "--size", "8x8"], &["picture.bmp", "png"]);
    // An error must not touch what a file held before.
    let kept = desk.write("kept.csv", "mine");
    desk.write("bad.csv", "theta_i,phi_i,theta_o,phi_o\n0,0,x,0\n");
    desk.refused(&["eval", "flat.toml", "--pairs", "bad.csv", "-o", name(&kept)], &["bad.csv"]);
    assert_eq!(std::fs::read_to_string(kept).unwrap(), "mine");
    assert_eq!(desk.files(), ["bad.csv", "flat.toml", "kept.csv", "pairs.csv"]);
}

#[test]
fn wrong_usage_exits_with_two_and_says_how_to_do_it() {
    let desk = Desk::new();
    for arguments in [
        &["nonsense"][..],
        &["eval", "default"],
        &["render", "default"],
        &["render", "default", "-o", "x.png", "--size", "0x10"],
        &["plan", "default", "--quality", "best"],
        &["plan", "default", "--seed", "-1"],
        &["profile", "default", "--repeat", "0"],
        &["plan", "default", "--target-db", "much"],
        &["plan", "default", "--target-db", "40", "--budget-ms", "100"],
        &["plan", "default", "--effect", "interreflection"],
        &["plan", "default", "--effect", "fluorescence=on"],
    ] {
        desk.refused(arguments, &["--help"]);
    }
    let version = desk.text(&["--version"]);
    assert!(version.starts_with("biscale "), "{version}");
    assert!(desk.files().is_empty());
}

#[test]
fn a_report_holds_every_preset_and_goes_on_from_where_it_was() {
    let desk = Desk::new();
    desk.write("tile.toml", "[tile]\ngeometry = { kind = \"flat\" }\n");
    let run = || -> Value {
        let budget = ["--minutes", "0", "--pairs", "16", "--combinations", "1", "--quiet"];
        desk.text(&[&["report", "tile.toml", "-o", "out"], &budget[..]].concat());
        serde_json::from_slice(&std::fs::read(desk.path("out/report.json")).unwrap()).unwrap()
    };
    let report = run();
    let points = report["points"].as_array().unwrap();
    for preset in ["draft", "standard", "fine", "wu2011", "reference"] {
        let point = points.iter().find(|point| point["preset"] == preset).unwrap_or_else(|| panic!("no {preset}"));
        assert_eq!(point["scene"], "tile");
        assert!(point["ms"].as_f64().unwrap() > 0.0 && point["settings"].as_str().unwrap().contains(preset));
        // A grey Lambertian tile is its own BRDF; the paper's tables come close.
        let (rel_l2, psnr_db) = (point["rel_l2"].as_f64().unwrap(), point["psnr_db"].as_f64().unwrap());
        assert!(if preset == "wu2011" { rel_l2 < 0.3 } else { rel_l2 < 1e-3 && psnr_db > 50.0 }, "{point}");
    }
    assert!(report["scenes"][0]["left_out"].as_u64().unwrap() > 10, "there was no time for knobs");
    let page = std::fs::read_to_string(desk.path("out/report.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("data:image/png;base64,") && !page.contains("http://"));
    assert_eq!(std::fs::read_to_string(desk.path("out/report.csv")).unwrap().lines().count(), points.len() + 1);
    let times = |report: &Value| -> Vec<Value> {
        report["points"].as_array().unwrap().iter().map(|point| point["ms"].clone()).collect()
    };
    assert_eq!(times(&run()), times(&report), "what was measured is not measured again");
}

#[test]
fn every_result_says_how_sound_it_is_in_json_and_on_standard_error() {
    let desk = Desk::new();
    desk.write(
        "gain.toml",
        GROOVES.replace("kind = \"cook_torrance\", roughness = 0.3, f0 = 0.9", "kind = \"lambertian\", albedo = 2"),
    );
    desk.write("pairs.csv", PAIRS);
    for arguments in [
        &["plan", "gain.toml"][..],
        &["eval", "gain.toml", "--pairs", "pairs.csv", "-o", "out.csv"],
        &[
            "eval",
            "gain.toml",
            "--pairs",
            "pairs.csv",
            "-o",
            "out.csv",
            "--quality",
            "reference",
            "--set",
            "quality.reference_samples=16",
        ],
        &["render", "gain.toml", "-o", "out.png", "--size", "16x16"],
        &["export", "gain.toml", "-o", "out.npz", "--resolution", "4x8"],
    ] {
        let told = desk.run(&[arguments, &["--json"]].concat());
        assert!(told.status.success(), "{arguments:?}");
        let said = String::from_utf8_lossy(&told.stderr);
        assert!(
            said.lines().any(|line| line.starts_with("warning: ") && line.contains("2.000 times the light")),
            "{said}"
        );
        let json: Value = serde_json::from_slice(&told.stdout).unwrap();
        let warnings = json["health"]["warnings"].as_array().unwrap();
        assert!(warnings.iter().any(|warning| warning.as_str().unwrap().contains("`default`")), "{json}");
        let quiet = desk.run(&[arguments, &["--quiet"]].concat());
        assert!(!String::from_utf8_lossy(&quiet.stderr).contains("warning"), "{arguments:?}");
    }
}

#[test]
fn a_target_is_answered_with_settings_that_repeat_it() {
    let desk = Desk::new();
    desk.write("grooves.toml", GROOVES);
    desk.write("pairs.csv", PAIRS);
    let eval = |extra: &[&str]| {
        let output = desk.run(&[&["eval", "grooves.toml", "--pairs", "pairs.csv", "-o", "-"], extra].concat());
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{said}");
        (String::from_utf8(output.stdout).unwrap(), said)
    };
    let (values, said) = eval(&["--target-db", "35"]);
    assert!(said.contains("asked 35.0 dB, got "), "{said}");
    let line = said.lines().find(|line| line.starts_with("asked")).unwrap();
    let words = line.split(": ").last().unwrap().trim();
    let words: Vec<&str> = words.split_whitespace().collect();
    assert_eq!(words[0], "--quality", "{said}");
    let (again, _) = eval(&words);
    assert_eq!(values, again, "{words:?}");
    let (_, said) = eval(&["--budget-ms", "100000"]);
    assert!(said.contains("asked 100000.0 ms, got "), "{said}");
}

#[test]
fn an_effect_is_forced_on_and_off_and_the_plan_shows_it() {
    let desk = Desk::new();
    desk.write("grooves.toml", GROOVES.replace("depth = 0.1", "depth = 0.4"));
    desk.write("pairs.csv", PAIRS);
    let effect = |extra: &[&str], name: &str| -> Value {
        let plan = desk.json(&[&["plan", "grooves.toml", "--json", "--quiet"], extra].concat());
        plan["effects"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap().clone()
    };
    assert_eq!(effect(&[], "interreflection")["on"], false);
    let on = effect(&["--effect", "interreflection=on"], "interreflection");
    assert!(on["on"] == true && on["forced"] == true && on["measured_ms"].as_f64().unwrap() > 0.0, "{on}");
    assert_eq!(effect(&["--effect", "visibility=off"], "visibility")["on"], false);
    assert_eq!(effect(&["--effect", "low_rank=on"], "low_rank")["on"], true);
    let sum = |extra: &[&str]| -> f64 {
        let text = desk.text(&[&["eval", "grooves.toml", "--pairs", "pairs.csv", "-o", "-"], extra].concat());
        rows(&text).iter().map(|row| row[4]).sum()
    };
    assert!(sum(&["--effect", "interreflection=on"]) > 1.01 * sum(&[]), "light between facets is added");
    let measured = desk.json(&["plan", "grooves.toml", "--json", "--quiet", "--measure", "--quality", "draft"]);
    let costs = measured["measured"].as_array().unwrap();
    let cost = costs.iter().find(|cost| cost["name"] == "interreflection").unwrap();
    assert!(cost["on_ms"].as_f64().unwrap() > cost["off_ms"].as_f64().unwrap(), "{cost}");
    assert!(cost["rel_l2"].as_f64().unwrap() > 0.005 && cost["mean_delta_e"].as_f64().unwrap() > 0.0, "{cost}");
}
