use glam::Vec2;

use crate::pipeline::{Pipeline, StageTimes};
use crate::scene::{self, LoadedScene};

/// The direction across the grooves of a geometry.
fn across(geometry: &str) -> Option<Vec2> {
    let source = format!(
        "[tile]\ngeometry = {{ {geometry} }}\n[[material]]\nname = \"default\"\n\
         brdf = {{ kind = \"lambertian\", albedo = 0.5 }}\n"
    );
    let scene = scene::parse(&source).unwrap();
    let painted = scene::Painted::default();
    let loaded = LoadedScene { scene, base_dir: "".into(), name: "test".to_owned(), painted };
    Pipeline::new().tile(&loaded, &mut StageTimes::new()).unwrap().across
}

#[test]
fn grooves_in_any_direction_are_recognized() {
    for (geometry, expected) in [
        (r#"kind = "grooves""#, Vec2::X),
        (r#"kind = "grooves", profile = "u", depth = 0.4"#, Vec2::X),
        (r#"kind = "grooves", profile = "rectangular", rotation_deg = 90"#, Vec2::Y),
        (r#"kind = "grooves", profile = "u", count = 4, rotation_deg = 27"#, Vec2::new(2.0, 1.0)),
        (r#"kind = "heightfield", values = [[0.0, 0.3, 0.1]]"#, Vec2::X),
    ] {
        let found = across(geometry).unwrap();
        let along = found.perp_dot(expected) / expected.length();
        assert!((found.length() - 1.0).abs() < 1e-6 && along.abs() < 1e-5, "{geometry}: {found}");
    }
}

#[test]
fn surfaces_that_change_in_every_direction_have_no_grooves() {
    for geometry in [
        r#"kind = "flat""#,
        r#"kind = "pyramids""#,
        r#"kind = "weave""#,
        r#"kind = "heightfield", values = [[0.0, 0.3], [0.1, 0.2]]"#,
    ] {
        assert_eq!(across(geometry), None, "{geometry}");
    }
}
