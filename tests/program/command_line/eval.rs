//! Values of the effective BRDF at pairs of directions.

use std::f64::consts::PI;

use super::folder::{CommandLine, FLAT, GROOVES, PAIRS, rows};

#[test]
fn presets_state_an_error_of_each_pair_and_of_the_whole() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
    folder.write("scene.toml", GROOVES);
    let arguments =
        ["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "values.csv", "--quality", "draft", "--errors"];
    let report = folder.json(&[&arguments[..], &["--json"]].concat());
    let error = &report["error"];
    let rel_l2 = error["rel_l2"].as_f64().unwrap();
    assert!(rel_l2 > 0.0 && rel_l2 < 0.3, "{error}");
    let [facets, visibility, table] = ["facets", "visibility", "table"].map(|part| error[part].as_f64().unwrap());
    assert!((facets.hypot(visibility).hypot(table) / rel_l2 - 1.0).abs() < 1e-6, "{error}");
    let text = std::fs::read_to_string(folder.path("values.csv")).unwrap();
    let stated = |line: &str| line.split(',').skip(7).map(|cell| cell.parse::<f64>().unwrap()).sum::<f64>();
    assert!(text.lines().skip(1).any(|line| stated(line) > 0.0), "{text}");
}

#[test]
fn the_stated_error_names_the_light_that_the_result_lacks() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
    folder.write("scene.toml", GROOVES.replace("depth = 0.1", "depth = 0.4"));
    folder.write("flat.toml", FLAT);
    let left_out = |scene: &str, effect: &str| {
        let arguments = [
            "eval",
            scene,
            "--pairs",
            "pairs.csv",
            "-o",
            "values.csv",
            "--quiet",
            "--json",
            "--quality",
            "standard",
            "--effect",
            effect,
        ];
        folder.json(&arguments)["error"]["light_left_out"].as_f64()
    };
    let [off, on] = ["off", "on"].map(|switch| left_out("scene.toml", &format!("interreflection={switch}")).unwrap());
    assert!(off > 0.04 && on == 0.0, "{off} {on}");
    assert_eq!(left_out("flat.toml", "interreflection=off"), Some(0.0));
}

#[test]
fn a_flat_lambertian_tile_is_albedo_over_pi_times_the_cosine() {
    let folder = CommandLine::new();
    folder.write("flat.toml", FLAT);
    folder.write("pairs.csv", PAIRS);
    folder.text(&["eval", "flat.toml", "--pairs", "pairs.csv", "-o", "out.csv"]);
    let text = std::fs::read_to_string(folder.path("out.csv")).unwrap();
    assert_eq!(text.lines().next(), Some("theta_i,phi_i,theta_o,phi_o,r,g,b"));
    let (pairs, values) = (rows(PAIRS), rows(&text));
    assert_eq!(pairs.len(), values.len());
    for (pair, row) in pairs.iter().zip(&values) {
        assert_eq!(pair[..], row[..4]);
        for (value, albedo) in row[4..].iter().zip([0.2, 0.5, 0.8]) {
            let expected = albedo / PI * pair[0].cos();
            assert!((value - expected).abs() < 2e-6 * expected + 1e-8, "{row:?}: {expected}");
        }
    }
    let printed = folder.text(&["eval", "flat.toml", "--pairs", "pairs.csv", "-o", "-"]);
    assert_eq!(printed, text, "`-o -` prints the content of the file");
    assert_eq!(folder.files(), ["flat.toml", "out.csv", "pairs.csv"]);
}

#[test]
fn pairs_at_and_below_the_horizon_have_the_value_zero() {
    let folder = CommandLine::new();
    folder.write("grooves.toml", GROOVES);
    let right = std::f64::consts::FRAC_PI_2;
    let header = "theta_i,phi_i,theta_o,phi_o\n";
    folder.write(
        "pairs.csv",
        format!("{header}{right},0,0.3,0\n0.3,0,{right},1\n2,0,0.1,0\n0.1,0,3.1,0\n{right},0,{right},0\n"),
    );
    for scene in
        [GROOVES.to_owned(), FLAT.to_owned(), GROOVES.replace("facets = 256", "facets = 256\nmethod = \"low_rank\"")]
    {
        folder.write("scene.toml", scene);
        let text = folder.text(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "-", "--quiet"]);
        for row in rows(&text) {
            assert_eq!(row[4..], [0.0, 0.0, 0.0], "{row:?}");
        }
    }
}

#[test]
fn columns_may_have_any_order_and_standard_errors_are_printed_on_request() {
    let folder = CommandLine::new();
    folder.write("flat.toml", FLAT);
    folder.write("pairs.csv", "# angles\nphi_o, theta_o, phi_i, theta_i\n0,0,0,1\n\n");
    let text = folder.text(&[
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
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
    let pyramids = GROOVES.replace(
        r#"{ kind = "grooves", profile = "v", count = 4, depth = 0.1, side_angle_deg = 40 }"#,
        r#"{ kind = "pyramids" }"#,
    );
    for (scene, method) in [(GROOVES, "direct"), (pyramids.as_str(), "low_rank")] {
        folder.write("scene.toml", scene);
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
            .map(|threads| folder.run_with(&arguments, &[("RAYON_NUM_THREADS", threads)]).stdout)
            .collect();
        assert!(!runs[0].is_empty() && runs.iter().all(|run| *run == runs[0]), "{method}");
    }
}

#[test]
fn another_seed_moves_the_facets() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
    folder.write("scene.toml", GROOVES);
    let run = |seed| folder.text(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "-", "--quiet", "--seed", seed]);
    assert_ne!(run("1"), run("2"));
}

#[test]
fn a_reference_that_misses_its_target_says_so_and_succeeds() {
    let folder = CommandLine::new();
    folder.write("scene.toml", GROOVES);
    folder.write("pairs.csv", PAIRS);
    let missed = |target: &str| {
        let target = format!("quality.reference_target={target}");
        let few = ["--quality", "reference", "--set", "quality.reference_samples=16", "--set", &target, "--json"];
        let output = folder.run(&[&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "out.csv"], &few[..]].concat());
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stdout).contains("reference_samples")
    };
    assert!(missed("1e-5") && !missed("1"));
}
