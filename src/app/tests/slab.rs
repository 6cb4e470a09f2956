//! The slab panel: faces, material, background, and the plots of the transmitted light.

use std::time::{Duration, Instant};

use crate::scene::{Alpha, Background, SlabFace, SlabSpec};
use eframe::egui::{Role, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::{Vec2, Vec3};

use super::{editor, quick, quick_with, settle, tall};
use crate::app::document::Document;
use crate::app::editor::Editor;
use crate::app::panels::{SlabFile, slab};
use crate::app::worker::SlabLobe;
use crate::scene;

const SLAB: &str = "[slab]\n[slab.top]\nkind = \"beckmann\"\nroughness = 0.2\n[slab.bottom]\nkind = \"ggx\"\nroughness = 0.1\n\
    [background]\nkind = \"checkerboard\"\n";

fn sheet() -> Document {
    quick_with(SLAB)
}

fn spec(harness: &mut Harness<'static, Option<Editor>>) -> SlabSpec {
    editor(harness).document.scene().slab.clone().unwrap()
}

/// Runs frames until the plots fulfil a condition.
fn wait(harness: &mut Harness<'static, Option<Editor>>, ready: impl Fn(&SlabLobe) -> bool) -> Box<SlabLobe> {
    let start = Instant::now();
    loop {
        harness.step();
        if let Some(shown) = editor(harness).slab_lobe.shown.clone().filter(|shown| ready(shown)) {
            return shown;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "no plots");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn the_models_are_plotted_at_once_and_photons_narrow_around_them_until_the_light_moves() {
    let mut harness = tall(sheet());
    settle(&mut harness);
    let first = wait(&mut harness, |_| true);
    assert_eq!(first.curves[0].name, "Eq. 11");
    let early = wait(&mut harness, |shown| shown.truth.is_some()).truth.unwrap();
    let late = wait(&mut harness, |shown| shown.truth.as_ref().is_some_and(|truth| truth.photons >= 3 * early.photons));
    let truth = late.truth.as_ref().unwrap();
    assert!(truth.noise < 0.75 * early.noise, "{early:?} {truth:?}");
    assert_eq!(late.curves.iter().map(|curve| curve.name).collect::<Vec<_>>(), ["Eq. 11", "faces", "reference"]);
    for name in ["Transmitted lobe", "Lobe in the plane of incidence", "Energy bar"] {
        assert!(harness.query_by_label(name).is_some(), "{name}");
    }
    assert!(harness.query_by_label("Lobe view").is_none(), "a slab has no plot of reflection");
    let disc = harness.get_by_label("Transmitted lobe").rect();
    let before = editor(&mut harness).lobe.light;
    harness.drag_at(disc.center());
    harness.step();
    harness.drop_at(disc.center() + vec2(0.0, -0.25 * disc.height()));
    harness.run_steps(2);
    let light = editor(&mut harness).lobe.light;
    assert!(light != before && light.y > 0.3, "{light}");
    let moved = wait(&mut harness, |shown| shown.light == light);
    assert!(moved.truth.is_none_or(|truth| truth.photons <= early.photons), "the photons start again");
    assert_eq!(editor(&mut harness).document.history().len(), 0, "the light of the plots is no edit");
}

#[test]
fn a_change_of_camera_or_background_keeps_the_plots() {
    let mut harness = tall(sheet());
    settle(&mut harness);
    wait(&mut harness, |_| true);
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.camera.get_or_insert_default().azimuth_deg = 5.0;
    scene.background = Background::with_defaults("environment");
    let changed = std::sync::Arc::new(scene::LoadedScene { scene, ..editor(&mut harness).document.loaded() });
    let version = editor(&mut harness).document.version() + 1;
    let (light, log) = (editor(&mut harness).lobe.light, editor(&mut harness).lobe.log);
    assert!(editor(&mut harness).slab_lobe.job(version, &changed, light, log).is_none());
    assert!(editor(&mut harness).slab_lobe.job(version, &changed, Vec3::Z, log).is_some());
}

#[test]
fn index_roughness_and_alpha_have_controls_in_all_their_forms() {
    let mut harness = tall(sheet());
    harness.check_accessibility();
    assert_eq!(spec(&mut harness).alpha, Alpha::Auto);
    harness.get_by_label("Auto").click();
    harness.run_steps(3);
    assert_eq!(spec(&mut harness).alpha, Alpha::Given(0.5));
    harness.get_by_label("Auto").click();
    harness.run_steps(3);
    assert_eq!(spec(&mut harness).alpha, Alpha::Auto);
    // One index for all channels is a slider, and the channels are numbers.
    let named = |harness: &Harness<'static, Option<Editor>>, name: &str| harness.query_all_by_label(name).count();
    assert_eq!(named(&harness, "RGB"), 1);
    harness.get_by_label("RGB").click();
    harness.run_steps(3);
    harness.check_accessibility();
    assert_eq!(spec(&mut harness).eta, Vec3::splat(1.5), "the form alone changes nothing");
    // Both faces have a roughness, which splits into one along each axis.
    assert_eq!(named(&harness, "x, y"), 2);
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    if let Some(SlabFace::Beckmann(face)) = scene.slab.as_mut().map(|slab| &mut slab.top) {
        face.roughness = Vec2::new(0.1, 0.3);
    }
    editor(&mut harness).document.edit(scene);
    harness.run_steps(3);
    harness.get_all_by_label("x, y").next().unwrap().click();
    harness.run_steps(3);
    let SlabFace::Beckmann(face) = spec(&mut harness).top else { panic!() };
    assert!((face.roughness - Vec2::splat(0.2)).length() < 1e-6, "one roughness is the mean of both: {face:?}");
    assert!(editor(&mut harness).messages.texts().is_empty());
}

#[test]
fn the_cost_tab_of_a_slab_measures_nothing_and_says_why() {
    let mut harness = tall(sheet());
    harness.key_press(eframe::egui::Key::F6);
    harness.run_steps(5);
    assert!(harness.query_by_label_contains("measured for opaque tiles").is_some());
    assert!(harness.query_by_label("Compare with reference").is_none());
    assert!(editor(&mut harness).accuracy.activity.is_none());
}

#[test]
fn a_slab_is_added_and_removed_and_its_background_is_dragged_away_in_one_undo_step() {
    let mut harness = tall(quick());
    harness.get_by_label("Slab").click();
    harness.run_steps(8);
    harness.get_by_label("Thin transparent slab").click();
    harness.run_steps(3);
    assert!(matches!(spec(&mut harness).bottom, SlabFace::Ggx(_)));
    let slider = harness.get_by_role_and_label(Role::Slider, "Distance").rect();
    let from = slider.left_center() + vec2(4.0, 0.0);
    let before = editor(&mut harness).document.history().len();
    harness.drag_at(from);
    harness.step();
    for k in 1..=4 {
        harness.hover_at(from + vec2(20.0 * k as f32, 0.0));
        harness.step();
    }
    harness.drop_at(from + vec2(80.0, 0.0));
    harness.run_steps(2);
    let Some(Background::Checkerboard(board)) = editor(&mut harness).document.scene().background.clone() else {
        panic!()
    };
    assert!(board.distance > 0.3, "{}", board.distance);
    assert_eq!(editor(&mut harness).document.history().len(), before + 1);
    harness.get_by_label("Thin transparent slab").click();
    harness.run_steps(3);
    let scene = editor(&mut harness).document.scene().clone();
    assert!(scene.slab.is_none() && scene.background.is_none());
}

#[test]
fn chosen_files_become_faces_backgrounds_and_captured_sheets() {
    let mut scene = (**sheet().scene()).clone();
    slab::set_file(&mut scene, SlabFile::Table { is_top: true }, "slopes.csv".into());
    slab::set_file(&mut scene, SlabFile::Tile { is_top: false }, "other.toml".into());
    slab::set_file(&mut scene, SlabFile::Background, "sky.png".into());
    let spec = scene.slab.clone().unwrap();
    assert_eq!(spec.top.path(), Some("slopes.csv".as_ref()));
    assert_eq!(spec.bottom.path(), Some("other.toml".as_ref()));
    assert_eq!(scene.background.as_ref().and_then(Background::path), Some("sky.png".as_ref()));
    slab::set_file(&mut scene, SlabFile::Svbtdf, "sheet.npz".into());
    scene.validate().unwrap();
    assert_eq!(scene.slab.unwrap().svbtdf, Some("sheet.npz".into()));
}
