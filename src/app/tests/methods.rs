//! Methods beside each other in the object view, and the zoom to the size of tiles.

use std::time::{Duration, Instant};

use eframe::egui::{Event, Key, Modifiers, Role, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::{editor, quick, quick_with, settle, tall};
use crate::app::editor::Editor;
use crate::app::views::zoom::TileScale;
use crate::app::worker::MethodImage;
use crate::scene::Background;

const MAP: &str = "[[color_map.layer]]\ndriver = { kind = \"height\" }\n\
    stops = [[-1.0, [0.5, 0.2, 0.1]], [-1.0, 0.1], [1.0, 0.9]]\n";
const SLAB: &str = "[slab]\ntop = { kind = \"beckmann\", roughness = 0.1 }\nbottom = { kind = \"ggx\", roughness = 0.1 }\n\
    [background]\nkind = \"checkerboard\"\n[object]\nkind = \"sheet\"\n";

/// Runs frames until the images of the open version fulfil a condition.
fn wait(harness: &mut Harness<'static, Option<Editor>>, ready: impl Fn(&[MethodImage]) -> bool) -> Vec<MethodImage> {
    let start = Instant::now();
    loop {
        harness.step();
        let editor = editor(harness);
        let images: Vec<MethodImage> = editor.methods.images(editor.document.version()).cloned().collect();
        if ready(&images) {
            return images;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "no images: {:?}", editor.messages.texts());
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn names(images: &[MethodImage]) -> Vec<&'static str> {
    images.iter().map(|image| image.name).collect()
}

#[test]
fn a_key_shows_the_methods_of_a_colour_map_and_an_edit_renders_them_again() {
    let mut harness = tall(quick_with(MAP));
    harness.set_size(vec2(900.0, 500.0));
    settle(&mut harness);
    harness.key_press(Key::M);
    harness.run_steps(2);
    assert!(editor(&mut harness).methods.on);
    let images = wait(&mut harness, |images| images.len() == 3 && images[1].passes >= 3);
    assert_eq!(names(&images), ["naive", "reference", "filtered"]);
    assert!(images[1].noise.is_some_and(f32::is_finite) && images[0].difference.is_some(), "{images:?}");
    harness.run_steps(2);
    let line = harness.get_by_label("First line between methods").rect().center();
    let before = editor(&mut harness).methods.lines;
    let camera = editor(&mut harness).document.scene().camera.clone();
    harness.drag_at(line);
    harness.step();
    harness.hover_at(line - vec2(40.0, 0.0));
    harness.step();
    harness.drop_at(line - vec2(40.0, 0.0));
    harness.run_steps(2);
    let after = editor(&mut harness).methods.lines;
    assert!(after[0] < before[0] - 0.05 && after[1] == before[1], "{after:?}");
    assert_eq!(editor(&mut harness).document.scene().camera, camera, "a line is dragged and not the object");
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.color_map.as_mut().unwrap().layer[0].stops[2].color *= 0.5;
    editor(&mut harness).document.edit(scene);
    harness.step();
    assert_eq!(wait(&mut harness, |_| true).len(), 0, "images of another version are not shown");
    assert_eq!(wait(&mut harness, |images| !images.is_empty()).len(), 3);
    harness.key_press(Key::M);
    harness.run_steps(2);
    assert!(!editor(&mut harness).methods.on && harness.query_by_label("First line between methods").is_none());
}

#[test]
fn a_slab_has_three_methods_and_a_scene_with_neither_has_none() {
    let mut harness = tall(quick_with(SLAB));
    harness.set_size(vec2(900.0, 500.0));
    settle(&mut harness);
    harness.get_by_label("Methods").click();
    let images = wait(&mut harness, |images| images.len() == 3 && images[2].passes >= 2);
    assert_eq!(names(&images), ["Eq. 11", "faces", "reference"]);
    let mut plain = tall(quick());
    assert!(plain.query_by_label("Methods").is_none());
    plain.key_press(Key::M);
    plain.run_steps(2);
    assert!(plain.query_by_label("First line between methods").is_none());
}

#[test]
fn the_zoom_slider_of_a_colour_map_moves_the_camera_in_one_undo_step() {
    let mut harness = tall(quick_with(MAP));
    settle(&mut harness);
    harness.run_steps(2);
    let slider = harness.get_by_role_and_label(Role::Slider, "Pixels per tile");
    slider.set_value_accesskit(40.0);
    harness.run_steps(2);
    let editor = editor(&mut harness);
    let camera = editor.document.scene().camera.clone().unwrap();
    let scale = TileScale { framing: 4.0, height: editor.size[1] as f32 };
    assert!((scale.pixels(&camera) / 40.0 - 1.0).abs() < 0.02, "{camera:?}");
    assert_eq!(editor.document.history().len(), 1);
}

#[test]
fn a_drag_with_ctrl_moves_the_background_of_a_slab_away() {
    let mut harness = tall(quick_with(SLAB));
    settle(&mut harness);
    let distance = |harness: &mut Harness<'static, Option<Editor>>| {
        let Some(Background::Checkerboard(board)) = editor(harness).document.scene().background.clone() else {
            panic!()
        };
        board.distance
    };
    let before = distance(&mut harness);
    let camera = editor(&mut harness).document.scene().camera.clone();
    let view = harness.get_by_label("Object view").rect().center();
    // The modifier is held until the end of the drag.
    harness.event(Event::ModifiersChanged(Modifiers::COMMAND));
    harness.drag_at(view);
    harness.step();
    for k in 1..=3 {
        harness.hover_at(view - vec2(0.0, 30.0 * k as f32));
        harness.step();
    }
    harness.drop_at(view - vec2(0.0, 90.0));
    harness.run_steps(2);
    assert!(distance(&mut harness) > 1.5 * before, "{} {before}", distance(&mut harness));
    assert_eq!(editor(&mut harness).document.scene().camera, camera);
    assert_eq!(editor(&mut harness).document.history().len(), 1);
}
