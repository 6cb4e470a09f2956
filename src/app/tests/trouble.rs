//! What goes wrong is a message, and the document is kept.

use eframe::egui::{self, Key, Modifiers};
use egui_kittest::kittest::Queryable;

use super::{editor, harness, quick, settle};
use crate::app::actions::Action;
use crate::app::worker::LOSE_DEVICE;

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

#[test]
fn what_is_typed_and_is_no_number_is_a_message_and_the_value_stays() {
    let mut harness = harness(quick());
    settle(&mut harness);
    let before = editor(&mut harness).document.scene().clone();
    for text in ["nan", "inf"] {
        let field = harness.get_all_by_role(egui::Role::SpinButton).nth(1).unwrap();
        field.click();
        harness.run_steps(2);
        harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
        harness.event(egui::Event::Text(text.to_owned()));
        harness.run_steps(2);
        harness.key_press(Key::Enter);
        harness.run_steps(2);
        let texts = editor(&mut harness).messages.texts().join("; ");
        assert!(texts.contains("not a number"), "{text}: {texts}");
        assert_eq!(*editor(&mut harness).document.scene(), before);
    }
}

#[test]
fn a_place_that_cannot_be_written_says_so_and_the_document_stays_unsaved() {
    let mut harness = harness(quick());
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.light.count = 3;
    let editor = editor(&mut harness);
    editor.document.edit(scene);
    editor.save(std::path::Path::new("/nonexistent/folder/a.toml"));
    let texts = editor.messages.texts().join("; ");
    assert!(texts.contains("Not saved") && texts.contains("nonexistent") && texts.contains("still here"), "{texts}");
    assert!(editor.document.is_dirty());
}

#[test]
fn a_file_that_another_program_wrote_is_asked_about_before_it_is_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shared.toml");
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    editor(&mut harness).save(&path);
    let theirs = std::fs::read_to_string(&path).unwrap() + "# someone else\n";
    std::fs::write(&path, &theirs).unwrap();
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.light.count = 3;
    editor(&mut harness).document.edit(scene.clone());
    for (answer, is_ours) in [("Later", false), ("Keep mine", true)] {
        editor(&mut harness).action(&ctx, Action::Save);
        harness.run_steps(2);
        assert!(harness.query_by_label_contains("was changed by another program").is_some());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), theirs);
        harness.get_by_label(answer).click();
        harness.run_steps(2);
        assert_eq!(std::fs::read_to_string(&path).unwrap() != theirs, is_ours);
        assert_eq!(editor(&mut harness).document.is_dirty(), !is_ours);
    }
    assert_eq!(**editor(&mut harness).document.scene(), scene);
}
