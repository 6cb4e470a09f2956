//! What a person meets in the first hour: the gallery, a measured paint, an export, a device that is lost.

use biscale::scene::{BrdfSpec, TermSpec};
use eframe::egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;
use glam::Vec3;

use super::{editor, harness, quick, settle};
use crate::app::actions::Action;
use crate::app::dialogs::Dialog;
use crate::app::worker::LOSE_DEVICE;

#[test]
fn the_gallery_is_searched_by_words_and_says_when_nothing_is_found() {
    let mut harness = harness(quick());
    editor(&mut harness).settings.gallery = true;
    editor(&mut harness).gallery.sought = "velvet UP".to_owned();
    harness.run_steps(3);
    assert!(harness.query_by_label("Velvet up").is_some() && harness.query_by_label("Pearl cup").is_none());
    editor(&mut harness).gallery.sought = "spaceship".to_owned();
    harness.run_steps(2);
    assert!(harness.query_by_label("No scene is about \"spaceship\".").is_some());
    harness.get_by_label("Show all").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("Velvet up").is_some() && harness.query_by_label("Default").is_some());
}

/// A small table in the format of `.npz` exports, which is isotropic.
fn measured(folder: &std::path::Path) -> std::path::PathBuf {
    let source = std::path::Path::new("/work/shared/data/vch_silk_blue_rgb.bsdf");
    if source.is_file() { source.to_owned() } else { folder.join("none.bsdf") }
}

#[test]
fn a_measured_paint_that_is_dropped_is_not_tinted_by_what_was_there_and_that_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = measured(folder.path());
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
fn help_is_closed_by_escape() {
    let mut harness = harness(quick());
    harness.key_press(Key::F1);
    harness.run_steps(2);
    assert!(matches!(editor(&mut harness).dialog, Some(Dialog::Help)));
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    assert!(editor(&mut harness).dialog.is_none());
}

#[test]
fn an_export_offers_formats_by_name_and_the_name_takes_the_ending() {
    let mut harness = harness(quick());
    harness.key_press_modifiers(Modifiers::COMMAND, Key::E);
    harness.run_steps(3);
    harness.get_by_label("Format").click();
    harness.run_steps(2);
    let mitsuba = harness.get_all_by_label_contains("RGL tensor (.bsdf)").last().unwrap();
    mitsuba.click();
    harness.run_steps(2);
    let Some(Dialog::Files(files)) = &editor(&mut harness).dialog else { panic!("no dialog") };
    assert_eq!(files.typed, "quick.bsdf");
}

#[test]
fn a_lost_device_is_a_message_and_pictures_go_on_on_the_processor() {
    if let Err(error) = biscale::gpu::Gpu::open() {
        return eprintln!("SKIPPED: {error}");
    }
    let mut harness = harness(quick());
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.quality.backend = "gpu".to_owned();
    editor(&mut harness).document.edit(scene);
    harness.step();
    settle(&mut harness);
    let device = editor(&mut harness).object.made.as_ref().unwrap().device.clone();
    if device.starts_with("CPU") {
        return eprintln!("SKIPPED: pictures are not made on the device ({device})");
    }
    LOSE_DEVICE.store(true, std::sync::atomic::Ordering::SeqCst);
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.light.rotation_deg = 25.0;
    editor(&mut harness).document.edit(scene.clone());
    harness.step();
    settle(&mut harness);
    for _ in 0..300 {
        harness.step();
        if editor(&mut harness).messages.texts().iter().any(|text| text.contains("graphics device failed")) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let editor = editor(&mut harness);
    let texts = editor.messages.texts().join("; ");
    assert!(texts.contains("graphics device failed") && texts.contains("document is kept"), "{texts}");
    assert_eq!(**editor.document.scene(), scene);
    let made = editor.object.made.as_ref().unwrap();
    assert!(made.picture.pixels.iter().all(|pixel| pixel.is_finite()));
}

#[test]
fn an_editor_that_moves_to_another_window_keeps_its_document_and_makes_its_pictures_anew() {
    let mut harness = harness(quick());
    settle(&mut harness);
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::Snapshot);
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.light.count = 3;
    editor(&mut harness).document.edit(scene.clone());
    editor(&mut harness).move_to(&ctx);
    harness.step();
    settle(&mut harness);
    let editor = editor(&mut harness);
    assert_eq!(**editor.document.scene(), scene);
    assert!(editor.document.undo_name().is_some() && editor.object.kept.is_some());
    assert!(editor.messages.texts().iter().any(|text| text.contains("new window")));
    assert_eq!(editor.object.made.as_ref().unwrap().version, editor.document.version());
}
