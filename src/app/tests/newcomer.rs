//! First tasks of a new user: the gallery, a measured BRDF, names for a screen reader.

use crate::export::tile::TileOptions;
use crate::scene::{BrdfSpec, Geometry, TermSpec};
use eframe::egui::{self, Key};
use egui_kittest::kittest::Queryable;
use glam::Vec3;

use super::{editor, harness, quick, settle, wait_until};
use crate::app::actions::Action;
use crate::app::dialogs::Dialog;
use crate::app::editor::Editor;
use crate::app::paint::Tool;
use crate::app::worker::TableChoice;

#[test]
fn the_gallery_is_searched_by_words_and_reports_when_nothing_matches() {
    let mut harness = harness(quick());
    editor(&mut harness).settings.gallery = true;
    editor(&mut harness).gallery.search = "velvet UP".to_owned();
    harness.run_steps(3);
    assert!(harness.query_by_label("Velvet up").is_some() && harness.query_by_label("Pearl cup").is_none());
    editor(&mut harness).gallery.search = "spaceship".to_owned();
    harness.run_steps(2);
    assert!(harness.query_by_label("No scene matches \"spaceship\".").is_some());
    harness.get_by_label("Show all").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("Velvet up").is_some() && harness.query_by_label("Default").is_some());
}

#[test]
fn a_dropped_measured_brdf_resets_the_colour_of_the_material_with_a_note() {
    let path = std::path::PathBuf::from("/nowhere/paint.bsdf");
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.materials[0].color = Vec3::new(0.1, 0.2, 0.9);
    editor(&mut harness).document.edit(scene.clone());
    editor(&mut harness).document.rest();
    editor(&mut harness).dropped(&ctx, path.clone());
    let editor = editor(&mut harness);
    let material = editor.document.scene().materials[0].clone();
    assert_eq!((material.brdf, material.color), (Some(BrdfSpec::One(TermSpec::Rgl { path })), Vec3::ONE));
    assert!(editor.messages.texts().iter().any(|text| text.contains("white")), "{:?}", editor.messages.texts());
    editor.document.undo();
    assert_eq!(**editor.document.scene(), scene);
}

#[test]
fn escape_closes_the_help() {
    let mut harness = harness(quick());
    harness.key_press(Key::F1);
    harness.run_steps(2);
    assert!(matches!(editor(&mut harness).dialog, Some(Dialog::Help)));
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    assert!(editor(&mut harness).dialog.is_none());
}

#[test]
fn every_control_of_every_panel_and_dialog_has_a_name() {
    let mut harness = harness(quick());
    harness.set_size(egui::vec2(1500.0, 3600.0));
    editor(&mut harness).settings.gallery = true;
    settle(&mut harness);
    harness.get_by_label("Cost").click();
    harness.run_steps(4);
    harness.get_by_label("Quality").click();
    harness.run_steps(4);
    harness.check_accessibility();
    harness.key_press(Key::F5);
    harness.run_steps(2);
    harness.get_by_label("Camera").click();
    harness.run_steps(4);
    harness.check_accessibility();
    for kind in ["pyramids", "rods", "weave", "flat", "heightfield"] {
        let mut scene = (**editor(&mut harness).document.scene()).clone();
        scene.tile.geometry = Geometry::with_defaults(kind).unwrap();
        if let Geometry::Heightfield(field) = &mut scene.tile.geometry {
            field.path = Some("asset:ripples.png".into());
        }
        editor(&mut harness).document.edit(scene);
        harness.run_steps(3);
        harness.check_accessibility();
    }
    editor(&mut harness).tile.set_painting(true);
    for tool in Tool::ALL {
        editor(&mut harness).tile.brush.tool = tool;
        harness.run_steps(2);
        harness.check_accessibility();
    }
    let ctx = harness.ctx.clone();
    for action in [
        Action::Help,
        Action::About,
        Action::Open,
        Action::ExportTable,
        Action::ExportTile,
        Action::ExportImage,
        Action::Quit,
    ] {
        editor(&mut harness).action(&ctx, action);
        harness.run_steps(3);
        assert!(editor(&mut harness).dialog.is_some());
        harness.check_accessibility();
        editor(&mut harness).dialog = None;
    }
    for path in ["a.npz", "a.xml"] {
        let choice = TableChoice::default();
        editor(&mut harness).dialog = Some(Dialog::Table { path: path.into(), choice });
        harness.run_steps(3);
        harness.check_accessibility();
    }
    editor(&mut harness).dialog = Some(Dialog::Fit { path: "a.gltf".into() });
    harness.run_steps(3);
    harness.check_accessibility();
    for path in ["a.obj", "a.stl"] {
        editor(&mut harness).dialog = Some(Dialog::Tile { path: path.into(), options: TileOptions::default() });
        harness.run_steps(3);
        harness.check_accessibility();
    }
    editor(&mut harness).dialog = Some(Dialog::Image { path: "a.png".into(), width: 64, height: 64 });
    harness.run_steps(3);
    harness.check_accessibility();
}

#[test]
fn a_material_is_pasted_from_another_editor_and_other_text_is_refused() {
    let mut harness = harness(quick());
    let text =
        "name = \"gold\"\ncolor = [1.0, 0.5, 0.1]\n[brdf]\nkind = \"ggx\"\nroughness = 0.1\nf0 = [0.9, 0.7, 0.3]\n";
    harness.event(egui::Event::Paste(text.to_owned()));
    harness.run_steps(2);
    let material = editor(&mut harness).document.scene().materials[0].clone();
    assert_eq!((material.name.as_str(), material.color), ("default", Vec3::new(1.0, 0.5, 0.1)));
    assert_eq!(editor(&mut harness).document.undo_name(), Some("Paste a material"));
    let before = editor(&mut harness).document.scene().clone();
    for text in ["hello", "name = \"x\"\ncolor = [nan, 0.0, 0.0]\n"] {
        harness.event(egui::Event::Paste(text.to_owned()));
        harness.run_steps(2);
        assert_eq!(*editor(&mut harness).document.scene(), before, "{text}");
        let texts = editor(&mut harness).messages.texts().join("; ");
        assert!(texts.contains("clipboard holds no material") || texts.contains("Not changed"), "{texts}");
    }
}

#[test]
fn turning_a_shipped_scene_asks_for_no_save() {
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.camera.get_or_insert_default().azimuth_deg = 77.0;
    scene.light.rotation_deg = 12.0;
    let editor = editor(&mut harness);
    editor.document.edit(scene.clone());
    assert!(editor.document.is_dirty() && !editor.document.has_work());
    editor.action(&ctx, Action::New);
    assert!(editor.dialog.is_none() && editor.document.name == "default");
    let mut scene = (**editor.document.scene()).clone();
    scene.light.count = 3;
    editor.document.edit(scene);
    editor.action(&ctx, Action::New);
    assert!(matches!(editor.dialog, Some(Dialog::Unsaved(_))));
}

#[test]
fn opening_a_scene_without_materials_changes_nothing() {
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::OpenShipped("slab_window".to_owned()));
    harness.run_steps(4);
    let editor = editor(&mut harness);
    assert!(editor.document.scene().materials.is_empty() && !editor.document.is_dirty());
}

#[test]
fn the_ending_of_a_typed_measured_file_selects_its_kind() {
    let mut document = quick();
    let mut scene = (**document.scene()).clone();
    scene.materials[0].brdf = Some(BrdfSpec::One(TermSpec::Merl { path: "gold.binary".into() }));
    document.edit(scene);
    let mut harness = harness(document);
    let field =
        harness.get_by(|node| node.role() == egui::Role::TextInput && node.value() == Some("gold.binary".into()));
    field.click();
    harness.run_steps(2);
    harness.key_press_modifiers(egui::Modifiers::COMMAND, Key::A);
    harness.event(egui::Event::Text("silk.bsdf".to_owned()));
    harness.run_steps(2);
    harness.key_press(Key::Enter);
    harness.run_steps(2);
    let brdf = editor(&mut harness).document.scene().materials[0].brdf.clone();
    assert_eq!(brdf, Some(BrdfSpec::One(TermSpec::Rgl { path: "silk.bsdf".into() })));
}

#[test]
fn one_click_takes_one_of_nine_variants_and_one_undo_brings_the_scene_back() {
    let mut harness = harness(quick());
    settle(&mut harness);
    let before = editor(&mut harness).document.scene().clone();
    harness.key_press(Key::V);
    wait_until(&mut harness, |editor| match &editor.dialog {
        Some(Dialog::Vary(variants)) => variants.is_complete(),
        _ => false,
    });
    harness.check_accessibility();
    harness.get_by_label("Nine others").click();
    harness.run_steps(2);
    harness.get_by_label("Variant 3").click();
    harness.run_steps(3);
    let editor = editor(&mut harness);
    assert!(editor.dialog.is_none() && editor.document.undo_name() == Some("Vary"));
    let Geometry::Grooves(varied) = &editor.document.scene().tile.geometry else { panic!("another kind of surface") };
    let Geometry::Grooves(old) = &before.tile.geometry else { panic!("no grooves") };
    let change = (varied.depth / old.depth - 1.0).abs();
    assert!(change > 0.0 && change <= 0.2001, "{change}");
    editor.document.undo();
    assert_eq!(*editor.document.scene(), before);
}

#[test]
fn a_right_click_on_a_slider_offers_its_default_and_a_fraction_can_be_typed() {
    let mut harness = harness(quick());
    settle(&mut harness);
    let depth = |editor: &Editor| match &editor.document.scene().tile.geometry {
        Geometry::Grooves(grooves) => grooves.depth,
        _ => panic!("another kind of surface"),
    };
    let start = depth(editor(&mut harness));
    let row = harness.get_by_role_and_label(egui::Role::Slider, "Depth").rect().center().y;
    let in_row = |rect: egui::Rect| (rect.center().y - row).abs() < 8.0 && rect.left() > 1000.0;
    harness.get_all_by_role(egui::Role::SpinButton).find(|number| in_row(number.rect())).unwrap().click();
    harness.run_steps(2);
    harness.key_press_modifiers(egui::Modifiers::COMMAND, Key::A);
    harness.event(egui::Event::Text("1/3".to_owned()));
    harness.run_steps(2);
    harness.key_press(Key::Enter);
    harness.run_steps(3);
    assert!((depth(editor(&mut harness)) - 1.0 / 3.0).abs() < 1e-3, "{}", depth(editor(&mut harness)));
    harness.get_by_role_and_label(egui::Role::Slider, "Depth").click_secondary();
    harness.run_steps(3);
    assert!((depth(editor(&mut harness)) - 1.0 / 3.0).abs() < 1e-3, "a right click moves nothing");
    harness.get_by_label_contains("Reset to").click();
    harness.run_steps(3);
    assert_eq!(depth(editor(&mut harness)), start);
}
