//! The interface through its accessibility nodes, as a keyboard or a screen reader uses it.

use crate::scene::{BrdfSpec, Geometry, TermSpec};
use eframe::egui::{Key, Modifiers, Ui};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::Vec2;

use super::{editor, harness, quick, settle};
use crate::app::actions::{Action, ENTRIES};
use crate::app::dialogs::Dialog;
use crate::app::document::Document;
use crate::app::editor::Editor;
use crate::app::views::tile::TileMode;

#[test]
fn a_scene_opens_with_its_image_and_all_views_have_names() {
    let mut harness = harness(quick());
    settle(&mut harness);
    for name in ["Object view", "Tile view", "Lobe view"] {
        assert!(harness.query_by_label(name).is_some(), "{name}");
    }
    assert!(editor(&mut harness).messages.texts().is_empty());
    let preview = editor(&mut harness).object.preview.as_ref().unwrap();
    assert!(preview.radiance.as_ref().unwrap().pixels.iter().all(|p| p.is_finite()) && preview.image.size()[0] > 100);
}

#[test]
fn every_family_is_displayed_edited_undone_and_redone() {
    let mut harness = harness(quick());
    for kind in ["pyramids", "rods", "weave", "flat", "grooves"] {
        let mut scene = (**editor(&mut harness).document.scene()).clone();
        scene.tile.geometry = Geometry::with_defaults(kind).unwrap();
        editor(&mut harness).document.edit(scene);
        harness.run_steps(2);
        assert!(editor(&mut harness).messages.texts().is_empty(), "{kind}");
    }
    let end = editor(&mut harness).document.scene().clone();
    for _ in 0..5 {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
        harness.run_steps(1);
    }
    assert_eq!(editor(&mut harness).document.scene(), quick().scene());
    for _ in 0..5 {
        harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
        harness.run_steps(1);
    }
    assert_eq!(*editor(&mut harness).document.scene(), end);
}

#[test]
fn a_slider_edits_the_scene_and_the_undo_entry_names_the_edit() {
    let mut harness = harness(quick());
    let slider = harness.get_all_by_role(eframe::egui::Role::Slider).next().unwrap();
    slider.set_value_accesskit(0.5);
    harness.run_steps(2);
    let Geometry::Grooves(grooves) = &editor(&mut harness).document.scene().tile.geometry else { panic!() };
    assert!((grooves.depth - 0.5).abs() < 1e-6, "{grooves:?}");
    assert_eq!(editor(&mut harness).document.undo_name(), Some("Depth"));
}

#[test]
fn a_stroke_turns_grooves_into_a_height_field_and_undo_restores_them() {
    let mut harness = harness(quick());
    settle(&mut harness);
    // The image of the tile comes from another thread.
    for _ in 0..500 {
        if editor(&mut harness).tile.rendered.is_some() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
        harness.step();
    }
    let editor = editor(&mut harness);
    editor.tile.set_painting(true);
    editor.draw(&[Vec2::splat(0.3), Vec2::splat(0.6)]);
    assert!(matches!(editor.document.scene().tile.geometry, Geometry::Heightfield(_)));
    assert!(editor.messages.texts().iter().any(|text| text.contains("relief")));
    let painted = editor.document.painted().heights.clone().unwrap();
    assert_eq!(editor.document.undo().as_deref(), Some("Paint: raise"));
    assert_ne!(*editor.document.painted().heights.clone().unwrap(), *painted);
    assert_eq!(editor.document.undo().as_deref(), Some("Turn into a relief"));
    assert_eq!(editor.document.scene(), quick().scene());
    editor.document.redo();
    editor.document.redo();
    assert_eq!(*editor.document.painted().heights.clone().unwrap(), *painted);
}

#[test]
fn a_damaged_measured_file_is_reported_and_the_document_stays_open() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("not.binary");
    std::fs::write(&path, "nothing").unwrap();
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    editor(&mut harness).dropped(&ctx, path.clone());
    for _ in 0..300 {
        harness.step();
        if !editor(&mut harness).messages.texts().is_empty() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let texts = editor(&mut harness).messages.texts().join("; ");
    assert!(texts.contains("not.binary"), "{texts}");
    let scene = editor(&mut harness).document.scene().clone();
    let Some(BrdfSpec::One(TermSpec::Merl { .. })) = scene.materials[0].brdf else { panic!() };
    editor(&mut harness).action(&ctx, Action::Undo);
    settle(&mut harness);
    assert!(!editor(&mut harness).messages.texts().iter().any(|text| text.contains("not.binary")));
}

#[test]
fn quitting_asks_about_unsaved_changes_and_cancel_keeps_them() {
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.light.count = 5;
    editor(&mut harness).document.edit(scene);
    editor(&mut harness).action(&ctx, Action::Quit);
    harness.run_steps(2);
    assert!(matches!(editor(&mut harness).dialog, Some(Dialog::Unsaved(_))));
    harness.get_by_label("Cancel").click();
    harness.run_steps(3);
    assert!(editor(&mut harness).dialog.is_none() && !editor(&mut harness).leaving);
    assert!(editor(&mut harness).document.is_dirty());
    editor(&mut harness).action(&ctx, Action::Quit);
    harness.run_steps(2);
    harness.get_by_label("Discard").click();
    harness.run_steps(3);
    assert!(editor(&mut harness).leaving);
}

#[test]
fn save_and_open_through_actions_give_the_same_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("saved.toml");
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.object.kind = "cup".to_owned();
    editor(&mut harness).document.edit(scene.clone());
    editor(&mut harness).document.save_as(&path).unwrap();
    editor(&mut harness).action(&ctx, Action::New);
    assert_ne!(**editor(&mut harness).document.scene(), scene);
    editor(&mut harness).action(&ctx, Action::OpenFile(path.clone()));
    assert_eq!(**editor(&mut harness).document.scene(), scene);
    assert_eq!(editor(&mut harness).settings.recent, [path]);
    assert_eq!(
        Document::open(editor(&mut harness).settings.recent[0].to_str().unwrap()).unwrap().scene().object.kind,
        "cup"
    );
}

#[test]
fn a_scene_that_does_not_parse_is_reported_and_the_document_stays_open() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.toml");
    std::fs::write(&path, "[tile]\ngeometry = { kind = \"groves\" }\n").unwrap();
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::OpenFile(path));
    let texts = editor(&mut harness).messages.texts().join("; ");
    assert!(texts.contains("line 2") && texts.contains("grooves"), "{texts}");
    assert_eq!(editor(&mut harness).document.name, "quick");
}

#[test]
fn a_material_is_copied_and_pasted_to_another_slot() {
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::PasteMaterial);
    assert!(editor(&mut harness).messages.texts()[0].contains("No material has been copied"));
    editor(&mut harness).action(&ctx, Action::CopyMaterial);
    editor(&mut harness).paste_material("sides");
    let scene = editor(&mut harness).document.scene().clone();
    assert_eq!(scene.materials[1].name, "sides");
    assert_eq!(scene.materials[1].brdf, scene.materials[0].brdf);
}

#[test]
fn picking_fills_the_lobe_view_and_ending_it_restores_the_tile() {
    let mut harness = harness(quick());
    settle(&mut harness);
    let ctx = harness.ctx.clone();
    editor(&mut harness).tile.show = TileMode::Materials;
    editor(&mut harness).action(&ctx, Action::Pick);
    let center = harness.get_by_label("Object view").rect().center();
    harness.hover_at(center);
    harness.run_steps(3);
    assert!(editor(&mut harness).lobe.viewer.is_some());
    assert!(editor(&mut harness).tile.show == TileMode::Contribution);
    editor(&mut harness).action(&ctx, Action::Pick);
    assert!(editor(&mut harness).lobe.viewer.is_none() && editor(&mut harness).tile.show == TileMode::Materials);
}

#[test]
fn dialogs_fit_into_a_small_window_with_a_large_interface() {
    let mut harness = harness(quick());
    let size = eframe::egui::vec2(1024.0, 700.0) / 1.8;
    harness.set_size(size);
    harness.run_steps(2);
    let ctx = harness.ctx.clone();
    let window = eframe::egui::Rect::from_min_size(eframe::egui::Pos2::ZERO, size);
    for (action, labels) in
        [(Action::ExportTable, ["Export the material", "Save"]), (Action::Vary, ["Vary the material", "Nine others"])]
    {
        editor(&mut harness).action(&ctx, action);
        harness.run_steps(4);
        for label in labels {
            let rect = harness.get_by_label(label).rect();
            assert!(window.contains_rect(rect), "{label}: {rect} in {window}");
        }
        editor(&mut harness).dialog = None;
        harness.run_steps(2);
    }
}

#[test]
fn methods_are_compared_only_where_a_scene_has_some() {
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::Methods);
    assert!(!editor(&mut harness).methods.on);
    assert!(editor(&mut harness).messages.texts()[0].contains("a slab or a colour map"));
}

#[test]
fn the_editor_does_not_repaint_when_nothing_changes() {
    let mut harness = harness(quick());
    settle(&mut harness);
    for _ in 0..200 {
        harness.step();
        std::thread::sleep(std::time::Duration::from_millis(5));
        if harness.ctx.cumulative_frame_nr() > 0 && !harness.ctx.has_requested_repaint() {
            break;
        }
    }
    harness.step();
    assert!(!harness.ctx.has_requested_repaint(), "{:?}", harness.ctx.repaint_causes());
}

#[test]
fn no_two_actions_share_a_shortcut() {
    let keys: Vec<_> = ENTRIES.iter().filter_map(|entry| entry.keys).collect();
    for (at, key) in keys.iter().enumerate() {
        assert!(!keys[..at].contains(key), "{key:?}");
    }
}

#[test]
fn an_image_that_is_requested_before_the_window_opens_has_the_size_of_its_view() {
    let mut document = Some(quick());
    let mut harness = Harness::builder().with_size([1400.0, 1000.0]).allow_missing_glyphs().build_ui_state(
        move |ui: &mut Ui, state: &mut Option<(Editor, _)>| {
            let ctx = ui.ctx().clone();
            let (editor, _) = state.get_or_insert_with(|| {
                let mut editor = Editor::new(&ctx, document.take().unwrap(), None, crate::cache::Cache::off());
                // The harness has a margin of 8 points on each side.
                editor.settings.window = [1384.0, 984.0];
                editor.request_first_image();
                let early = editor.object.requested;
                (editor, early)
            });
            editor.window_frame(ui);
        },
        None,
    );
    harness.run_steps(3);
    let (editor, early) = harness.state().as_ref().unwrap();
    assert!(early.is_some());
    assert_eq!(editor.object.requested, *early);
}

#[test]
fn with_a_question_open_no_key_edits_the_document_and_enter_and_escape_answer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("asked.toml");
    let mut document = quick();
    document.save_as(&path).unwrap();
    let mut harness = harness(document);
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.tile.size *= 2.0;
    editor(&mut harness).document.edit(scene);
    harness.run_steps(2);
    let ask = |harness: &mut Harness<'static, Option<Editor>>| {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::N);
        harness.run_steps(3);
        assert!(matches!(editor(harness).dialog, Some(crate::app::dialogs::Dialog::Unsaved(_))));
    };
    ask(&mut harness);
    let state = |editor: &Editor| {
        let document = &editor.document;
        (document.version(), document.is_dirty(), editor.settings.gallery, editor.tile.painting, editor.exchanged)
    };
    let before = state(editor(&mut harness));
    for (modifiers, key) in [
        (Modifiers::NONE, Key::G),
        (Modifiers::NONE, Key::B),
        (Modifiers::NONE, Key::P),
        (Modifiers::NONE, Key::X),
        (Modifiers::NONE, Key::Delete),
        (Modifiers::COMMAND, Key::Z),
        (Modifiers::COMMAND, Key::S),
    ] {
        harness.key_press_modifiers(modifiers, key);
        harness.run_steps(2);
        assert_eq!(state(editor(&mut harness)), before, "{key:?}");
        assert!(editor(&mut harness).object.comparison.is_none() && editor(&mut harness).dialog.is_some(), "{key:?}");
    }
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    assert!(editor(&mut harness).dialog.is_none() && editor(&mut harness).document.is_dirty());
    ask(&mut harness);
    harness.key_press(Key::Enter);
    harness.run_steps(3);
    assert!(editor(&mut harness).dialog.is_none());
    assert_eq!(editor(&mut harness).document.name, "default", "the new scene replaced the saved one");
    assert_eq!(Document::open(path.to_str().unwrap()).unwrap().scene().tile.size, glam::Vec2::splat(2.0));
}

#[test]
fn the_bottom_width_of_grooves_without_a_bottom_is_inactive() {
    let mut harness = super::tall(quick());
    let slider = |harness: &Harness<'static, Option<Editor>>| {
        harness.get_by_role_and_label(eframe::egui::Role::Slider, "Bottom width").rect().left_center()
    };
    let drag = |harness: &mut Harness<'static, Option<Editor>>| {
        let from = slider(harness) + eframe::egui::vec2(4.0, 0.0);
        let before = editor(harness).document.version();
        harness.drag_at(from);
        harness.step();
        harness.hover_at(from + eframe::egui::vec2(60.0, 0.0));
        harness.step();
        harness.drop_at(from + eframe::egui::vec2(60.0, 0.0));
        harness.run_steps(2);
        editor(harness).document.version() - before
    };
    assert!(drag(&mut harness) > 0);
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    let Geometry::Grooves(grooves) = &mut scene.tile.geometry else { panic!() };
    grooves.profile = crate::scene::GrooveProfile::V;
    editor(&mut harness).document.edit(scene);
    harness.run_steps(2);
    assert_eq!(drag(&mut harness), 0, "a drag on an inactive control edits nothing");
}

#[test]
fn in_a_small_window_the_object_is_large_and_panels_have_their_widths_again_afterwards() {
    let mut harness = harness(quick());
    harness.set_size(eframe::egui::vec2(1440.0, 900.0));
    harness.run_steps(3);
    let rects = |harness: &Harness<'static, Option<Editor>>| {
        ["Object view", "Tile view", "Lobe view"].map(|name| harness.get_by_label(name).rect())
    };
    let before = rects(&harness);
    harness.set_size(eframe::egui::vec2(1024.0, 700.0));
    harness.run_steps(3);
    let window = eframe::egui::Rect::from_min_size(eframe::egui::Pos2::ZERO, eframe::egui::vec2(1024.0, 700.0));
    let small = rects(&harness);
    assert!(small[0].width() >= 460.0 && small[0].height() > 250.0, "{small:?}");
    assert!(small.iter().all(|rect| window.contains_rect(*rect)), "{small:?}");
    assert!(small[1].right() <= small[2].left() && small[2].right() <= small[0].right(), "{small:?}");
    for name in ["Frame", "A/B", "Pick"] {
        let button = harness.get_by_label(name).rect();
        assert!(window.contains_rect(button) && button.bottom() <= small[0].top() + 1.0, "{name}: {button:?}");
    }
    // The gallery opens over the object and changes no size.
    harness.key_press(Key::G);
    harness.run_steps(3);
    assert!(harness.query_by_label("Search the gallery").is_some());
    assert_eq!(rects(&harness)[0], small[0]);
    harness.key_press(Key::G);
    harness.run_steps(3);
    assert!(harness.query_by_label("Search the gallery").is_none());
    harness.set_size(eframe::egui::vec2(1440.0, 900.0));
    harness.run_steps(3);
    assert_eq!(rects(&harness), before);
}

#[test]
fn in_a_small_window_with_large_text_every_number_lies_within_the_window() {
    let mut harness = harness(quick());
    // 1024 x 700 pixels with an interface of size 1.5.
    harness.set_size(eframe::egui::vec2(1024.0 / 1.5, 700.0 / 1.5));
    harness.run_steps(3);
    let numbers: Vec<_> = harness.get_all_by_role(eframe::egui::Role::SpinButton).map(|number| number.rect()).collect();
    assert!(numbers.len() > 10 && numbers.iter().all(|rect| rect.right() <= 1024.0 / 1.5), "{numbers:?}");
}
