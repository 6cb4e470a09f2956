//! Warnings: each problem has one that names a remedy, and a sound scene has none.

use biscale::diagnostics::Health;
use biscale::pipeline::Pipeline;
use biscale::scene;
use biscale::scene::{LoadedScene, Painted};

fn health(tile: &str, brdf: &str, quality: &str) -> Health {
    let text = format!(
        "[tile]\ngeometry = {tile}\n[[material]]\nname = \"paint\"\nbrdf = {brdf}\n[[material]]\nname = \"default\"\nbrdf = \
         {brdf}\n[quality]\npreset = \"draft\"\nbackend = \"cpu\"\n{quality}\n"
    );
    let scene = scene::parse(&text).unwrap();
    let loaded = LoadedScene { scene, base_dir: "".into(), name: String::new(), painted: Painted::default() };
    Pipeline::new().effective(&loaded).unwrap().health().clone()
}

const DIFFUSE: &str = r#"{ kind = "lambertian", albedo = 0.7 }"#;
const PYRAMIDS: &str = r#"{ kind = "pyramids" }"#;

#[test]
fn sound_scenes_have_no_warnings() {
    for (tile, brdf) in [
        (PYRAMIDS, DIFFUSE),
        (PYRAMIDS, r#"{ kind = "cook_torrance", roughness = 0.2, f0 = 0.9 }"#),
        (r#"{ kind = "flat" }"#, r#"{ kind = "ggx", roughness = 0.1, f0 = 0.9 }"#),
        (r#"{ kind = "grooves" }"#, r#"{ kind = "ward", roughness = 0.3, specular = 0.5 }"#),
    ] {
        let health = health(tile, brdf, "");
        assert!(health.warnings.is_empty(), "{tile} {brdf}: {:?}", health.warnings);
        assert_eq!((health.result.unsound_values, health.surface.triangles_left_out), (0, 0));
        assert!(health.result.projected_area_error.is_some_and(|error| error < 0.15) && !health.surface.has_holes);
        let albedo = health.result.largest_albedo.unwrap_or(0.5);
        assert!(albedo > 0.05 && albedo <= 1.0, "{albedo}");
    }
}

#[test]
fn each_weakness_of_a_result_has_a_warning_that_names_a_remedy() {
    let narrow = r#"{ kind = "cook_torrance", roughness = 0.003, f0 = 0.9 }"#;
    let threads = r#"{ kind = "weave" }"#;
    for (tile, brdf, quality, problem, remedy) in [
        (PYRAMIDS, r#"{ kind = "lambertian", albedo = 3 }"#, "", "3.000 times the light", "albedo"),
        (threads, narrow, "facets = 512\nmethod = \"direct\"", "facets at a time", "quality.facets"),
        (threads, narrow, "facets = 512\nmethod = \"low_rank\"", "does not resolve the narrowest lobe", "roughness"),
        (r#"{ kind = "pyramids", height = 100 }"#, DIFFUSE, "", "facets are visible", "shallower"),
        (
            r#"{ kind = "rods", count = 8, radius = 3, length = 1 }"#,
            DIFFUSE,
            "facets = 64",
            "facets are visible",
            "quality.facets",
        ),
        (PYRAMIDS, DIFFUSE, "facets = 16", "facets are visible", "quality.facets"),
    ] {
        let warnings = health(tile, brdf, quality).warnings;
        let found = warnings.iter().any(|text| text.contains(problem) && text.contains(remedy));
        assert!(found, "{tile} {brdf} {quality}: {warnings:?}");
    }
}
