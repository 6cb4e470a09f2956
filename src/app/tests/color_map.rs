//! The colour map panel: stops, drivers, weights, presets and the values of drivers.

use std::time::{Duration, Instant};

use crate::scene::{ColorMap, Driver, GradientStop, LayerWeight, StopUnit};
use eframe::egui::{Event, Key, Modifiers, PointerButton, Pos2, Role, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::Vec3;

use super::{editor, quick, quick_with, settle, tall};
use crate::app::actions::Action;
use crate::app::document::Document;
use crate::app::editor::Editor;
use crate::app::panels::DriverPlace;
use crate::scene;

const MAP: &str = "[[color_map.layer]]\nname = \"snow\"\ndriver = { kind = \"height\" }\n\
    stops = [[-1.0, [0.5, 0.2, 0.1]], [0.0, [0.1, 0.1, 0.1]], [1.0, [0.9, 0.9, 0.9]]]\n";

fn mapped() -> Document {
    quick_with(MAP)
}

fn map(harness: &mut Harness<'static, Option<Editor>>) -> ColorMap {
    editor(harness).document.scene().color_map.clone().unwrap()
}

fn values(harness: &mut Harness<'static, Option<Editor>>) -> Vec<f64> {
    map(harness).layer[0].stops.iter().map(|stop| stop.value).collect()
}

fn undo_count(harness: &mut Harness<'static, Option<Editor>>) -> usize {
    editor(harness).document.history().len()
}

fn handle(harness: &Harness<'static, Option<Editor>>, name: &str) -> Pos2 {
    harness.get_by_label(name).rect().center()
}

fn double_click(harness: &mut Harness<'static, Option<Editor>>, pos: Pos2) {
    harness.hover_at(pos);
    harness.step();
    // Queued events would have a frame each, which is too slow for a double click.
    for pressed in [true, false, true, false] {
        let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
        harness.input_mut().events.push(Event::PointerButton { pos, button, pressed, modifiers });
    }
    harness.step();
}

/// Runs frames until the values of the first driver arrive, with those at a picked point if asked for.
fn wait_for_values(harness: &mut Harness<'static, Option<Editor>>, picked: bool) {
    let start = Instant::now();
    loop {
        harness.step();
        let driver = map(harness).layer[0].driver.clone();
        let known = editor(harness).color_map.values_of(&driver);
        if known.is_some_and(|values| values.seen.is_some() == picked) {
            return;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "no values");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn dragging_a_stop_is_one_undo_step_and_the_image_follows() {
    let mut harness = tall(mapped());
    settle(&mut harness);
    let image = |harness: &mut Harness<'static, Option<Editor>>| {
        editor(harness).object.preview.as_ref().unwrap().radiance.as_ref().unwrap().pixels.clone()
    };
    let before = image(&mut harness);
    let from = handle(&harness, "Stop 2 of 3");
    harness.drag_at(from);
    harness.step();
    for k in 1..=4 {
        harness.hover_at(from + vec2(8.0 * k as f32, 2.0));
        harness.step();
    }
    assert!(values(&mut harness)[1] > 0.2, "the scene follows while the pointer is down");
    harness.drop_at(from + vec2(32.0, 2.0));
    harness.run_steps(2);
    let moved = values(&mut harness);
    assert!(moved[0] == -1.0 && moved[2] == 1.0 && (0.3..0.95).contains(&moved[1]), "{moved:?}");
    assert_eq!(editor(&mut harness).document.undo_name(), Some("Stops of \"snow\""));
    assert_eq!(undo_count(&mut harness), 1);
    settle(&mut harness);
    assert!(image(&mut harness) != before, "the image has the colours of the moved stop");
    editor(&mut harness).document.undo();
    assert_eq!(values(&mut harness), [-1.0, 0.0, 1.0]);
}

#[test]
fn a_double_click_adds_a_stop_and_the_keyboard_moves_and_deletes_it() {
    let mut harness = tall(mapped());
    let between = handle(&harness, "Stop 2 of 3").lerp(handle(&harness, "Stop 3 of 3"), 0.5);
    double_click(&mut harness, between - vec2(0.0, 25.0));
    let added = map(&mut harness).layer[0].stops[2];
    assert!((added.value - 0.5).abs() < 0.03 && (added.color.x - 0.5).abs() < 0.03, "{added:?}");
    assert_eq!(undo_count(&mut harness), 1);
    harness.run_steps(2);
    harness.key_press(Key::ArrowRight);
    harness.run_steps(2);
    assert!(values(&mut harness)[2] > added.value + 0.02, "{:?}", values(&mut harness));
    harness.key_press_modifiers(Modifiers::SHIFT, Key::ArrowLeft);
    harness.run_steps(2);
    assert!(values(&mut harness)[2] < added.value, "{:?}", values(&mut harness));
    harness.key_press(Key::Delete);
    harness.run_steps(2);
    assert_eq!(values(&mut harness), [-1.0, 0.0, 1.0]);
    // The stop before the deleted one is selected, and the next key deletes it.
    harness.key_press(Key::Delete);
    harness.run_steps(2);
    assert_eq!(values(&mut harness), [-1.0, 1.0]);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(2);
    assert_eq!(values(&mut harness), [-1.0, 0.0, 1.0]);
}

#[test]
fn a_jump_splits_the_selected_stop_and_a_preset_replaces_all_in_one_step() {
    let mut harness = tall(mapped());
    harness.get_by_label("Stop 2 of 3").click();
    harness.run_steps(2);
    harness.get_by_label("Jump").click();
    harness.run_steps(2);
    let stops = map(&mut harness).layer[0].stops.clone();
    assert_eq!((stops.len(), stops[1].value, stops[2].value), (4, 0.0, 0.0));
    assert_eq!(stops[2].color, Vec3::splat(0.9));
    let before = undo_count(&mut harness);
    harness.get_by(|node| node.role() == Role::ComboBox && node.value() == Some("Own stops".into())).click();
    harness.run_steps(3);
    harness.get_by_label("Four bands").click();
    harness.run_steps(3);
    assert_eq!(values(&mut harness), [-1.2, -1.2, -0.4, -0.4, 0.3, 0.3, 1.0, 1.0]);
    assert_eq!(undo_count(&mut harness), before + 1);
}

#[test]
fn the_histogram_comes_from_a_worker_and_a_picked_point_adds_what_is_visible_there() {
    let mut harness = tall(mapped());
    settle(&mut harness);
    wait_for_values(&mut harness, false);
    let ctx = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::Pick);
    let center = harness.get_by_label("Object view").rect().center();
    harness.hover_at(center);
    wait_for_values(&mut harness, true);
    let driver = map(&mut harness).layer[0].driver.clone();
    let seen = editor(&mut harness).color_map.values_of(&driver).unwrap().seen.clone().unwrap();
    assert!((0.9..1.01).contains(&seen.iter().sum::<f32>()));
    // Stops are no input of the values.
    let version = editor(&mut harness).document.version();
    let loaded = std::sync::Arc::new(editor(&mut harness).document.loaded());
    let picked = editor(&mut harness).lobe.viewer.map(|viewer| (editor(&mut harness).lobe.light, viewer));
    let mut recolored = (*loaded).clone();
    recolored.scene.color_map.as_mut().unwrap().layer[0].stops[0].value = -2.0;
    let state = &mut editor(&mut harness).color_map;
    assert!(state.job(version + 1, &std::sync::Arc::new(recolored.clone()), picked).is_none());
    recolored.scene.tile.geometry = scene::Geometry::with_defaults("pyramids").unwrap();
    assert!(state.job(version + 2, &std::sync::Arc::new(recolored), picked).is_some());
}

#[test]
fn a_map_is_added_to_any_surface_and_removed_and_a_layer_has_a_driver_of_its_own() {
    let mut harness = tall(quick());
    harness.get_by_label("Colour map").click();
    harness.run_steps(8);
    harness.get_by_label("Colours by height, slope or noise").click();
    harness.run_steps(3);
    assert_eq!(map(&mut harness).layer[0].driver.kind(), "height");
    harness.get_by_label("Add a layer").click();
    harness.run_steps(3);
    let two = map(&mut harness);
    assert_eq!((two.layer.len(), two.layer[1].driver.kind(), two.layer[1].name.as_str()), (2, "noise", "layer 2"));
    assert!(editor(&mut harness).messages.texts().is_empty());
    // Results that arrive later move the button.
    settle(&mut harness);
    harness.get_all_by_label("Remove layer").last().unwrap().click();
    harness.run_steps(3);
    assert_eq!(map(&mut harness).layer.len(), 1);
    harness.get_by_label("Colours by height, slope or noise").click();
    harness.run_steps(3);
    assert!(editor(&mut harness).document.scene().color_map.is_none());
    // A flat tile has no heights.
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.tile.geometry = scene::Geometry::with_defaults("flat").unwrap();
    editor(&mut harness).document.edit(scene);
    harness.run_steps(3);
    harness.get_by_label("Colours by height, slope or noise").click();
    harness.run_steps(3);
    assert_eq!(map(&mut harness).layer[0].driver.kind(), "noise");
    assert!(editor(&mut harness).messages.texts().is_empty());
}

#[test]
fn a_scene_of_the_gallery_unfolds_the_sections_that_it_uses() {
    let mut harness = tall(quick());
    let ctx = harness.ctx.clone();
    assert!(harness.query_by_label("Colour bar").is_none() && harness.query_by_label("Top").is_none());
    editor(&mut harness).set_document(mapped());
    harness.run_steps(8);
    assert!(harness.query_by_label("Colour bar").is_some());
    editor(&mut harness).action(&ctx, Action::OpenShipped("slab_window".to_owned()));
    harness.run_steps(8);
    assert!(harness.query_by_label("Colour bar").is_none() && harness.query_by_label("Top").is_some());
}

#[test]
fn a_weight_by_a_driver_has_stops_of_its_own_and_a_chosen_image_becomes_the_driver() {
    let mut harness = tall(mapped());
    harness.get_by_label("By a driver").click();
    harness.run_steps(3);
    let LayerWeight::Blend(blend) = map(&mut harness).layer[0].weight.clone() else { panic!() };
    assert_eq!((blend.driver.kind(), blend.stops.len()), ("noise", 2));
    assert_eq!(harness.get_all_by_label("Colour bar").count(), 2);
    harness.check_accessibility();
    let ctx = harness.ctx.clone();
    let place = DriverPlace { layer: 0, of_weight: true, term: None };
    let purpose = crate::app::dialogs::Purpose::DriverImage(place);
    editor(&mut harness).use_file(&ctx, purpose, "asset:ripples.png".into());
    let LayerWeight::Blend(blend) = map(&mut harness).layer[0].weight.clone() else { panic!() };
    assert!(matches!(&blend.driver, Driver::Texture(texture) if texture.path.ends_with("asset:ripples.png")));
    assert_eq!(editor(&mut harness).document.undo_name(), Some("Driver of \"snow\""));
}

#[test]
fn every_kind_of_driver_is_edited_without_a_refused_edit() {
    let mut harness = tall(mapped());
    let fresh = (**editor(&mut harness).document.scene()).clone();
    for kind in ["noise", "height", "slope", "steepness", "sum"] {
        let mut scene = fresh.clone();
        let layer = &mut scene.color_map.as_mut().unwrap().layer[0];
        layer.driver = crate::app::panels::color_map::initial(kind, true);
        layer.unit = if kind == "noise" { StopUnit::Value } else { StopUnit::Deviation };
        layer.stops.push(GradientStop { value: 3.0, color: Vec3::splat(2.0) });
        editor(&mut harness).apply_edit(scene);
        harness.run_steps(3);
        wait_for_values(&mut harness, false);
        harness.run_steps(2);
        harness.check_accessibility();
        assert!(editor(&mut harness).messages.texts().is_empty(), "{kind}");
        assert!(editor(&mut harness).color_map.error.is_none(), "{kind}");
    }
}
