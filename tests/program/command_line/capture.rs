//! Captured sheets: photographs of a known slab, the sheet that comes back, and errors for bad input.

use super::folder::{CommandLine, rows};

const RIG: [&str; 11] =
    ["rig", "slab_fig3_both", "-o", "rig", "--dots", "20x20", "--pixels", "5x4", "--noise", "0.01", "--quiet"];

#[test]
fn a_sheet_captured_from_the_photographs_of_a_slab_has_its_lobe() {
    let folder = CommandLine::new();
    let made = folder.json(&[&RIG[..], &["--set", "slab.method=\"dual\"", "--json"]].concat());
    assert_eq!(made["images"], 400, "{made}");
    let report = folder.json(&["capture", "rig", "-o", "a.npz", "-o", "a.toml", "-o", "a.png", "--json", "--quiet"]);
    let figure = |name: &str| report["figures"][name].as_f64().unwrap();
    assert!((figure("alpha") - 0.5).abs() < 0.05 && figure("residual") < 0.03, "{report}");
    assert!(figure("representatives") >= 8.0 && figure("diffuse") < 0.05, "{report}");
    assert!(std::fs::read(folder.path("a.png")).unwrap().starts_with(b"\x89PNG"));
    let lobe = |scene: &str, more: &[&str]| {
        folder.json(&[&["transmit", scene, "--theta-i", "20", "--json", "--quiet"], more].concat())
    };
    let (found, known) = (lobe("a.toml", &[]), lobe("slab_fig3_both", &["--method", "dual"]));
    let part = |report: &serde_json::Value| report["totals"]["transmitted"].as_f64().unwrap();
    assert!((part(&found) / part(&known) - 1.0).abs() < 0.08, "{found} {known}");
    let mean = |report: &serde_json::Value, k: usize| report["lobe"]["mean"][k].as_f64().unwrap();
    assert!((mean(&found, 0) - mean(&known, 0)).abs() < 0.01 && mean(&found, 1).abs() < 0.01, "{found}");
    assert_eq!(found["totals"]["straight"].as_f64(), Some(0.0));
    // The BTDF is reciprocal, and there is no reflection.
    folder.write("pairs.csv", "theta_i,phi_i,theta_o,phi_o\n0.5,0,2.7,3.1\n2.7,3.1,0.5,0\n0.5,0,0.4,3\n");
    let values = rows(&folder.text(&["eval", "a.toml", "--pairs", "pairs.csv", "-o", "-", "--quiet"]));
    let btdf = |row: &[f64]| row[4] / row[0].cos().abs();
    assert!((btdf(&values[0]) / btdf(&values[1]) - 1.0).abs() < 1e-5 && values[2][4] == 0.0, "{values:?}");
    let plan = folder.json(&["plan", "a.toml", "--json", "--quiet"]);
    assert!(plan["effects"][0]["reason"].as_str().unwrap().contains("captured"), "{plan}");
    folder.assert_refused(&["transmit", "a.toml", "--method", "truth", "--json"], &["svbtdf", "no faces"]);
    folder.assert_refused(&["rig", "a.toml", "-o", "rig2", "--source", "truth"], &["--source", "no faces"]);
    folder.assert_refused(
        &["eval", "a.toml", "--pairs", "pairs.csv", "-o", "-", "--set", "slab.top={ kind = \"ggx\" }"],
        &["slab", "svbtdf", "`top`"],
    );
}

#[test]
fn the_same_photographs_and_seed_give_the_same_bytes() {
    let folder = CommandLine::new();
    folder.text(&RIG);
    let first = std::fs::read(folder.path("rig/camera_0/dot_0007.exr")).unwrap();
    folder.text(&RIG);
    assert_eq!(std::fs::read(folder.path("rig/camera_0/dot_0007.exr")).unwrap(), first);
    let capture = |name: &str, threads: &str| {
        let output = folder.run_with(&["capture", "rig", "-o", name, "--quiet"], &[("RAYON_NUM_THREADS", threads)]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read(folder.path(name)).unwrap()
    };
    assert_eq!(capture("a.npz", "1"), capture("b.npz", "3"));
}

#[test]
fn bad_folders_outputs_and_sheets_are_refused_and_nothing_is_written() {
    let folder = CommandLine::new();
    let capture = ["capture", "rig", "-o", "a.npz"];
    folder.assert_refused(&capture, &["rig.toml"]);
    folder.text(&RIG);
    let rig = std::fs::read_to_string(folder.path("rig/rig.toml")).unwrap();
    let cases = [
        (rig.replace("eta = 1.5\n", ""), &["rig.toml", "eta", "nothing"][..]),
        (rig.replace("eta = 1.5", "eta = 0.5"), &["eta", "0.5"]),
        (rig.replace("-0.7071067811865476]", "0.7]"), &["camera.0.direction", "below the sheet"]),
        (rig.replace("distance", "distanc"), &["did you mean `distance`"]),
        (rig.replace("[20, 20]", "[21, 20]"), &["400 of 420 images", "dot_0400.exr"]),
    ];
    for (text, parts) in cases {
        std::fs::write(folder.path("rig/rig.toml"), text).unwrap();
        folder.assert_refused(&capture, parts);
    }
    std::fs::write(folder.path("rig/rig.toml"), &rig).unwrap();
    folder.assert_refused(&["capture", "rig", "-o", "a.toml"], &["no .npz"]);
    folder.assert_refused(&["capture", "rig", "-o", "a.npz", "-o", "a.obj"], &["ending .obj"]);
    folder.assert_refused(&["capture", "rig", "-o", "a.npz", "--alpha", "1.5"], &["1.5"]);
    folder.assert_refused(&["capture", "rig", "-o", "a.npz", "-o", "rig/camera_0/dot_0003.exr"], &["an input ("]);
    folder.assert_refused(&["rig", "default", "-o", "other"], &["slab"]);
    let image = folder.path("rig/camera_0/dot_0003.exr");
    let bytes = std::fs::read(&image).unwrap();
    std::fs::write(&image, &bytes[..bytes.len() / 2]).unwrap();
    folder.assert_refused(&capture, &["dot_0003.exr"]);
    folder.write("sheet.npz", b"no archive");
    let scene = "[tile]\ngeometry = { kind = \"flat\" }\n[slab]\nsvbtdf = \"sheet.npz\"\n";
    folder.write("sheet.toml", scene);
    folder.assert_refused(&["transmit", "sheet.toml", "--json"], &["sheet.npz", "ZIP"]);
    assert_eq!(folder.files(), ["rig", "sheet.npz", "sheet.toml"]);
}
