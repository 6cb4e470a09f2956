//! The window on a folder of photographs of a sheet.

use eframe::egui::Context;
use egui_kittest::kittest::Queryable;

use super::{editor, harness, quick, settle, wait_until};
use crate::app::actions::Action;
use crate::app::dialogs::{Dialog, Purpose};
use crate::slab::capture::hard_cases_tests::{Case, GRID, write_folder};

#[test]
fn a_capture_folder_shows_dots_a_slice_and_the_slopes_of_the_picked_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let radiance = |_: usize, pixel: usize, value: f64| if pixel == 0 { 0.0 } else { value as f32 };
    write_folder(folder.path(), &Case { dots: GRID, pixels: [3, 2], radiance: &radiance });
    let mut harness = harness(quick());
    settle(&mut harness);
    let ctx: Context = harness.ctx.clone();
    editor(&mut harness).action(&ctx, Action::OpenCapture);
    assert!(matches!(&editor(&mut harness).dialog, Some(Dialog::Files(files)) if files.purpose == Purpose::Capture));
    editor(&mut harness).dialog = None;
    editor(&mut harness).dropped(&ctx, folder.path().join("rig.toml"));
    wait_until(&mut harness, |editor| editor.capture.shown.is_some());
    let shown = editor(&mut harness).capture.shown.clone().unwrap();
    assert_eq!((shown.dots.len(), shown.size), (144, [3, 2]));
    let lobe = shown.lobe.unwrap();
    assert!((lobe.roughness - 0.2).abs() < 0.06 && lobe.residual < 0.2, "{lobe:?}");
    for label in ["Photograph", "Dots on the monitor", "Slice of the data", "Distribution of slopes"] {
        assert!(harness.query_by_label(label).is_some(), "{label}");
    }
    // The first pixel, at the lower left, is black.
    let photograph = harness.get_by_label("Photograph").rect();
    let black = photograph.min + photograph.size() * eframe::egui::vec2(0.1, 0.75);
    harness.drag_at(black);
    harness.run_steps(1);
    harness.drop_at(black);
    wait_until(&mut harness, |editor| editor.capture.shown.as_ref().is_some_and(|shown| shown.lobe.is_none()));
    assert!(harness.query_by_label("This pixel shows no lobe.").is_some());
    // A dot shows its own photograph.
    let dots = harness.get_by_label("Dots on the monitor").rect();
    harness.drag_at(dots.center());
    harness.run_steps(1);
    harness.drop_at(dots.center());
    wait_until(&mut harness, |editor| editor.capture.shown.as_ref().is_some_and(|shown| shown.job.dot.is_some()));
    assert!(harness.query_by_label_contains("Photograph of dot ").is_some());
    assert!(editor(&mut harness).messages.texts().is_empty());
}

#[test]
fn a_folder_without_its_photographs_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    write_folder(folder.path(), &Case { dots: GRID, pixels: [1, 1], radiance: &|_, _, value| value as f32 });
    std::fs::remove_file(folder.path().join("d7.exr")).unwrap();
    let mut harness = harness(quick());
    settle(&mut harness);
    let ctx = harness.ctx.clone();
    editor(&mut harness).dropped(&ctx, folder.path().join("rig.toml"));
    wait_until(&mut harness, |editor| editor.capture.error.is_some());
    assert!(harness.query_by_label_contains("d7.exr").is_some());
}
