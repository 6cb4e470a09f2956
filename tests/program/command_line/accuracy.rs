//! Reports, targets, effects and health.

use serde_json::Value;

use super::folder::{CommandLine, GROOVES, PAIRS, rows};

#[test]
fn a_report_has_every_preset_and_continues_an_earlier_run() {
    let folder = CommandLine::new();
    folder.write("tile.toml", "[tile]\ngeometry = { kind = \"flat\" }\n");
    let run = || -> Value {
        let budget = ["--minutes", "0", "--pairs", "16", "--combinations", "1", "--quiet"];
        folder.text(&[&["report", "tile.toml", "-o", "out"], &budget[..]].concat());
        serde_json::from_slice(&std::fs::read(folder.path("out/report.json")).unwrap()).unwrap()
    };
    let report = run();
    let points = report["points"].as_array().unwrap();
    for preset in ["draft", "standard", "fine", "wu2011", "reference"] {
        let point = points.iter().find(|point| point["preset"] == preset).unwrap_or_else(|| panic!("no {preset}"));
        assert_eq!(point["scene"], "tile");
        assert!(point["ms"].as_f64().unwrap() > 0.0 && point["settings"].as_str().unwrap().contains(preset));
        // A flat Lambertian tile has the BRDF of its material; the paper's tables approximate it.
        let (rel_l2, psnr_db) = (point["rel_l2"].as_f64().unwrap(), point["psnr_db"].as_f64().unwrap());
        assert!(if preset == "wu2011" { rel_l2 < 0.3 } else { rel_l2 < 1e-3 && psnr_db > 50.0 }, "{point}");
    }
    assert!(report["scenes"][0]["left_out"].as_u64().unwrap() > 10, "there was no time for single settings");
    let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("data:image/png;base64,") && !page.contains("http://"));
    assert_eq!(std::fs::read_to_string(folder.path("out/report.csv")).unwrap().lines().count(), points.len() + 1);
    let times = |report: &Value| -> Vec<Value> {
        report["points"].as_array().unwrap().iter().map(|point| point["ms"].clone()).collect()
    };
    assert_eq!(times(&run()), times(&report), "the second run reads the times of the first");
}

#[test]
fn every_result_has_its_health_in_json_and_its_warnings_on_standard_error() {
    let folder = CommandLine::new();
    folder.write(
        "gain.toml",
        GROOVES.replace("kind = \"cook_torrance\", roughness = 0.3, f0 = 0.9", "kind = \"lambertian\", albedo = 2"),
    );
    folder.write("pairs.csv", PAIRS);
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
        let output = folder.run(&[arguments, &["--json"]].concat());
        assert!(output.status.success(), "{arguments:?}");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(
            message.lines().any(|line| line.starts_with("warning: ") && line.contains("2.000 times the light")),
            "{message}"
        );
        let json: Value = serde_json::from_slice(&output.stdout).unwrap();
        let warnings = json["health"]["warnings"].as_array().unwrap();
        assert!(warnings.iter().any(|warning| warning.as_str().unwrap().contains("`default`")), "{json}");
        let quiet = folder.run(&[arguments, &["--quiet"]].concat());
        assert!(!String::from_utf8_lossy(&quiet.stderr).contains("warning"), "{arguments:?}");
    }
}

#[test]
fn a_target_prints_the_settings_that_repeat_its_result() {
    let folder = CommandLine::new();
    folder.write("grooves.toml", GROOVES);
    folder.write("pairs.csv", PAIRS);
    let eval = |extra: &[&str]| {
        let output = folder.run(&[&["eval", "grooves.toml", "--pairs", "pairs.csv", "-o", "-"], extra].concat());
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{message}");
        (String::from_utf8(output.stdout).unwrap(), message)
    };
    let (values, message) = eval(&["--target-db", "35"]);
    assert!(message.contains("asked 35.0 dB, got "), "{message}");
    let line = message.lines().find(|line| line.starts_with("asked")).unwrap();
    let flags = line.split(": ").last().unwrap().trim();
    let flags: Vec<&str> = flags.split_whitespace().collect();
    assert_eq!(flags[0], "--quality", "{message}");
    let (again, _) = eval(&flags);
    assert_eq!(values, again, "{flags:?}");
    let (_, message) = eval(&["--budget-ms", "100000"]);
    assert!(message.contains("asked 100000.0 ms, got "), "{message}");
}

#[test]
fn an_effect_can_be_forced_on_and_off_and_the_plan_shows_it() {
    let folder = CommandLine::new();
    folder.write("grooves.toml", GROOVES.replace("depth = 0.1", "depth = 0.4"));
    folder.write("pairs.csv", PAIRS);
    let effect = |extra: &[&str], name: &str| -> Value {
        let plan = folder.json(&[&["plan", "grooves.toml", "--json", "--quiet"], extra].concat());
        plan["effects"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap().clone()
    };
    let off = effect(&["--quality", "standard", "--effect", "interreflection=off"], "interreflection");
    assert!(off["on"] == false && off["left_out"]["share"].as_f64().unwrap() > 0.04, "{off}");
    let auto = effect(&["--quality", "standard"], "interreflection");
    assert_eq!(auto["share"], off["share"], "the share is stated whether the light is computed or not");
    assert!(auto["on"] == true && auto["forced"] == false && auto["reason"].as_str().unwrap().contains('±'), "{auto}");
    assert_eq!(effect(&["--quality", "wu2011"], "interreflection")["on"], false);
    let on = effect(&["--effect", "interreflection=on"], "interreflection");
    assert!(on["on"] == true && on["forced"] == true && on["measured_ms"].as_f64().unwrap() > 0.0, "{on}");
    assert_eq!(effect(&["--effect", "visibility=off"], "visibility")["on"], false);
    assert_eq!(effect(&["--effect", "low_rank=on"], "low_rank")["on"], true);
    let sum = |extra: &[&str]| -> f64 {
        let text = folder.text(&[&["eval", "grooves.toml", "--pairs", "pairs.csv", "-o", "-"], extra].concat());
        rows(&text).iter().map(|row| row[4]).sum()
    };
    let [on, off] = ["on", "off"].map(|state| sum(&["--effect", &format!("interreflection={state}")]));
    assert!(on > 1.01 * off, "interreflection adds light");
    let measured = folder.json(&["plan", "grooves.toml", "--json", "--quiet", "--measure", "--quality", "draft"]);
    let costs = measured["measured"].as_array().unwrap();
    let cost = costs.iter().find(|cost| cost["name"] == "interreflection").unwrap();
    assert!(cost["on_ms"].as_f64().unwrap() > cost["off_ms"].as_f64().unwrap(), "{cost}");
    assert!(cost["rel_l2"].as_f64().unwrap() > 0.005 && cost["mean_delta_e"].as_f64().unwrap() > 0.0, "{cost}");
}
