//! Painted colours and materials, from the pointer to the effective BRDF.

use crate::pipeline::Pipeline;
use crate::scene;
use crate::scene::{LoadedScene, Painted, Pixels};
use glam::{UVec2, Vec2, Vec3};

use super::{editor, harness, quick, settle};
use crate::app::document::Document;
use crate::app::paint::Tool;
use crate::app::views::brushes::{BrushRequest, PaintLayer};
use crate::app::views::tile::TileMode;

fn document(text: &str) -> Document {
    let scene = scene::parse(text).unwrap();
    Document::new(LoadedScene { scene, base_dir: "".into(), name: "test".into(), painted: Painted::default() }, None)
}

#[test]
fn a_tile_that_is_half_painted_reflects_the_mean_of_both_materials() {
    let text = r#"
        [tile]
        geometry = { kind = "flat" }
        [[material]]
        name = "default"
        brdf = { kind = "lambertian", albedo = [0.2, 0.4, 0.6] }
        [[material]]
        name = "paint_2"
        brdf = { kind = "lambertian", albedo = [0.8, 0.2, 0.0] }
        "#;
    let mut loaded = document(text).loaded();
    let values = (0..64 * 64).map(|k| if k % 64 < 32 { 2 } else { 0 }).collect();
    loaded.painted.slots = Some(Pixels { size: UVec2::splat(64), values }.into());
    let brdf = Pipeline::new().effective(&loaded).unwrap().brdf;
    let (i, o) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, -0.6, 0.8));
    let expected = Vec3::new(0.5, 0.3, 0.3) / std::f32::consts::PI * i.z;
    let found = brdf.eval(i, o);
    assert!((found - expected).abs().max_element() < 2e-3, "{found} is not {expected}");
}

#[test]
fn a_material_is_painted_on_any_surface_undone_to_the_start_and_redone_to_the_end() {
    let mut harness = harness(quick());
    settle(&mut harness);
    let editor = editor(&mut harness);
    editor.tile.set_painting(true);
    editor.tile.brush.tool = Tool::Material;
    editor.draw(&[Vec2::splat(0.3), Vec2::splat(0.6)]);
    assert!(editor.tile.show == TileMode::Materials, "clay would hide the stroke");
    editor.tile.brush.slot = 2;
    editor.draw(&[Vec2::new(0.7, 0.2)]);
    editor.tile.brush.tool = Tool::Color;
    editor.draw(&[Vec2::new(0.2, 0.8)]);
    assert!(editor.document.scene().tile.geometry.kind() == "grooves", "the geometry does not change");
    let names: Vec<&str> = editor.document.scene().materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["default", "paint_1", "paint_2"]);
    let end = (editor.document.scene().clone(), editor.document.painted().clone());
    let slots = end.1.slots.clone().unwrap();
    assert!(slots.values.contains(&1) && slots.values.contains(&2) && slots.values.contains(&0));
    assert_eq!(editor.document.undo_name(), Some("Paint colour"));
    let mut steps = 0;
    while editor.document.undo().is_some() {
        steps += 1;
    }
    assert_eq!((editor.document.scene(), editor.document.painted()), (quick().scene(), &Painted::default()));
    for _ in 0..steps {
        editor.document.redo().unwrap();
    }
    assert_eq!((editor.document.scene(), editor.document.painted()), (&end.0, &end.1));
    editor.apply_brush_request(BrushRequest::Clear(PaintLayer::Slots));
    assert!(editor.document.painted().slots.is_none() && editor.document.scene().tile.slot_path.is_none());
    editor.document.undo();
    assert_eq!((editor.document.scene(), editor.document.painted()), (&end.0, &end.1));
    // Turning the light builds no new tile, and the painted slots stay known.
    let mut scene = (**editor.document.scene()).clone();
    scene.light.rotation_deg = 25.0;
    editor.apply_edit(scene);
    assert!(["paint_1", "paint_2"].iter().all(|name| editor.slots.iter().any(|slot| slot == name)));
}

#[test]
fn painted_materials_are_saved_beside_the_scene_named_in_it_and_reopened_equal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("moss.toml");
    let mut harness = harness(quick());
    settle(&mut harness);
    let editor = editor(&mut harness);
    editor.tile.set_painting(true);
    editor.tile.brush.tool = Tool::Material;
    editor.draw(&[Vec2::splat(0.4), Vec2::splat(0.9)]);
    assert_eq!(editor.document.base_name(), None, "no file holds the strokes");
    editor.document.save_as(&path).unwrap();
    assert_eq!(editor.document.base_name().as_deref(), path.to_str());
    assert!(std::fs::read_to_string(&path).unwrap().contains("slot_path = \"moss_materials.png\""));
    let opened = Document::open(path.to_str().unwrap()).unwrap();
    assert_eq!(opened.scene(), editor.document.scene());
    let slots = crate::app::paint::slots_of(&opened.loaded()).unwrap();
    assert_eq!(Some(slots), editor.document.painted().slots.as_deref().cloned());
    let facets = |document: &Document| {
        let loaded = document.loaded();
        let mesh = crate::geometry::build_painted(&loaded.scene.tile, &loaded.base_dir, &loaded.painted).unwrap();
        crate::geometry::Facets::sample(&mesh, 500, 0)
    };
    assert_eq!(facets(&opened), facets(&editor.document));
}
