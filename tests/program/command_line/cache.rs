//! Results that are cached between runs.

use serde_json::Value;

use super::folder::CommandLine;

const SCENE: &str = "table4_skirt";
/// Visibility and table take several times the least duration of what is cached (100 ms).
const SLOW: [&str; 4] = ["--set", "quality.facets=32768", "--set", "quality.azimuths=64"];

#[test]
fn a_second_run_reads_the_cache_of_the_first_and_writes_the_same_bytes() {
    let folder = CommandLine::new();
    let cache = folder.path("cached");
    let json = |arguments: &[&str], cache: &str| -> Value {
        let output = folder.run_with(arguments, &[("BISCALE_CACHE", cache)]);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let on = cache.to_str().unwrap();
    let usage = || json(&["cache", "--json"], on);
    let render = |image: &str, cache: &str, more: &[&str]| {
        let common = ["render", SCENE, "-o", image, "--size", "48x48", "--backend", "cpu", "--json", "--quiet"];
        let report = json(&[&common[..], &SLOW[..], more].concat(), cache);
        let has = |name: &str| report["stages"].get(name).is_some();
        let computed = [has("visibility"), has("picture_table")];
        assert_eq!([has("cached_visibility"), has("cached_picture_table")], computed.map(|computed| !computed));
        (computed, std::fs::read(folder.path(image)).unwrap())
    };
    assert_eq!(usage()["files"], 0);
    let first = render("first.png", on, &[]);
    assert_eq!(first.0, [true, true]);
    let filled = usage();
    assert!(filled["files"].as_u64().unwrap() >= 2 && filled["bytes"].as_u64().unwrap() > 1_000_000, "{filled}");
    assert_eq!(filled["folder"].as_str(), Some(on));
    assert_eq!(render("second.png", on, &[]), ([false, false], first.1.clone()));
    assert_eq!(render("off.png", "off", &[]), first);
    assert_eq!(render("no_cache.png", on, &["--no-cache"]), first);
    assert_eq!(usage(), filled);
    // `profile` computes every stage that it times.
    let profile = ["profile", SCENE, "--repeat", "1", "--backend", "cpu", "--json", "--quiet"];
    let profile = json(&[&profile[..], &SLOW[..]].concat(), on);
    assert!(profile["stages"].get("visibility").is_some(), "{profile}");
    let cleared = json(&["cache", "--clear", "--json"], on);
    assert_eq!((&cleared["files"], &cleared["removed"]["files"]), (&0.into(), &filled["files"]));
    assert_eq!(json(&["cache", "--json"], "off")["folder"], Value::Null);
}

#[test]
fn a_cache_that_cannot_be_written_is_one_note() {
    let folder = CommandLine::new();
    let blocked = folder.write("file", "no folder").join("cache");
    let arguments = ["render", SCENE, "-o", "a.png", "--size", "16x16", "--backend", "cpu"];
    let output = folder.run_with(&arguments, &[("BISCALE_CACHE", blocked.to_str().unwrap())]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    assert_eq!(message.matches("could not be cached").count(), 1, "{message}");
}
