//! Pickers with images, and pictures of the gallery that are dragged onto a material.

use crate::scene::OBJECT_KINDS;
use eframe::egui::Role;
use egui_kittest::kittest::Queryable;

use super::{editor, quick, tall, wait_until};
use crate::app::worker::Subject;

#[test]
fn the_picker_of_surfaces_shows_an_image_of_each_kind_and_a_click_takes_one() {
    let mut harness = tall(quick());
    harness.get_by(|node| node.role() == Role::ComboBox && node.value() == Some("Grooves".into())).click();
    let kinds = ["grooves", "pyramids", "rods", "weave", "heightfield", "flat"].map(Subject::Surface);
    wait_until(&mut harness, move |editor| kinds.iter().all(|kind| editor.thumbnails.has_image(*kind)));
    let (mesh, object) = (Subject::Surface("mesh"), Subject::Object(OBJECT_KINDS[1]));
    let thumbnails = editor(&mut harness).thumbnails.clone();
    assert!(!thumbnails.has_image(mesh), "a mesh needs a file");
    assert!(!thumbnails.has_image(object), "what no picker shows is not rendered");
    harness.get_by_label("Pyramids").click();
    harness.run_steps(3);
    assert_eq!(editor(&mut harness).document.scene().tile.geometry.kind(), "pyramids");
    assert!(harness.query_by_label("Weave").is_none(), "the picker is closed");
}

#[test]
fn a_picture_of_the_gallery_that_is_dropped_on_a_material_gives_it_the_material_of_that_scene() {
    let mut harness = tall(quick());
    let shown = editor(&mut harness);
    shown.settings.gallery = true;
    shown.gallery.search = "silver deep".to_owned();
    harness.run_steps(3);
    let before = editor(&mut harness).document.scene().clone();
    let picture = harness.get_by_label("Silver deep").rect().center();
    let slot = harness.get_by_label("Bottom").rect().center();
    harness.drag_at(picture);
    harness.run_steps(2);
    for part in [0.3, 0.7, 1.0] {
        harness.hover_at(picture + part * (slot - picture));
        harness.run_steps(2);
    }
    harness.drop_at(slot);
    harness.run_steps(3);
    let source = crate::scene::open("fig1c_silver_deep", &[]).unwrap().scene;
    let shown = editor(&mut harness);
    let taken = shown.document.scene().materials.iter().find(|material| material.name == "bottom").unwrap();
    assert_eq!((&taken.brdf, taken.color), (&source.materials[0].brdf, source.materials[0].color));
    assert_ne!(taken.brdf, before.materials[0].brdf);
    assert_eq!(shown.document.undo_name(), Some("Take a material of the gallery"));
    shown.document.undo();
    assert_eq!(*shown.document.scene(), before, "the scene itself is not opened");
}
