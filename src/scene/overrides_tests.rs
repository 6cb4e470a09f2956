use glam::Vec3;
use toml::Table;

use super::tests::{GROOVES, TWO_COLOURS, set};
use super::*;

#[test]
fn overrides_index_by_number_name_and_star_and_create_missing_tables() {
    let scene = set(
        TWO_COLOURS,
        &[
            "tile.geometry.depth = 0.7",
            "material.0.brdf.roughness=0.5",
            "material.sides.color=[0, 0, 1]",
            "camera.fov_deg=50",
            "quality.preset=fine",
        ],
    )
    .unwrap();
    let Geometry::Grooves(grooves) = &scene.tile.geometry else { panic!() };
    assert_eq!(grooves.depth, 0.7);
    assert!(matches!(
        scene.materials[0].brdf.as_ref().unwrap().terms()[0],
        TermSpec::CookTorrance { roughness: 0.5, .. }
    ));
    assert_eq!(scene.materials[1].color, Vec3::Z);
    assert_eq!((scene.camera.unwrap().fov_deg, scene.quality.preset.as_str()), (50.0, "fine"));
    let scene = set(TWO_COLOURS, &["material.*.color=0.5"]).unwrap();
    assert!(scene.materials.iter().all(|material| material.color == Vec3::splat(0.5)));
    let scene = set(GROOVES, &["material.default.brdf={kind=\"ward\"}"]).unwrap();
    assert_eq!(scene.material_for_slot("sides").unwrap().brdf.terms()[0].kind(), "ward");
}

#[test]
fn overrides_replace_an_analytic_brdf_by_a_measured_one_in_several_ways() {
    let expected = TermSpec::Merl { path: "/paints/pearl.binary".into() };
    for overrides in [
        &["material.default.brdf.path=/paints/pearl.binary"][..],
        &["material.0.brdf={ kind = \"merl\", path = \"/paints/pearl.binary\" }"],
        &["material.default.brdf.kind=merl", "material.default.brdf.path=/paints/pearl.binary"],
        &["material.default.brdf.path=/paints/pearl.binary", "material.default.brdf.kind=merl"],
    ] {
        let sum = TWO_COLOURS.replace(
            "{ kind = \"cook_torrance\", roughness = 0.2, f0 = 0.9 }",
            "[{ kind = \"lambertian\" }, { kind = \"ggx\" }]",
        );
        for source in [TWO_COLOURS, &sum] {
            let scene = set(source, overrides).unwrap();
            for slot in ["bottom", "sides"] {
                assert_eq!(scene.material_for_slot(slot).unwrap().brdf.terms(), std::slice::from_ref(&expected));
            }
        }
    }
    for (file, kind) in [("x.bsdf", "rgl"), ("x.bin", "utia"), ("x.npz", "npz")] {
        let scene = set(TWO_COLOURS, &[&format!("material.default.brdf.path={file}")]).unwrap();
        assert_eq!(scene.materials[0].brdf.as_ref().unwrap().terms()[0].kind(), kind);
    }
}

#[test]
fn a_measured_brdf_keeps_its_kind_when_an_override_sets_another_path() {
    for kind in TermSpec::kinds().into_iter().filter(|kind| kind.fields.iter().any(|field| field.required)) {
        let source = format!(
            "{GROOVES}[[material]]\nname = \"default\"\nbrdf = {{ kind = \"{}\", path = \"a.bin\" }}\n",
            kind.kind
        );
        for file in ["b.bin", "b.npz", "b"] {
            let scene = set(&source, &[&format!("material.default.brdf.path={file}")]).unwrap();
            let terms = scene.materials[0].brdf.as_ref().unwrap().terms().to_vec();
            let written = Table::try_from(&terms[0]).unwrap();
            assert_eq!((terms[0].kind(), written["path"].as_str()), (kind.kind, Some(file)));
        }
    }
}

#[test]
fn a_new_geometry_kind_drops_the_old_kinds_keys() {
    let source = "[tile]\ngeometry = { kind = \"grooves\", depth = 0.3, count = 7 }\n";
    let scene = set(source, &["tile.geometry.kind=rods"]).unwrap();
    assert_eq!(scene.tile.geometry, Geometry::Rods(Rods { count: 7, ..Rods::default() }));
}

#[test]
fn wrong_overrides_are_named() {
    for (text, part) in [
        ("tile.geometry.depth", "key.path=value"),
        ("=3", "key.path=value"),
        ("tile..depth=3", "key.path=value"),
        ("tile.geometry.dept=3", "did you mean `depth`?"),
        ("tile.geometry.depth=deep", "\"deep\""),
        ("tile.geometry.depth=nan", "nan"),
        ("tile.geometry.depth.x=1", "a table"),
        ("material.7.color=1", "an index from 0 to 1"),
        ("material.side.color=1", "did you mean `sides`?"),
        ("tile=3", "a table"),
    ] {
        let message = set(TWO_COLOURS, &[text]).unwrap_err().to_string();
        assert!(message.contains("--set") && message.contains(part), "{text}: {message}");
    }
    // The terms of a BRDF have no names.
    let layered = "[tile]\ngeometry = { kind = \"flat\" }\n[[material]]\nname = \"default\"\nbrdf = [{ kind = \"ward\" }, { kind = \"lambertian\" }]\n";
    let message = set(layered, &["material.default.brdf.roughness=0.4"]).unwrap_err().to_string();
    assert!(message.contains("found `roughness`, expected an index from 0 to 1, or `*` for all"), "{message}");
}

#[test]
fn files_named_on_the_command_line_are_found_from_the_working_directory() {
    let scene = set(TWO_COLOURS, &["material.default.brdf={kind=\"merl\", path=\"Cargo.toml\"}"]).unwrap();
    let TermSpec::Merl { path } = &scene.materials[0].brdf.as_ref().unwrap().terms()[0] else { panic!() };
    assert!(path.is_absolute());
    let scene = set(TWO_COLOURS, &["material.default.brdf.path=no/such.binary"]).unwrap();
    assert_eq!(scene.materials[0].brdf.as_ref().unwrap().terms()[0], TermSpec::Merl { path: "no/such.binary".into() });
}

#[test]
fn numbered_materials_are_added_beside_each_other_and_all_brdfs_leave_out_materials_without_one() {
    let source = format!("{GROOVES}[[material]]\nname = \"default\"\nbrdf = {{ kind = \"ggx\" }}\n");
    let set = |texts: &[&str]| set(&source, texts);
    let scene =
        set(&["material.paint_1.color=0.1", "material.paint_2.color=0.2", "material.*.brdf.roughness=0.4"]).unwrap();
    assert_eq!(
        scene.materials.iter().map(|material| &*material.name).collect::<Vec<_>>(),
        ["default", "paint_1", "paint_2"]
    );
    assert!(scene.materials[1].brdf.is_none(), "it has the BRDF of `default`");
    let error = set(&["material.sides.color=0.1", "material.side.color=0.2"]).unwrap_err().to_string();
    assert!(error.contains("did you mean `sides`"), "{error}");
    let error = set(&["material.paint_1.color=0.1", "material.pain_1.color=0.2"]).unwrap_err().to_string();
    assert!(error.contains("did you mean `paint_1`"), "{error}");
}
