//! Results that are kept between runs.

use serde_json::Value;

use crate::desk::Desk;

const SCENE: &str = "table4_skirt";

#[test]
fn a_second_run_reads_what_the_first_one_kept_and_writes_the_same_bytes() {
    let desk = Desk::new();
    let folder = desk.path("kept");
    let json = |arguments: &[&str], cache: &str| -> Value {
        let output = desk.run_with(arguments, &[("BISCALE_CACHE", cache)]);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let on = folder.to_str().unwrap();
    let usage = || json(&["cache", "--json"], on);
    let render = |image: &str, cache: &str, more: &[&str]| {
        let common = ["render", SCENE, "-o", image, "--size", "48x48", "--backend", "cpu", "--json", "--quiet"];
        let report = json(&[&common[..], more].concat(), cache);
        let has = |name: &str| report["stages"].get(name).is_some();
        let made = [has("visibility"), has("picture_table")];
        assert_eq!([has("cached_visibility"), has("cached_picture_table")], made.map(|made| !made));
        (made, std::fs::read(desk.path(image)).unwrap())
    };
    assert_eq!(usage()["files"], 0);
    let first = render("first.png", on, &[]);
    assert_eq!(first.0, [true, true]);
    let kept = usage();
    assert!(kept["files"].as_u64().unwrap() >= 2 && kept["bytes"].as_u64().unwrap() > 1_000_000, "{kept}");
    assert_eq!(kept["folder"].as_str(), Some(on));
    assert_eq!(render("second.png", on, &[]), ([false, false], first.1.clone()));
    assert_eq!(render("off.png", "off", &[]), first);
    assert_eq!(render("no_cache.png", on, &["--no-cache"]), first);
    assert_eq!(usage(), kept);
    // `profile` always makes what it times.
    let profile = json(&["profile", SCENE, "--repeat", "1", "--backend", "cpu", "--json", "--quiet"], on);
    assert!(profile["stages"].get("visibility").is_some(), "{profile}");
    let cleared = json(&["cache", "--clear", "--json"], on);
    assert_eq!((&cleared["files"], &cleared["removed"]["files"]), (&0.into(), &kept["files"]));
    assert_eq!(json(&["cache", "--json"], "off")["folder"], Value::Null);
}

#[test]
fn a_cache_that_cannot_be_written_is_one_note() {
    let desk = Desk::new();
    let blocked = desk.write("file", "no folder").join("cache");
    let arguments = ["render", SCENE, "-o", "a.png", "--size", "16x16", "--backend", "cpu"];
    let output = desk.run_with(&arguments, &[("BISCALE_CACHE", blocked.to_str().unwrap())]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert_eq!(said.matches("nothing could be kept").count(), 1, "{said}");
}
