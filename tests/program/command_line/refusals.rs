//! Errors for bad input, which leave all files as they are.

use super::folder::{CommandLine, FLAT, GROOVES, PAIRS, name};

#[test]
fn invalid_scenes_are_refused_with_file_field_found_and_expected() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
    let eval = |scene: &str, parts: &[&str]| {
        folder.assert_refused(&["eval", scene, "--pairs", "pairs.csv", "-o", "out.csv"], parts);
    };
    eval("missing.toml", &["missing.toml", "found", "expected"]);
    eval("table4_plat", &["did you mean `table4_plate`?"]);
    for (find, replace, parts) in [
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
        folder.write("bad.toml", GROOVES.replacen(find, replace, 1));
        let mut all = vec!["bad.toml"];
        all.extend(parts);
        eval("bad.toml", &all);
    }
    folder.write("grooves.toml", GROOVES);
    folder.assert_refused(&["plan", "grooves.toml", "--set", "tile.geometry.depth=9e9"], &["depth", "expected"]);
    folder.assert_refused(&["plan", "grooves.toml", "--set", "tile.geometry.dept=0.1"], &["dept", "depth"]);
    assert!(!folder.path("out.csv").exists());
}

#[test]
fn damaged_measured_files_and_meshes_are_refused_by_name() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
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
    for (file, bytes, parts) in files {
        folder.write(file, bytes);
        folder.write("scene.toml", if file.ends_with("obj") { mesh(file) } else { merl(file) });
        let mut all = vec![file, "found"];
        all.extend(parts);
        folder.assert_refused(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "out.csv"], &all);
    }
    for (scene, file) in [(merl("none.binary"), "none.binary"), (mesh("none.obj"), "none.obj")] {
        folder.write("scene.toml", scene);
        folder.assert_refused(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "out.csv"], &[file]);
    }
    assert!(!folder.path("out.csv").exists());
}

#[test]
fn bad_pairs_are_refused_with_their_line() {
    let folder = CommandLine::new();
    folder.write("flat.toml", FLAT);
    for (text, parts) in [
        ("", &["line 1", "theta_i,phi_i,theta_o,phi_o"][..]),
        ("theta_i,phi_i,theta_o\n0,0,0\n", &["line 1", "expected"]),
        ("theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n0,0,x,0\n", &["line 3", "`x`", "theta_o"]),
        ("theta_i,phi_i,theta_o,phi_o\n0,0,nan,0\n", &["line 2", "nan"]),
        ("theta_i,phi_i,theta_o,phi_o\n0,0,0\n", &["line 2", "3 values", "4 values"]),
        ("theta_i,phi_i,theta_o,phi_o\n0,0,0,0,0\n", &["line 2", "5 values", "4 values"]),
        ("theta_i,phi_i,theta_o,phi_o\n0.1,0,30,180\n", &["line 2", "`30` for theta_o", "radians"]),
    ] {
        folder.write("pairs.csv", text);
        let mut all = vec!["pairs.csv"];
        all.extend(parts);
        folder.assert_refused(&["eval", "flat.toml", "--pairs", "pairs.csv", "-o", "out.csv"], &all);
    }
    folder.assert_refused(&["eval", "flat.toml", "--pairs", "none.csv", "-o", "out.csv"], &["none.csv"]);
    assert!(!folder.path("out.csv").exists());
}

#[test]
fn a_missing_file_is_named_with_the_scene_and_the_key_that_name_it() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
    let heights = "[tile]\ngeometry = { kind = \"heightfield\", path = \"none.png\" }\n";
    let measured = FLAT.replace("{ kind = \"lambertian\"", "{ kind = \"merl\", path = \"none.binary\" }\n#");
    for (text, key) in [(heights, "tile.geometry.path"), (&measured, "material.default.brdf.path")] {
        folder.write("scene.toml", text);
        let parts = ["scene.toml", key, "`none.", "which does not exist"];
        folder.assert_refused(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "out.csv"], &parts);
    }
    folder.write("scene.toml", heights.replace("none.png", "asset:riples.png"));
    folder.assert_refused(&["plan", "scene.toml"], &["no asset `riples.png`", "did you mean `asset:ripples.png`"]);
}

#[test]
fn an_error_names_the_scene_only_if_it_is_about_a_key_of_the_scene() {
    let folder = CommandLine::new();
    folder.write("flat.toml", FLAT);
    for (arguments, part) in [
        (&["plan", "no_such_scene"][..], "(shipped)"),
        (&["tile", "flat.toml", "-o", "t.obj", "--scale", "1e9"], "flat.toml:"),
        (&["export", "flat.toml", "-o", "a.npz", "--resolution", "5000x8"], "flat.toml:"),
    ] {
        folder.assert_refused(arguments, &["found"]);
        let message = String::from_utf8_lossy(&folder.run(arguments).stderr).into_owned();
        assert!(!message.contains(part), "{arguments:?}: {message}");
    }
    let unit = ["tile", "flat.toml", "-o", "t.stl", "--set", "tile.unit=furlong"];
    folder.assert_refused(&unit, &["flat.toml: tile.unit", "furlong"]);
}

#[test]
fn options_that_exclude_each_other_are_refused() {
    let folder = CommandLine::new();
    folder.write("flat.toml", FLAT);
    folder.write("pairs.csv", PAIRS);
    let eval = ["eval", "flat.toml", "--pairs", "pairs.csv"];
    folder.assert_refused(&[&eval[..], &["-o", "-", "--json"]].concat(), &["--json", "standard output"]);
    folder.assert_refused(&["export", "flat.toml", "-o", "-", "--json"], &["--json", "standard output"]);
    folder.assert_refused(&[&eval[..], &["-o", "out.npz"]].concat(), &["out.npz", ".csv", "biscale export"]);
    let target = ["-o", "out.csv", "--target-db", "40", "--quality", "wu2011"];
    folder.assert_refused(&[&eval[..], &target].concat(), &["--target-db", "wu2011"]);
    folder.assert_refused(&["tile", "flat.toml", "-o", "t.obj", "--target-db", "40"], &["--target-db", "tile"]);
    folder.assert_refused(
        &["export", "flat.toml", "-o", "a.binary", "--resolution", "6x6"],
        &["--resolution", "a.binary"],
    );
    folder.assert_refused(&["filter", "flat.toml", "--side-by-side", "a.jpg"], &["--side-by-side", ".png"]);
    folder
        .assert_refused(&[&eval[..], &["-o", "out.csv", "--seed", "-1"]].concat(), &["--seed", "`-1`", "whole number"]);
    assert_eq!(folder.files(), ["flat.toml", "pairs.csv"]);
}

#[test]
fn a_misspelt_command_is_named_with_its_nearest() {
    let folder = CommandLine::new();
    for arguments in [&["rendr", "default", "-o", "x.png"][..], &["rendr", "-o", "x.png", "default"]] {
        folder.assert_refused(arguments, &["the command `rendr`", "did you mean `render`"]);
    }
}

#[test]
fn an_output_that_cannot_be_written_is_refused_and_the_old_file_stays() {
    let folder = CommandLine::new();
    folder.write("flat.toml", FLAT);
    let pairs = folder.write("pairs.csv", PAIRS);
    let nowhere = "no/such/folder/out.csv";
    folder.assert_refused(&["eval", "flat.toml", "--pairs", name(&pairs), "-o", nowhere], &[nowhere]);
    folder.assert_refused(&["render", "flat.toml", "-o", "image.bmp", "--size", "8x8"], &["image.bmp", "png"]);
    // An error leaves the old content of the output file.
    let old = folder.write("old.csv", "mine");
    folder.write("bad.csv", "theta_i,phi_i,theta_o,phi_o\n0,0,x,0\n");
    folder.assert_refused(&["eval", "flat.toml", "--pairs", "bad.csv", "-o", name(&old)], &["bad.csv"]);
    assert_eq!(std::fs::read_to_string(old).unwrap(), "mine");
    assert_eq!(folder.files(), ["bad.csv", "flat.toml", "old.csv", "pairs.csv"]);
}

#[test]
fn wrong_usage_exits_with_code_2_and_names_the_help() {
    let folder = CommandLine::new();
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
        folder.assert_refused(arguments, &["--help"]);
    }
    let version = folder.text(&["--version"]);
    assert!(version.starts_with("biscale "), "{version}");
    assert!(folder.files().is_empty());
}
