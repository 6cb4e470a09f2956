//! The strip at the foot: accuracy and time, faster and finer settings, and what is left out.

use eframe::egui::{Rect, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::{editor, harness, quick, settle};
use crate::app::document::Document;
use crate::app::editor::Editor;
use crate::app::messages::Level;
use crate::app::worker::AccuracyPoint;
use crate::scene::{self, Switch};
use crate::tuning::progressive::ReferenceErrors;

/// Grooves that are so deep that much light is reflected between their sides. A draft would not tell it.
pub fn deep(switch: &str) -> Document {
    let text = format!(
        "{}[effects]\ninterreflection = \"{switch}\"\n",
        super::QUICK
            .replace("count = 2", "count = 2, depth = 0.9")
            .replace("f0 = 0.8", "f0 = 1.0")
            .replace("draft", "standard")
    );
    let scene = scene::parse(&text).unwrap();
    let loaded = scene::LoadedScene { scene, base_dir: "".into(), name: "deep".into(), painted: Default::default() };
    Document::new(loaded, None)
}

pub fn of_size(document: Document, width: f32, height: f32) -> Harness<'static, Option<Editor>> {
    let mut harness = harness(document);
    harness.set_size(vec2(width, height));
    harness.run_steps(3);
    settle(&mut harness);
    harness.run_steps(3);
    harness
}

pub fn point(facets: usize, ms: f64, psnr_db: f64) -> AccuracyPoint {
    let (rel_l2, rel_l2_std_error, psnr_std_error_db) = (0.01, 0.001, 0.4);
    let compared =
        ReferenceErrors { rel_l2, rel_l2_std_error, psnr_db, psnr_std_error_db, std_error: 0.001, batches: 2 };
    AccuracyPoint { facets, ms, compared }
}

/// Runs frames until the chart of the open version is complete.
fn wait_until_measured(harness: &mut Harness<'static, Option<Editor>>) {
    let start = std::time::Instant::now();
    loop {
        harness.step();
        let editor = editor(harness);
        if editor.accuracy.is_measured(editor.document.version()) {
            return;
        }
        assert!(start.elapsed().as_secs() < 100, "not measured");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

#[test]
fn accuracy_and_what_is_left_out_are_inside_the_window_at_both_sizes() {
    for size in [vec2(1440.0, 900.0), vec2(1024.0, 700.0)] {
        let mut harness = of_size(deep("off"), size.x, size.y);
        let effect = editor(&mut harness).object.preview.as_ref().unwrap().effects.clone();
        assert!(effect.iter().any(|effect| effect.left_out.is_some()), "{effect:?}");
        let window = Rect::from_min_size(eframe::egui::Pos2::ZERO, size);
        let chip = harness.get_by_label("1 effect left out").rect();
        assert!(window.contains_rect(chip), "{chip:?}");
        let stated = harness.query_by_label_contains("dB");
        let state = stated.or_else(|| harness.query_by_label_contains("not measured")).unwrap().rect();
        assert!(window.contains_rect(state) && state.right() <= chip.left(), "{state:?} {chip:?}");
    }
}

#[test]
fn the_chip_adds_the_effect_in_one_undo_step_and_then_is_absent() {
    let mut harness = of_size(deep("off"), 1200.0, 800.0);
    harness.get_by_label("Keep out").click();
    harness.run_steps(3);
    harness.get_by_label("1 effect left out").click();
    harness.run_steps(3);
    harness.get_by_label("Add").click();
    harness.run_steps(3);
    assert_eq!(editor(&mut harness).document.scene().effects.interreflection, Switch::On);
    assert_eq!(editor(&mut harness).document.history().len(), 1);
    settle(&mut harness);
    harness.run_steps(3);
    assert!(harness.query_by_label("1 effect left out").is_none());
    let flat = quick();
    let mut scene = (**flat.scene()).clone();
    scene.tile.geometry = scene::Geometry::with_defaults("flat").unwrap();
    editor(&mut harness).document.edit(scene);
    harness.run_steps(2);
    settle(&mut harness);
    assert!(harness.query_by_label_contains("left out").is_none(), "a flat tile leaves nothing out");
}

#[test]
fn faster_and_finer_settings_are_taken_by_a_click_and_undone_in_one_step() {
    let mut harness = of_size(quick(), 1400.0, 800.0);
    let version = editor(&mut harness).document.version();
    let levels = vec![point(256, 8.0, 38.0), point(1024, 24.0, 47.0), point(4096, 1300.0, 61.0)];
    editor(&mut harness).accuracy.record(version, levels, point(128, 410.0, 52.0));
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("52 ± 0.4 dB · 410 ms").is_some());
    let before = editor(&mut harness).document.scene().quality.clone();
    harness.get_by_label("Faster: 47 dB · 24 ms").click();
    harness.run_steps(2);
    assert_eq!(editor(&mut harness).document.scene().quality.facets, Some(1024));
    editor(&mut harness).document.undo();
    assert_eq!(editor(&mut harness).document.scene().quality, before);
    // The strip must not move between the press and the release of the button.
    harness.step();
    settle(&mut harness);
    let version = editor(&mut harness).document.version();
    editor(&mut harness).accuracy.record(version, vec![point(4096, 1300.0, 61.0)], point(128, 410.0, 52.0));
    harness.run_steps(2);
    assert!(harness.query_by_label("Faster: none").is_some());
    harness.get_by_label("Finer: 61 dB · 1.3 s").click();
    harness.run_steps(2);
    assert_eq!(editor(&mut harness).document.scene().quality.facets, Some(4096));
}

#[test]
fn settings_that_the_scene_has_are_not_offered_as_faster_ones() {
    let mut harness = of_size(quick(), 1400.0, 800.0);
    let version = editor(&mut harness).document.version();
    // The level took less time than the same settings of the scene.
    let levels = vec![point(256, 118.0, 31.0), point(1024, 400.0, 47.0)];
    editor(&mut harness).accuracy.record(version, levels, point(256, 277.0, 31.2));
    harness.run_steps(2);
    assert!(harness.query_by_label("Faster: none").is_some());
    assert!(harness.query_by_label("Finer: 47 dB · 400 ms").is_some());
}

#[test]
fn settings_that_are_finer_and_faster_are_offered_only_if_they_exist() {
    let mut harness = of_size(quick(), 1400.0, 1500.0);
    harness.key_press(eframe::egui::Key::F6);
    // Later results of the worker would replace the recorded points.
    wait_until_measured(&mut harness);
    let mut offered = |psnr_db: f64| {
        let version = editor(&mut harness).document.version();
        editor(&mut harness).accuracy.record(version, vec![point(512, 200.0, psnr_db)], point(128, 600.0, 37.0));
        harness.step();
        let shown = harness.query_by_label("Finer and faster exists: 56 dB in 200.0 ms.").is_some();
        if shown {
            harness.get_by_label("Use").click();
            harness.run_steps(2);
        }
        shown
    };
    assert!(!offered(36.0));
    assert!(offered(56.0));
    assert_eq!(editor(&mut harness).document.scene().quality.facets, Some(512));
}

#[test]
fn measuring_from_the_strip_needs_no_open_panel_and_gives_faster_and_finer_settings() {
    let mut harness = of_size(quick(), 1400.0, 800.0);
    assert_eq!(editor(&mut harness).accuracy.point_counts(), [0, 0], "nothing is measured without a click");
    harness.get_by_label("Measure").click();
    wait_until_measured(&mut harness);
    harness.run_steps(3);
    assert!(harness.query_by_label("Measure").is_none());
    assert!(harness.query_by_label_contains("Finer: ").is_some());
}

#[test]
fn no_text_of_the_plan_names_a_flag_of_the_command_line() {
    let mut harness = of_size(deep("auto"), 1200.0, 800.0);
    let preview = editor(&mut harness).object.preview.clone().unwrap();
    let reasons = preview.effects.iter().map(|effect| effect.reason.as_str());
    let warnings = editor(&mut harness).object.warnings.clone();
    for text in reasons.chain(preview.notes.iter().map(String::as_str)).chain(warnings.iter().map(String::as_str)) {
        assert!(!text.contains("--"), "{text}");
    }
}

#[test]
fn messages_never_cover_the_strip() {
    // The smaller window is one of 1440 x 1008 pixels whose interface is 1.8 times as large.
    for size in [vec2(1024.0, 700.0), vec2(800.0, 560.0)] {
        let mut harness = of_size(deep("off"), size.x, size.y);
        for source in ["a", "b", "c"] {
            let text = "A file could not be read, because its folder is not there. ".repeat(12);
            editor(&mut harness).messages.put(Level::Error, source, text);
        }
        harness.run_steps(4);
        let strip = harness.get_by_label("1 effect left out").rect();
        let messages = harness.ctx.memory(|memory| memory.area_rect(eframe::egui::Id::unique("messages"))).unwrap();
        assert!(messages.bottom() <= strip.top() && messages.height() > 30.0, "{messages:?} {strip:?}");
    }
}

#[test]
fn a_note_offers_once_what_is_left_out_and_the_export_dialog_repeats_it() {
    let mut harness = of_size(deep("off"), 1440.0, 900.0);
    let line = "Interreflection is left out: ";
    assert!(harness.query_by_label_contains(line).is_some());
    harness.get_by_label("Keep out").click();
    harness.run_steps(3);
    assert!(harness.query_by_label_contains(line).is_none());
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.tile.unit = "um".to_owned();
    editor(&mut harness).document.edit(scene);
    harness.run_steps(2);
    settle(&mut harness);
    assert!(harness.query_by_label_contains(line).is_none(), "the note comes once per scene");
    let choice = crate::app::worker::TableChoice::default();
    editor(&mut harness).dialog = Some(crate::app::dialogs::Dialog::Table { path: "a.npz".into(), choice });
    harness.run_steps(3);
    assert!(harness.query_by_label_contains(line).is_some());
    let mut harness = of_size(deep("off"), 1440.0, 900.0);
    harness.get_by_label("Add").click();
    harness.run_steps(3);
    assert_eq!(editor(&mut harness).document.scene().effects.interreflection, Switch::On);
    assert_eq!(editor(&mut harness).document.history().len(), 1);
    assert!(harness.query_by_label_contains(line).is_none());
}
