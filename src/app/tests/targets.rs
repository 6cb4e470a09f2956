//! Targets in the Cost tab: the search in the background, and what it found.

use eframe::egui::{Key, OutputCommand, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::{editor, quick, settle, tall, wait_until};
use crate::app::editor::Editor;
use crate::base::Cancel;
use crate::tuning::choose::{Target, choose};

fn opened() -> Harness<'static, Option<Editor>> {
    let mut harness = tall(quick());
    settle(&mut harness);
    harness.key_press(Key::F6);
    harness.run_steps(3);
    harness
}

/// Types a target into a field and presses Enter.
fn enter(harness: &mut Harness<'static, Option<Editor>>, field: &str, text: &str) {
    let node = harness.get_by_role_and_label(Role::TextInput, field);
    node.focus();
    harness.run_steps(2);
    harness.get_by_role_and_label(Role::TextInput, field).type_text(text);
    harness.run_steps(2);
    harness.key_press(Key::Enter);
    harness.run_steps(2);
}

fn wait_for_search(harness: &mut Harness<'static, Option<Editor>>) {
    wait_until(harness, |editor| !editor.targets.is_active());
}

#[test]
fn at_least_45_db_gives_the_settings_that_the_command_line_chooses_in_one_undo_step() {
    let mut harness = opened();
    let (loaded, before) = {
        let document = &editor(&mut harness).document;
        (document.loaded(), document.history().len())
    };
    enter(&mut harness, "At least", "45");
    assert!(editor(&mut harness).targets.is_active());
    wait_for_search(&mut harness);
    assert!(harness.query_by_label_contains(" dB in ").is_some());
    harness.get_by_label("Use").click();
    harness.run_steps(2);
    let chosen = choose(&loaded, Target::Psnr(45.0), &Cancel::default(), |_| {}).unwrap();
    assert!(chosen.reaches_target);
    let document = &editor(&mut harness).document;
    assert_eq!(document.scene().quality, chosen.scene.scene.quality);
    assert_eq!(document.history().len(), before + 1);
    harness.get_by_label("Copy as command").click();
    harness.step();
    let commands = &harness.output().platform_output.commands;
    let command = format!("biscale render quick -o quick.png {}", chosen.options());
    let is_copied =
        |output: &OutputCommand| if let OutputCommand::CopyText(text) = output { *text == command } else { false };
    assert!(commands.iter().any(is_copied), "{commands:?}");
}

#[test]
#[ignore = "takes five seconds of a core: the finest settings have 131,072 facets"]
fn a_psnr_that_no_settings_reach_says_so_and_leaves_the_scene() {
    let mut harness = opened();
    let version = editor(&mut harness).document.version();
    enter(&mut harness, "At least", "900");
    wait_for_search(&mut harness);
    assert!(harness.query_by_label_contains("Not reached: best ").is_some());
    assert!(harness.query_by_label("Use").is_none());
    assert_eq!(editor(&mut harness).document.version(), version);
}

#[test]
fn an_edit_of_the_tile_cancels_a_search_and_a_turned_camera_does_not() {
    let mut harness = opened();
    enter(&mut harness, "At least", "900");
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.camera.get_or_insert_default().azimuth_deg = 33.0;
    editor(&mut harness).document.edit(scene.clone());
    harness.run_steps(1);
    assert!(editor(&mut harness).targets.is_active() || harness.query_by_label_contains("Not reached").is_some());
    scene.tile.geometry = crate::scene::Geometry::with_defaults("flat").unwrap();
    editor(&mut harness).document.edit(scene);
    harness.run_steps(2);
    assert!(!editor(&mut harness).targets.is_active());
    assert!(harness.query_by_label_contains("Not reached").is_none());
}

#[test]
fn a_target_that_is_no_number_above_zero_is_refused_with_what_was_expected() {
    let mut harness = opened();
    for text in ["-3", "many", "1e99"] {
        enter(&mut harness, "At most", text);
        assert!(!editor(&mut harness).targets.is_active());
        assert!(harness.query_by_label_contains("expected a number above 0").is_some(), "{text}");
        editor(&mut harness).targets = Default::default();
        harness.step();
    }
}
