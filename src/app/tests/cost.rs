//! Tests of the accuracy and effects panels, the chart, and the stated error in the status line.

use crate::scene::Geometry;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::{editor, harness, quick, settle};
use crate::app::editor::Editor;

#[test]
fn the_accuracy_panel_measures_the_scene_and_its_slider_sets_the_quality_level() {
    let mut harness = harness(quick());
    harness.set_size(eframe::egui::vec2(1400.0, 1500.0));
    harness.run_steps(2);
    settle(&mut harness);
    assert!(harness.query_by_label("Accuracy chart").is_none(), "the hidden panel measures nothing");
    harness.get_by_label("Cost").click();
    harness.run_steps(4);
    let wait = |harness: &mut egui_kittest::Harness<'static, Option<crate::app::editor::Editor>>| {
        let start = std::time::Instant::now();
        loop {
            harness.step();
            let editor = editor(harness);
            if !editor.is_busy() && editor.accuracy.is_measured(editor.document.version()) {
                return;
            }
            assert!(start.elapsed().as_secs() < 600, "not measured");
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    };
    wait(&mut harness);
    assert_eq!(editor(&mut harness).accuracy.point_counts(), [0, 5], "all points are compared with the reference");
    assert!(harness.query_by_label("Accuracy chart").is_some());
    let slider = harness.get_all_by_role(eframe::egui::Role::Slider).last().unwrap();
    slider.set_value_accesskit(5.0);
    harness.run_steps(2);
    let quality = editor(&mut harness).document.scene().quality.clone();
    assert_eq!(quality.facets, Some(512), "{quality:?}");
    assert!(quality.azimuths.is_some());
    wait(&mut harness);
    assert!(editor(&mut harness).messages.texts().is_empty());
}

#[test]
fn the_effects_panel_forces_an_effect_and_the_image_follows() {
    let mut harness = harness(quick());
    settle(&mut harness);
    let before = editor(&mut harness).object.preview.as_ref().unwrap().radiance.as_ref().unwrap().pixels.clone();
    harness.set_size(eframe::egui::vec2(1400.0, 2600.0));
    harness.run_steps(2);
    settle(&mut harness);
    harness.get_by_label("Cost").click();
    harness.run_steps(4);
    assert!(harness.query_by_label("Visibility").is_some() && harness.query_by_label("Interreflection").is_some());
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.effects.visibility = crate::scene::Switch::Off;
    editor(&mut harness).document.edit(scene);
    harness.run_steps(1);
    settle(&mut harness);
    let preview = editor(&mut harness).object.preview.clone().unwrap();
    let effect = preview.effects.iter().find(|effect| effect.name == "visibility").unwrap();
    assert!(effect.forced && !effect.on);
    assert_ne!(preview.radiance.as_ref().unwrap().pixels, before);
    // The chart above is being measured, so that the button moves.
    harness.get_by_label("As planned").click_accesskit();
    harness.run_steps(2);
    assert!(editor(&mut harness).document.scene().effects.is_default());
}

#[test]
fn the_status_line_states_the_error_of_a_resting_image_and_a_moved_camera_keeps_it() {
    let mut harness = harness(quick());
    settle(&mut harness);
    let wait = |harness: &mut Harness<'static, Option<Editor>>| {
        let start = std::time::Instant::now();
        while editor(harness).object.stated_error().is_none() {
            harness.step();
            assert!(start.elapsed().as_secs() < 60, "no stated error");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        harness.step();
    };
    wait(&mut harness);
    let error = editor(&mut harness).object.stated_error().unwrap();
    assert!(error.rel_l2 > 0.0 && error.psnr_db.is_some(), "{error:?}");
    let stated = format!("{:.0} ± 3 dB stated", error.psnr_db.unwrap());
    assert!(harness.query_by_label_contains(&stated).is_some(), "{stated}");
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.camera.get_or_insert_default().azimuth_deg = 33.0;
    editor(&mut harness).document.edit(scene.clone());
    harness.step();
    settle(&mut harness);
    assert_eq!(editor(&mut harness).object.stated_error(), Some(error), "the BRDF is the same");
    let Geometry::Grooves(grooves) = &mut scene.tile.geometry else { panic!() };
    grooves.depth *= 1.5;
    editor(&mut harness).document.edit(scene);
    harness.step();
    settle(&mut harness);
    assert_eq!(editor(&mut harness).object.stated_error(), None, "the error of the old BRDF is no longer shown");
    wait(&mut harness);
    assert_ne!(editor(&mut harness).object.stated_error(), Some(error));
}

#[test]
fn the_chart_draws_its_first_points_from_stated_errors_before_the_reference() {
    let mut harness = harness(quick());
    harness.set_size(eframe::egui::vec2(1400.0, 1500.0));
    harness.run_steps(2);
    settle(&mut harness);
    harness.get_by_label("Cost").click();
    let start = std::time::Instant::now();
    let counts = loop {
        harness.step();
        let counts = editor(&mut harness).accuracy.point_counts();
        if counts != [0, 0] {
            break counts;
        }
        assert!(start.elapsed().as_secs() < 100, "not measured");
        std::thread::sleep(std::time::Duration::from_millis(2));
    };
    println!("first points {:.2} s after unfolding the panel", start.elapsed().as_secs_f64());
    assert!(counts[0] > 0 && counts[1] == 0, "{counts:?}");
}
