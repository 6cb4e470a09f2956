//! Stages that an edit runs: those downstream of it, and no others.

use std::path::PathBuf;

use biscale::pipeline::Pipeline;
use biscale::scene;
use biscale::scene::LoadedScene;
use glam::Vec3;

fn open(overrides: &[&str]) -> LoadedScene {
    let source = r#"
[tile]
geometry = { kind = "grooves", profile = "v", count = 4, depth = 0.1, side_angle_deg = 40 }
[[material]]
name = "default"
brdf = { kind = "cook_torrance", roughness = 0.3, f0 = 0.9 }
[quality]
preset = "draft"
facets = 512
backend = "cpu"
[effects]
interreflection = "off"
"#;
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    LoadedScene {
        scene: scene::load_with_overrides(source, &overrides).unwrap(),
        base_dir: PathBuf::new(),
        name: "test".to_owned(),
        painted: scene::Painted::default(),
    }
}

fn stages(pipeline: &Pipeline, overrides: &[&str]) -> Vec<&'static str> {
    pipeline.effective(&open(overrides)).unwrap().times.iter().map(|time| time.0).collect()
}

#[test]
fn an_edit_runs_only_the_stages_downstream_of_it() {
    let pipeline = Pipeline::new();
    assert_eq!(stages(&pipeline, &[]), ["geometry", "materials", "facets", "visibility", "product"]);
    assert!(stages(&pipeline, &[]).is_empty(), "the same scene runs no stage");
    assert_eq!(stages(&pipeline, &["material.default.color=[1, 0, 0]"]), ["materials", "product"]);
    assert_eq!(stages(&pipeline, &["material.default.brdf.roughness=0.2"]), ["materials", "product"]);
    // The first materials again, with another groove.
    assert_eq!(
        stages(&pipeline, &["tile.geometry.depth=0.12"]),
        ["geometry", "materials", "facets", "visibility", "product"]
    );
    assert_eq!(stages(&pipeline, &["tile.geometry.depth=0.11"]), ["geometry", "facets", "visibility", "product"]);
    assert_eq!(stages(&pipeline, &["tile.geometry.depth=0.11", "quality.penumbra_deg=2"]), ["visibility", "product"]);
    let facets = ["tile.geometry.depth=0.11", "quality.penumbra_deg=2", "quality.facets=400"];
    assert_eq!(stages(&pipeline, &facets), ["facets", "visibility", "product"]);
    assert!(
        stages(&pipeline, &[&facets[..], &["camera.fov_deg=20"]].concat()).is_empty(),
        "the camera is downstream of the effective BRDF"
    );
}

#[test]
fn an_edit_gives_the_result_of_a_fresh_pipeline() {
    let directions = (Vec3::new(0.3, 0.1, 0.9).normalize_or_zero(), Vec3::new(-0.5, 0.2, 0.6).normalize_or_zero());
    let edited = Pipeline::new();
    for overrides in [
        &[][..],
        &["material.default.color=[1, 0, 0]"],
        &["tile.geometry.depth=0.2"],
        &["tile.geometry.depth=0.2", "material.default.brdf.roughness=0.5"],
        &["quality.seed=9"],
        &["quality.seed=9", "quality.method=\"low_rank\""],
        &["quality.seed=9", "quality.method=\"low_rank\"", "material.default.brdf.f0=[0.9, 0.5, 0.1]"],
        &["quality.seed=9", "quality.method=\"low_rank\"", "material.default.color=[0.2, 0.3, 0.4]"],
        &[],
    ] {
        let scene = open(overrides);
        let one = edited.effective(&scene).unwrap().brdf.eval(directions.0, directions.1);
        let other = Pipeline::new().effective(&scene).unwrap().brdf.eval(directions.0, directions.1);
        assert_eq!(one, other, "{overrides:?}");
        assert!(one.max_element() > 0.0);
    }
}

/// Doubling a colour doubles the result of every representation.
#[test]
fn the_effective_brdf_is_linear_in_the_colour() {
    let directions = (Vec3::new(0.3, 0.1, 0.9).normalize_or_zero(), Vec3::new(-0.5, 0.2, 0.6).normalize_or_zero());
    for method in ["quality.method=\"direct\"", "quality.method=\"low_rank\""] {
        let value = |color: &str| {
            let scene = open(&[method, color]);
            Pipeline::new().effective(&scene).unwrap().brdf.eval(directions.0, directions.1)
        };
        let (one, two) =
            (value("material.default.color=[0.5, 0.25, 0.1]"), value("material.default.color=[1, 0.5, 0.2]"));
        assert!((2.0 * one - two).abs().max_element() < 1e-6 * two.max_element(), "{method}: {one} {two}");
    }
}

/// The reference requests mesh and materials of the same pipeline. Later results must not reuse those of another scene.
#[test]
fn requests_for_mesh_or_materials_alone_leave_no_stale_result() {
    let directions = (Vec3::new(0.3, 0.1, 0.9).normalize_or_zero(), Vec3::new(-0.5, 0.2, 0.6).normalize_or_zero());
    let pipeline = Pipeline::new();
    pipeline.effective(&open(&[])).unwrap();
    let scenes: [&[&str]; 4] = [
        &["material.default.brdf.roughness=0.5"],
        &["tile.geometry.depth=0.2"],
        // A wide lobe, because the paper's tables of a narrow one take seconds.
        &["quality.preset=\"wu2011\"", "material.default.brdf.roughness=0.6"],
        &["tile.geometry.depth=0.3"],
    ];
    for overrides in scenes {
        let scene = open(overrides);
        pipeline.materials(&scene).unwrap();
        pipeline.mesh(&scene).unwrap();
        let one = pipeline.effective(&scene).unwrap().brdf.eval(directions.0, directions.1);
        let other = Pipeline::new().effective(&scene).unwrap().brdf.eval(directions.0, directions.1);
        assert_eq!(one, other, "{overrides:?}");
    }
}
