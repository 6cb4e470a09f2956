//! Errors are reported as messages, and the document stays open.

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
use crate::app::worker::{DisplayImage, GpuShare, Grade, Screen};

/// Opens a GPU as a window does, with a renderer for the interface.
fn screen() -> Option<Screen> {
    let opened = crate::gpu::Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok()?;
    let gpu = crate::gpu::Gpu::from_window(opened.adapter, opened.device, opened.queue, || {});
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
fn the_loss_of_the_window_s_gpu_is_reported_and_the_cpu_renders_the_next_images() {
    let Some(screen) = screen() else { return };
    let mut harness = harness(quick());
    editor(&mut harness).share_gpu(GpuShare { only_software: None, screen: Some(screen.clone()) });
    let scene = on_gpu(&editor(&mut harness).document);
    editor(&mut harness).document.edit(scene);
    harness.step();
    settle(&mut harness);
    let rendered_on = editor(&mut harness).object.preview.as_ref().unwrap().rendered_on.clone();
    if rendered_on.starts_with("CPU") {
        return eprintln!("SKIPPED: the GPU does not render images ({rendered_on})");
    }
    screen.gpu.device.destroy();
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.light.rotation_deg = 25.0;
    editor(&mut harness).document.edit(scene.clone());
    harness.step();
    settle(&mut harness);
    for _ in 0..300 {
        harness.step();
        if editor(&mut harness).messages.texts().iter().any(|text| text.contains("The GPU failed")) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let editor = editor(&mut harness);
    let texts = editor.messages.texts().join("; ");
    assert!(texts.contains("The GPU failed") && texts.contains("document is kept"), "{texts}");
    assert_eq!(**editor.document.scene(), scene);
    let preview = editor.object.preview.as_ref().unwrap();
    assert!(matches!(preview.image, DisplayImage::Pixels(_)) && preview.rendered_on.starts_with("CPU"));
    assert!(preview.radiance.as_ref().unwrap().pixels.iter().all(|pixel| pixel.is_finite()));
}

#[test]
fn an_image_on_the_window_s_gpu_is_displayed_without_readback_and_equals_that_of_the_cpu() {
    let Some(screen) = screen() else { return };
    let mut harness = harness(quick());
    // So small that the CPU renders as many pixels as a GPU.
    harness.set_size(egui::vec2(1100.0, 800.0));
    harness.step();
    settle(&mut harness);
    let cpu = editor(&mut harness).object.preview.as_ref().unwrap().image.clone();
    assert!(matches!(cpu, DisplayImage::Pixels(_)));
    editor(&mut harness).share_gpu(GpuShare { only_software: None, screen: Some(screen) });
    let scene = on_gpu(&editor(&mut harness).document);
    editor(&mut harness).document.edit(scene);
    harness.step();
    settle(&mut harness);
    let preview = editor(&mut harness).object.preview.clone().unwrap();
    let DisplayImage::OnGpu(_) = &preview.image else {
        panic!("{} rendered {:?}", preview.rendered_on, preview.image.size())
    };
    assert!(preview.radiance.is_none());
    let (gpu, cpu) = (preview.image.pixels().unwrap(), cpu.pixels().unwrap());
    assert_eq!(gpu.size, cpu.size);
    let off = |a: egui::Color32, b: egui::Color32| (0..3).map(|k| a[k].abs_diff(b[k])).max().unwrap_or(0);
    let far = gpu.pixels.iter().zip(&cpu.pixels).filter(|(a, b)| off(**a, **b) > 6).count();
    // Silhouettes and their highlights may differ, because adapters snap vertices to different subpixels.
    assert!(far * 50 < cpu.pixels.len(), "{far} of {}", cpu.pixels.len());

    // An exposure edit renders a new image. Image A is stored as pixels, so that it survives the window.
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::Snapshot);
    let mut brighter = (**editor(&mut harness).document.scene()).clone();
    brighter.camera.get_or_insert_default().exposure_ev = 1.0;
    editor(&mut harness).document.edit(brighter);
    harness.step();
    settle(&mut harness);
    let brighter = editor(&mut harness).object.preview.clone().unwrap();
    let sum = |image: &DisplayImage| image.pixels().unwrap().pixels.iter().map(|p| u64::from(p.g())).sum::<u64>();
    assert!(sum(&brighter.image) > sum(&preview.image), "the exposure is higher");
    drop((preview, brighter));
    editor(&mut harness).move_to(&ctx);
    harness.step();
    settle(&mut harness);
    assert!(editor(&mut harness).object.comparison.is_some());
}

#[test]
fn with_a_gpu_the_first_image_after_an_edit_needs_no_visibility_of_the_cpu() {
    let Some(screen) = screen() else { return };
    let scene = QUICK
        .replace("{ kind = \"grooves\", count = 2 }", "{ kind = \"heightfield\", path = \"asset:ripples.png\" }")
        .replace("backend = \"cpu\"", "backend = \"gpu\"");
    let scene = crate::scene::parse(&scene).unwrap();
    let painted = crate::scene::Painted::default();
    let loaded = crate::scene::LoadedScene { scene, base_dir: "".into(), name: "ripples".into(), painted };
    let mut harness = harness(Document::new(loaded, None));
    // The software adapter is treated as a GPU.
    let mut screen = screen;
    screen.is_hardware = true;
    editor(&mut harness).share_gpu(GpuShare { only_software: None, screen: Some(screen) });
    settle(&mut harness);
    let start = std::time::Instant::now();
    // On a busy machine, a frame can take so long that the refined image replaces the draft before it is seen.
    let draft = loop {
        let mut scene = (**editor(&mut harness).document.scene()).clone();
        scene.nudge_geometry().unwrap();
        editor(&mut harness).document.edit(scene);
        let version = editor(&mut harness).document.version();
        let preview = loop {
            harness.step();
            let preview = editor(&mut harness).object.preview.clone().unwrap();
            assert!(start.elapsed().as_secs() < 110, "no image");
            if preview.version == version {
                break preview;
            }
        };
        if preview.grade == Grade::Draft {
            break preview;
        }
    };
    let stages: Vec<_> = draft.stages.iter().map(|(name, _)| *name).collect();
    assert!(matches!(draft.image, DisplayImage::OnGpu(_)), "{stages:?}");
    assert!(stages.contains(&"visibility and product") && !stages.contains(&"visibility"), "{stages:?}");
    assert!(draft.brdf.is_some(), "plots show the last BRDF until the next one arrives");
    settle(&mut harness);
    let preview = editor(&mut harness).object.preview.clone().unwrap();
    assert!(!std::sync::Arc::ptr_eq(&preview.brdf.unwrap(), &draft.brdf.unwrap()));
}

#[test]
fn an_editor_that_moves_to_another_window_keeps_its_document_and_renders_its_images_again() {
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
    assert!(editor.document.undo_name().is_some() && editor.object.comparison.is_some());
    assert!(editor.messages.texts().iter().any(|text| text.contains("new window")));
    assert_eq!(editor.object.preview.as_ref().unwrap().version, editor.document.version());
}

#[test]
fn text_that_is_not_a_number_is_reported_and_the_value_stays() {
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
fn a_scene_that_cannot_be_computed_is_reported_and_no_spinner_stays() {
    let mut document = quick();
    let mut scene = (**document.scene()).clone();
    scene.materials[0].brdf = Some(BrdfSpec::One(TermSpec::Merl { path: "not_there.binary".into() }));
    document.edit(scene);
    let mut harness = harness(document);
    let wait_for = |harness: &mut Harness<'static, Option<Editor>>, text: &str| {
        let start = std::time::Instant::now();
        while harness.query_by_label_contains(text).is_none() {
            harness.step();
            assert!(start.elapsed().as_secs() < 60, "{text}");
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    };
    wait_for(&mut harness, "No image could be computed: see the message");
    assert!(editor(&mut harness).messages.texts().iter().any(|text| text.contains("not_there.binary")));
    // Other views may still receive their results. Then the editor stops repainting.
    let start = std::time::Instant::now();
    loop {
        harness.step();
        let delay = harness.output().viewport_output[&egui::ViewportId::ROOT].repaint_delay;
        if delay.as_secs_f64() > 0.3 {
            break;
        }
        assert!(start.elapsed().as_secs() < 60, "the editor keeps repainting: {delay:?}");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::Undo);
    harness.step();
    settle(&mut harness);
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("could be computed").is_none());
    editor(&mut harness).action(&ctx, Action::Redo);
    wait_for(&mut harness, "Shows the last image that could be computed: see the message");
}

#[test]
fn a_scene_that_cannot_be_computed_does_not_show_the_image_of_the_scene_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("relief.toml");
    std::fs::write(&path, "[tile]\ngeometry = { kind = \"heightfield\", path = \"gone.png\" }\n").unwrap();
    let mut harness = harness(quick());
    settle(&mut harness);
    assert!(editor(&mut harness).object.preview.is_some());
    editor(&mut harness).open(&path.to_string_lossy());
    let start = std::time::Instant::now();
    while harness.query_by_label("No image could be computed: see the message").is_none() {
        harness.step();
        assert!(start.elapsed().as_secs() < 60, "{:?}", editor(&mut harness).messages.texts());
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let editor = editor(&mut harness);
    assert!(editor.object.preview.is_none() && editor.tile.rendered.is_none());
}
