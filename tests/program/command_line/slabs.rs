//! Slabs: values on both sides, lobes, and errors for bad input.

use std::f64::consts::PI;

use super::folder::{CommandLine, rows};

const SLAB: &str = r#"
[tile]
geometry = { kind = "pyramids", height = 0.04 }
[quality]
preset = "draft"
[slab]
eta = 1.5
[slab.top]
kind = "tile"
[slab.bottom]
kind = "ggx"
roughness = 0.2
"#;

const BOTH_SIDES: &str =
    "theta_i,phi_i,theta_o,phi_o\n0.5,0,2.7,3.1\n2.7,3.1,0.5,0\n0.5,0,0.4,3\n2.6,0,2.7,3\n1.5707963267948966,0,2.5,0\n";

#[test]
fn eval_of_a_slab_covers_both_sides_and_agrees_with_photons() {
    let folder = CommandLine::new();
    folder.write("slab.toml", SLAB);
    folder.write("pairs.csv", BOTH_SIDES);
    let eval = |more: &[&str]| {
        let arguments = ["eval", "slab.toml", "--pairs", "pairs.csv", "-o", "-", "--quiet"];
        folder.text(&[&arguments[..], more].concat())
    };
    let text = eval(&["--quality", "fine"]);
    assert_eq!(text.lines().next(), Some("theta_i,phi_i,theta_o,phi_o,r,g,b"));
    let values = rows(&text);
    assert!(values[..4].iter().all(|row| row[4] > 0.0), "{text}");
    assert!(values[4][4] >= 0.0 && values[4][4] < 1e-6, "no light arrives at the horizon: {text}");
    // The BTDF is reciprocal.
    let btdf = |row: &[f64]| row[4] / row[0].cos().abs();
    assert!((btdf(&values[0]) / btdf(&values[1]) - 1.0).abs() < 1e-5, "{text}");
    let reference = eval(&["--quality", "reference", "--standard-error", "--set", "quality.reference_samples=100000"]);
    assert!(reference.starts_with("theta_i,phi_i,theta_o,phi_o,r,g,b,se_r,se_g,se_b"), "{reference}");
    for (value, truth) in values.iter().zip(&rows(&reference)).take(3) {
        let bound = 5.0 * truth[7] + 0.08 * truth[4] + 0.02;
        assert!((value[4] - truth[4]).abs() < bound, "{value:?} {truth:?}");
    }
    assert_eq!(eval(&[]), folder.text(&["eval", "slab.toml", "--pairs", "pairs.csv", "-o", "-", "--quiet"]));
}

#[test]
fn a_window_transmits_by_the_closed_form_and_absorbs_along_the_ray() {
    let folder = CommandLine::new();
    let clear = folder.json(&["transmit", "slab_window", "--set", "slab.absorption=0", "--json", "--theta-i", "60"]);
    let [i, t] = [60.0_f64.to_radians(), (60.0_f64.to_radians().sin() / 1.5).asin()];
    let rs = ((i - t).sin() / (i + t).sin()).powi(2);
    let rp = ((i - t).tan() / (i + t).tan()).powi(2);
    let r = 0.5 * (rs + rp);
    let part = |value: &serde_json::Value, name: &str| value["totals"][name].as_f64().unwrap();
    assert!((part(&clear, "straight") - (1.0 - r) / (1.0 + r)).abs() < 1e-9, "{clear}");
    assert!((part(&clear, "reflected") - 2.0 * r / (1.0 + r)).abs() < 1e-4, "{clear}");
    let tinted = folder.json(&["transmit", "slab_window", "--json", "--theta-i", "60"]);
    assert!(tinted["rgb"]["absorbed"][0].as_f64() > tinted["rgb"]["absorbed"][1].as_f64(), "{tinted}");
    let sum = part(&tinted, "transmitted") + part(&tinted, "reflected") + part(&tinted, "absorbed");
    assert!((sum - 1.0).abs() < 2e-3, "{tinted}");
}

#[test]
fn transmit_writes_lobes_by_every_method_and_truth_states_their_error() {
    let folder = CommandLine::new();
    let transmit = |more: &[&str]| {
        folder.json(&[&["transmit", "slab_fig3_both", "--theta-i", "45", "--json", "--quiet"], more].concat())
    };
    let mut totals = Vec::new();
    for method in ["dual", "faces", "truth", "walter"] {
        let report = transmit(&["--method", method, "-o", &format!("{method}.csv")]);
        assert_eq!(report["method"], method);
        assert_eq!(report["output"], format!("{method}.csv"));
        totals.push(report["totals"]["transmitted"].as_f64().unwrap());
        let text = std::fs::read_to_string(folder.path(&format!("{method}.csv"))).unwrap();
        assert!(text.starts_with("part,o_x,o_y,theta_o_deg,r,g,b"), "{text:.80}");
        assert!(text.lines().any(|line| line.starts_with("plane,")));
        let width = report["lobe"]["deviation"][0].as_f64().unwrap();
        assert!((0.05..0.2).contains(&width), "{report}");
        assert_eq!(report["rel_l2"].is_number(), method == "truth", "{report}");
    }
    // Figures of a prototype: Eq. 11 0.787, photons 0.816.
    assert!((totals[0] - 0.787).abs() < 0.003 && (totals[2] - 0.816).abs() < 0.003, "{totals:?}");
    assert!((totals[1] / totals[2] - 1.0).abs() < 0.02, "{totals:?}");
    let image = transmit(&["-o", "lobe.png"]);
    assert_eq!(image["method"], "faces", "{image}");
    assert!(std::fs::read(folder.path("lobe.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn a_slab_of_index_1_passes_all_light() {
    let folder = CommandLine::new();
    folder.write("slab.toml", SLAB);
    let report = folder.json(&["transmit", "slab.toml", "--set", "slab.eta=1", "--json", "--quiet", "--theta-i", "70"]);
    for (name, expected) in [("transmitted", 1.0), ("straight", 1.0), ("reflected", 0.0), ("absorbed", 0.0)] {
        assert_eq!(report["totals"][name].as_f64(), Some(expected), "{name}: {report}");
    }
}

#[test]
fn profile_times_only_the_stages_that_an_edit_of_a_slab_makes_again() {
    let folder = CommandLine::new();
    folder.write("slab.toml", SLAB);
    let stages = |more: &[&str]| -> Vec<String> {
        let arguments = ["profile", "slab.toml", "--repeat", "1", "--size", "32x32", "--json", "--quiet"];
        let report = folder.json(&[&arguments[..], more].concat());
        report["stages"].as_object().unwrap().keys().cloned().collect()
    };
    assert_eq!(stages(&["--edit", "eta"]), ["slab", "slab_inner"]);
    assert_eq!(stages(&["--edit", "face"]), ["slab", "slab_correlation", "slab_face", "slab_inner"]);
    assert_eq!(stages(&["--edit", "geometry"]), ["slab", "slab_correlation", "slab_face", "slab_inner"]);
    assert_eq!(stages(&["--edit", "camera"]), ["g_buffer", "shading"]);
    // Thickness alone absorbs nothing.
    assert_eq!(stages(&["--edit", "thickness"]), ["slab"]);
    let shown = ["--edit", "thickness", "--picture", "--set", "slab.absorption=0.1"];
    assert_eq!(stages(&shown), ["g_buffer", "shading", "slab", "slab_inner", "slab_view"]);
}

#[test]
fn plan_says_how_a_slab_is_computed_and_why() {
    let folder = CommandLine::new();
    folder.write("slab.toml", SLAB);
    let plan = folder.json(&["plan", "slab.toml", "--json", "--quiet"]);
    let effects = plan["effects"].as_array().unwrap();
    assert_eq!(effects[0]["name"], "slab");
    assert!(effects[0]["reason"].as_str().unwrap().contains("Eq. 1"), "{plan}");
    assert!(plan["runs"]["slab_correlation"] == 1 && plan["runs"]["geometry"] == 0, "{plan}");
    let text = folder.text(&["plan", "slab.toml", "--quiet"]);
    assert!(text.contains("slab_bounces"), "{text}");
}

#[test]
fn bad_slabs_are_refused_with_key_found_and_expected() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", BOTH_SIDES);
    folder.write("zero.csv", "0,0\n0,0\n");
    folder.write("long.csv", "1,1,1\n1,1,1\n");
    folder.write("slab.toml", SLAB);
    folder.write("circle.toml", SLAB.replace("kind = \"tile\"", "kind = \"tile\"\nscene = \"other.toml\""));
    folder.write("other.toml", SLAB.replace("kind = \"tile\"", "kind = \"tile\"\nscene = \"circle.toml\""));
    let before = folder.files();
    let eval = |scene: &str, set: &[&str], parts: &[&str]| {
        let mut arguments = vec!["eval", scene, "--pairs", "pairs.csv", "-o", "out.csv"];
        set.iter().for_each(|set| arguments.extend(["--set", *set]));
        folder.assert_refused(&arguments, parts);
    };
    for (set, parts) in [
        ("slab.eta=0.99", &["slab.eta", "0.99", "from 1 to 4"][..]),
        ("slab.eta=nan", &["slab.eta", "nan"]),
        ("slab.eta=[1.5, 0.5, 1.5]", &["slab.eta", "expected"]),
        ("slab.alpha=1.5", &["slab.alpha", "1.5"]),
        ("slab.alpha=\"half\"", &["slab.alpha", "half", "auto"]),
        ("slab.absorption=-1", &["slab.absorption", "-1"]),
        ("slab.bottom.roughness=-0.1", &["slab.bottom.roughness", "-0.1"]),
        ("slab.bottom.roughnes=0.1", &["roughnes", "did you mean `roughness`"]),
        ("slab.botom.roughness=0.1", &["botom", "did you mean `bottom`"]),
        ("slab.bottom.kind=\"ggxx\"", &["slab.bottom.kind", "ggxx", "did you mean `ggx`"]),
        ("slab.svbtdf=\"leaf.npz\"", &["svbtdf", "expected"]),
        ("slab.method=\"duel\"", &["slab.method", "duel"]),
        ("tile.geometry={ kind = \"rods\" }", &["slab.top", "tile.geometry", "as a face of a slab"]),
        ("slab.top={ kind = \"table\" }", &["slab.top.path", "nothing"]),
        ("slab.top={ kind = \"table\", path = \"missing.csv\" }", &["missing.csv"]),
        ("slab.top={ kind = \"table\", path = \"zero.csv\" }", &["zero.csv", "sums to 0"]),
        ("slab.top={ kind = \"table\", path = \"long.csv\" }", &["long.csv", "square"]),
        ("slab.top={ kind = \"tile\", scene = \"none.toml\" }", &["none.toml"]),
    ] {
        eval("slab.toml", &[set], parts);
    }
    eval("circle.toml", &[], &["slab.top.scene", "circle"]);
    folder.assert_refused(&["basis", "slab.toml"], &["slab", "basis"]);
    folder.assert_refused(&["profile", "slab.toml", "--edit", "brdf"], &["--edit", "face, eta, thickness or camera"]);
    folder.assert_refused(&["profile", "slab_window", "--edit", "face"], &["slab.top", "no numeric parameter"]);
    folder.assert_refused(&["profile", "default", "--edit", "eta"], &["slab", "no numeric parameter"]);
    folder.assert_refused(&["fit", "slab.toml", "-o", "out.png"], &["output", "render"]);
    folder.assert_refused(&["export", "slab.toml", "-o", "out.csv"], &["out.csv", ".npz"]);
    folder.assert_refused(&["export", "slab.toml", "-o", "out_mitsuba.xml"], &["slab.top.kind", "tile", "ggx"]);
    folder.assert_refused(&["transmit", "default", "--json"], &["default", "slab", "nothing"]);
    folder.assert_refused(&["transmit", "slab.toml"], &["--output"]);
    folder.assert_refused(&["transmit", "slab.toml", "-o", "out.gif"], &["out.gif", ".csv or .png"]);
    folder.assert_refused(&["transmit", "slab.toml", "--json", "--theta-i", "91"], &["91", "from 0 to 90"]);
    folder.assert_refused(&["transmit", "slab.toml", "-o", "slab.toml"], &["slab.toml"]);
    assert_eq!(folder.files(), before);
}

#[test]
fn bad_backgrounds_are_refused_before_anything_is_computed() {
    let folder = CommandLine::new();
    folder.write("slab.toml", SLAB);
    folder.write("text.png", "no image");
    folder.write("opaque.toml", "background = { kind = \"environment\" }\n[tile]\ngeometry = { kind = \"flat\" }\n");
    let before = folder.files();
    for (set, parts) in [
        (
            "background={ kind = \"checkerbord\" }",
            &["background.kind", "checkerbord", "did you mean `checkerboard`"][..],
        ),
        ("background={ kind = \"checkerboard\", size = 0 }", &["background.size", "0"]),
        ("background={ kind = \"checkerboard\", distance = -1 }", &["background.distance", "-1"]),
        ("background={ kind = \"checkerboard\", distance = nan }", &["background.distance", "nan"]),
        ("background={ kind = \"checkerboard\", colors = [1.0] }", &["background.colors", "2 to 2"]),
        ("background={ kind = \"checkerboard\", colors = [1.0, -1.0] }", &["background.colors", "-1"]),
        ("background={ kind = \"environment\", size = 1 }", &["background", "size"]),
        ("background={ kind = \"image\" }", &["background.path", "nothing", "image file"]),
        ("background={ kind = \"image\", path = \"missing.png\" }", &["missing.png"]),
        ("background={ kind = \"image\", path = \"text.png\" }", &["text.png", "an image"]),
        ("quality.paths=-1", &["quality.paths", "-1"]),
    ] {
        folder.assert_refused(&["render", "slab.toml", "-o", "out.png", "--set", set], parts);
    }
    folder.assert_refused(&["render", "opaque.toml", "-o", "out.png"], &["background", "[slab]"]);
    assert_eq!(folder.files(), before);
}

#[test]
fn render_shows_what_lies_behind_a_slab_and_its_far_parameters_do_no_harm() {
    let folder = CommandLine::new();
    let render = |set: &[&str]| {
        let mut arguments = vec!["render", "slab_window", "-o", "out.exr", "--size", "24x24", "--json", "--quiet"];
        set.iter().for_each(|set| arguments.extend(["--set", *set]));
        folder.json(&arguments)
    };
    let report = render(&[]);
    assert!(report["points"].as_u64().unwrap() > 50, "{report}");
    assert!(report["reads"].as_str().unwrap().starts_with("64 paths"), "{report}");
    for set in [
        "background.distance=0",
        "background.distance=1e6",
        "background.size=1e-3",
        "background.size=1e6",
        "slab.bottom={ kind = \"ggx\", roughness = 1 }",
        "slab.bottom={ kind = \"beckmann\", roughness = [1e-3, 1] }",
        "slab.eta=1.000001",
        "slab.eta=[1, 1.5, 4]",
        "slab.absorption=1e6",
        "slab.thickness=1e6",
        "tile.size=[1e-6, 1e-6]",
        "tile.size=[1e6, 1e6]",
        "camera={ azimuth_deg = 180 }",
    ] {
        for paths in ["quality.paths=0", "quality.paths=2"] {
            render(&[set, paths]);
        }
    }
}

#[test]
fn a_slab_is_exported_to_numpy_and_mitsuba_and_fitted_for_gltf_and_materialx() {
    let folder = CommandLine::new();
    let set = ["--quality", "draft", "--json", "--quiet"];
    let run = |arguments: &[&str]| folder.json(&[arguments, &set].concat());
    let report = run(&["export", "slab_fig3_both", "-o", "slab.npz", "--resolution", "4x8"]);
    assert_eq!(report["pairs"], 3 * 32 * 32);
    run(&["export", "slab_fig3_both", "-o", "slab_mitsuba.xml"]);
    assert!(std::fs::read_to_string(folder.path("slab_mitsuba.xml")).unwrap().contains("roughdielectric"));
    let report = run(&["fit", "slab_fig3_both", "-o", "slab.gltf", "-o", "slab.mtlx"]);
    assert!((0.0..0.8).contains(&report["rel_l2"].as_f64().unwrap()), "{report}");
    assert!(std::fs::read_to_string(folder.path("slab.gltf")).unwrap().contains("KHR_materials_transmission"));
}

#[test]
fn export_writes_four_matrices_for_radiance() {
    let folder = CommandLine::new();
    let report = folder.json(&["export", "slab_fig3_top", "-o", "slab.xml", "--json", "--quiet"]);
    let text = std::fs::read_to_string(folder.path("slab.xml")).unwrap();
    for direction in ["Transmission Front", "Transmission Back", "Reflection Front", "Reflection Back"] {
        let count = text.matches(&format!("<WavelengthDataDirection>{direction}<")).count();
        assert_eq!(count, 3, "{direction}");
    }
    let transmitted = report["transmitted"][1].as_f64().unwrap();
    assert!((transmitted - 0.921).abs() < 0.005, "{report}");
    assert!(std::fs::read_to_string(folder.path("slab.xml.txt")).unwrap().contains("top face"));
}

#[test]
fn a_tabulated_face_and_a_tile_of_another_scene_are_read() {
    let folder = CommandLine::new();
    folder.write("tile.toml", SLAB);
    let row = |y: i32| {
        let value = |x: i32| (-0.02 * f64::from((x - 16) * (x - 16) + (y - 16) * (y - 16))).exp().to_string();
        (0..33).map(value).collect::<Vec<_>>().join(",")
    };
    folder.write("slopes.csv", (0..33).map(row).collect::<Vec<_>>().join("\n"));
    folder.write(
        "slab.toml",
        "[tile]\ngeometry = { kind = \"flat\" }\n[quality]\npreset = \"draft\"\n[slab.top]\nkind = \"table\"\npath = \"slopes.csv\"\n\
         span = 0.6\n[slab.bottom]\nkind = \"tile\"\nscene = \"tile.toml\"\nrotation_deg = 30\n",
    );
    let report = folder.json(&["transmit", "slab.toml", "--json", "--quiet", "--theta-i", "20"]);
    let transmitted = report["totals"]["transmitted"].as_f64().unwrap();
    assert!((0.7..0.95).contains(&transmitted), "{report}");
    assert!((PI / 9.0).sin() + report["lobe"]["mean"][0].as_f64().unwrap() < 0.05, "{report}");
}
