//! What goes wrong is a message, and the document is kept.

use biscale::scene::{BrdfSpec, TermSpec};
use eframe::egui::{self, Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::{editor, harness, quick, settle};
use crate::app::actions::Action;
use crate::app::editor::Editor;
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
fn a_scene_that_cannot_be_computed_says_so_and_nothing_spins_on() {
    let mut document = quick();
    let mut scene = (**document.scene()).clone();
    scene.materials[0].brdf = Some(BrdfSpec::One(TermSpec::Merl { path: "not_there.binary".into() }));
    document.edit(scene);
    let mut harness = harness(document);
    let shows = |harness: &mut Harness<'static, Option<Editor>>, text: &str| {
        let start = std::time::Instant::now();
        while harness.query_by_label_contains(text).is_none() {
            harness.step();
            assert!(start.elapsed().as_secs() < 60, "{text}");
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    };
    shows(&mut harness, "No picture could be made: see the message");
    assert!(editor(&mut harness).messages.texts().iter().any(|text| text.contains("not_there.binary")));
    // What other views still wait for may come and be drawn; then all rests.
    let start = std::time::Instant::now();
    loop {
        harness.step();
        let delay = harness.output().viewport_output[&egui::ViewportId::ROOT].repaint_delay;
        if delay.as_secs_f64() > 0.3 {
            break;
        }
        assert!(start.elapsed().as_secs() < 60, "nothing is painted again and again: {delay:?}");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::Undo);
    harness.step();
    settle(&mut harness);
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("could be made").is_none());
    editor(&mut harness).action(&ctx, Action::Redo);
    shows(&mut harness, "Shows the last picture that could be made: see the message");
}
