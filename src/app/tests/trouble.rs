//! What goes wrong is a message, and the document is kept.

use std::sync::Arc;

use crate::scene::{BrdfSpec, TermSpec};
use eframe::egui::mutex::RwLock;
use eframe::egui::{self, Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::{QUICK, editor, harness, quick, settle};
use crate::app::actions::Action;
use crate::app::document::Document;
use crate::app::editor::Editor;
use crate::app::worker::{Devices, DisplayImage, LOSE_DEVICE, Screen};

#[test]
fn a_lost_device_is_a_message_and_images_go_on_on_the_processor() {
    if let Err(error) = crate::gpu::Gpu::open() {
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
    assert!(made.radiance.as_ref().unwrap().pixels.iter().all(|pixel| pixel.is_finite()));
}

/// A device as a window's, and what would draw the interface there.
fn screen() -> Option<Screen> {
    let own = crate::gpu::Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok()?;
    let gpu = crate::gpu::Gpu::of_window(own.adapter, own.device, own.queue, || {});
    let format = wgpu::TextureFormat::Rgba8Unorm;
    let interface = eframe::egui_wgpu::Renderer::new(&gpu.device, format, Default::default());
    Some(Screen::new(gpu.into(), Arc::new(RwLock::new(interface))))
}

fn on_gpu(document: &Document) -> crate::scene::Scene {
    let mut scene = (**document.scene()).clone();
    scene.quality.backend = "gpu".to_owned();
    scene
}

#[test]
fn a_image_on_the_window_s_device_is_shown_without_being_read_back_and_is_the_processor_s() {
    let Some(screen) = screen() else { return };
    let mut harness = harness(quick());
    settle(&mut harness);
    let cpu = editor(&mut harness).object.made.as_ref().unwrap().image.clone();
    assert!(matches!(cpu, DisplayImage::Pixels(_)));
    editor(&mut harness).tell_devices(Devices { only_software: None, screen: Some(screen) });
    let scene = on_gpu(&editor(&mut harness).document);
    editor(&mut harness).document.edit(scene);
    harness.step();
    settle(&mut harness);
    let made = editor(&mut harness).object.made.clone().unwrap();
    let DisplayImage::OnDevice(_) = &made.image else { panic!("{} made {:?}", made.device, made.image.size()) };
    assert!(made.radiance.is_none());
    let (shown, cpu) = (made.image.pixels().unwrap(), cpu.pixels().unwrap());
    assert_eq!(shown.size, cpu.size);
    let off = |a: egui::Color32, b: egui::Color32| (0..3).map(|k| a[k].abs_diff(b[k])).max().unwrap_or(0);
    let far = shown.pixels.iter().zip(&cpu.pixels).filter(|(a, b)| off(**a, **b) > 6).count();
    // Silhouettes, where adapters snap to their own subpixels, and highlights that turn there.
    assert!(far * 50 < cpu.pixels.len(), "{far} of {}", cpu.pixels.len());

    // Other tones are another picture there; what was kept as A is pixels, and stays when the window goes.
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::Snapshot);
    let mut brighter = (**editor(&mut harness).document.scene()).clone();
    brighter.camera.get_or_insert_default().exposure_ev = 1.0;
    editor(&mut harness).document.edit(brighter);
    harness.step();
    settle(&mut harness);
    let brighter = editor(&mut harness).object.made.clone().unwrap();
    let sum = |image: &DisplayImage| image.pixels().unwrap().pixels.iter().map(|p| u64::from(p.g())).sum::<u64>();
    assert!(sum(&brighter.image) > sum(&made.image), "an exposure that was raised");
    drop((made, brighter));
    editor(&mut harness).move_to(&ctx);
    harness.step();
    settle(&mut harness);
    assert!(editor(&mut harness).object.kept.is_some());
}

#[test]
fn on_a_graphics_processor_an_edit_s_first_image_takes_no_visibility_of_the_cpu() {
    let Some(screen) = screen() else { return };
    let scene = QUICK
        .replace("{ kind = \"grooves\", count = 2 }", "{ kind = \"heightfield\", path = \"asset:ripples.png\" }")
        .replace("backend = \"cpu\"", "backend = \"gpu\"");
    let scene = crate::scene::parse(&scene).unwrap();
    let painted = crate::scene::Painted::default();
    let loaded = crate::scene::LoadedScene { scene, base_dir: "".into(), name: "ripples".into(), painted };
    let mut harness = harness(Document::new(loaded, None));
    // Software, taken for a graphics processor.
    let mut screen = screen;
    screen.is_fast = true;
    editor(&mut harness).tell_devices(Devices { only_software: None, screen: Some(screen) });
    settle(&mut harness);
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.nudge_geometry().unwrap();
    editor(&mut harness).document.edit(scene);
    let version = editor(&mut harness).document.version();
    let start = std::time::Instant::now();
    let draft = loop {
        harness.step();
        let made = editor(&mut harness).object.made.clone().unwrap();
        if made.version == version {
            break made;
        }
        assert!(start.elapsed().as_secs() < 60, "no picture");
    };
    let stages: Vec<_> = draft.stages.iter().map(|(name, _)| *name).collect();
    assert!(matches!(draft.image, DisplayImage::OnDevice(_)), "{stages:?}");
    assert!(stages.contains(&"visibility and product") && !stages.contains(&"visibility"), "{stages:?}");
    assert!(draft.brdf.is_some(), "plots show the last BRDF until the next is known");
    settle(&mut harness);
    let made = editor(&mut harness).object.made.clone().unwrap();
    assert!(!std::sync::Arc::ptr_eq(&made.brdf.unwrap(), &draft.brdf.unwrap()));
}

#[test]
fn a_window_s_device_that_is_lost_leaves_images_to_the_processor() {
    let Some(screen) = screen() else { return };
    let mut harness = harness(quick());
    editor(&mut harness).tell_devices(Devices { only_software: None, screen: Some(screen.clone()) });
    let scene = on_gpu(&editor(&mut harness).document);
    editor(&mut harness).document.edit(scene.clone());
    harness.step();
    settle(&mut harness);
    screen.gpu.device.destroy();
    let scene = crate::scene::Scene { light: crate::scene::Light { count: 3, ..scene.light.clone() }, ..scene };
    editor(&mut harness).document.edit(scene);
    harness.step();
    settle(&mut harness);
    let made = editor(&mut harness).object.made.clone().unwrap();
    assert!(matches!(made.image, DisplayImage::Pixels(_)) && made.device.starts_with("CPU"), "{}", made.device);
}

#[test]
fn an_editor_that_moves_to_another_window_keeps_its_document_and_makes_its_images_anew() {
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
