//! Titles of views, warnings with their remedies, hints, and the values of automatic settings.

use eframe::egui::{Key, vec2};
use egui_kittest::kittest::Queryable;

use super::cost_strip::of_size;
use super::{QUICK, editor, quick};
use crate::app::dialogs::Purpose;
use crate::app::document::Document;
use crate::app::panels::Tab;
use crate::scene::{self, BrdfSpec, LoadedScene, TermSpec};

#[test]
fn both_views_the_section_and_the_reflection_have_titles() {
    let mut harness = of_size(quick(), 1440.0, 900.0);
    for title in ["Object", "Tile", "Section", "Reflection"] {
        assert!(harness.query_all_by_label(title).count() > 0, "{title}");
    }
    let section = harness.get_by_label("Section of the tile").rect();
    let tile = harness.get_by_label("Tile view").rect();
    assert!(section.top() >= tile.bottom() && section.bottom() <= 900.0, "{tile:?} {section:?}");
    let section = editor(&mut harness).tile.rendered.as_ref().unwrap().section.clone();
    assert!(section.height() > 0.0 && !section.lines.is_empty());
}

#[test]
fn each_warning_opens_the_section_that_holds_its_remedy() {
    let mut harness = of_size(quick(), 1440.0, 900.0);
    editor(&mut harness).object.warnings = vec!["the factors are too coarse: raise quality.keep_m".to_owned()];
    harness.run_steps(2);
    harness.get_by_label("1 warning").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("Back to the preset").is_none());
    harness.get_by_label("Show").click();
    harness.run_steps(8);
    assert!(editor(&mut harness).tab == Tab::Cost);
    let preset = harness.get_by_label("Preset").rect();
    assert!(preset.top() > 0.0 && preset.bottom() < 900.0, "{preset:?}");
}

#[test]
fn a_setting_that_the_preset_decides_states_the_value_in_force() {
    let mut harness = of_size(quick(), 1440.0, 900.0);
    harness.set_size(vec2(1440.0, 3000.0));
    harness.key_press(Key::F6);
    harness.run_steps(3);
    harness.get_by_label("Quality").click();
    harness.run_steps(8);
    harness.get_by_label("Advanced").click();
    harness.run_steps(8);
    assert_eq!(harness.query_all_by_label("automatic: 0.999").count(), 2, "the kept energies");
    assert!(harness.query_by_label_contains("automatic: 1.14").is_some(), "the width of the transition");
}

#[test]
fn a_surface_that_is_nearly_black_says_why() {
    let dark = QUICK.replace(
        "brdf = { kind = \"cook_torrance\", roughness = 0.4, f0 = 0.8 }",
        "brdf = { kind = \"lambertian\", albedo = 0.004 }",
    );
    assert_ne!(dark, QUICK);
    let loaded = LoadedScene {
        scene: scene::parse(&dark).unwrap(),
        base_dir: "".into(),
        name: "dark".into(),
        painted: Default::default(),
    };
    let mut harness = of_size(Document::new(loaded, None), 1440.0, 900.0);
    let warnings = editor(&mut harness).object.warnings.join("; ");
    assert!(warnings.contains("because its materials are dark"), "{warnings}");
    let mut harness = of_size(quick(), 1440.0, 900.0);
    assert!(editor(&mut harness).object.warnings.is_empty());
}

#[test]
fn opening_a_file_that_is_no_scene_offers_it_where_it_fits() {
    let mut harness = of_size(quick(), 1440.0, 900.0);
    let ctx = harness.ctx.clone();
    let before = editor(&mut harness).document.version();
    editor(&mut harness).use_file(&ctx, Purpose::OpenScene, "/elsewhere/gold.binary".into());
    harness.run_steps(3);
    assert!(harness.query_by_label("gold.binary is a MERL BRDF. The open scene can use it.").is_some());
    harness.key_press(Key::Escape);
    harness.run_steps(3);
    assert_eq!(editor(&mut harness).document.version(), before);
    editor(&mut harness).use_file(&ctx, Purpose::OpenScene, "/elsewhere/gold.binary".into());
    harness.run_steps(3);
    harness.get_by_label("Use it in Default").click();
    harness.run_steps(3);
    let material = editor(&mut harness).document.scene().materials[0].clone();
    assert!(matches!(material.brdf, Some(BrdfSpec::One(TermSpec::Merl { .. }))), "{material:?}");
    editor(&mut harness).use_file(&ctx, Purpose::OpenScene, "/elsewhere/sky.hdr".into());
    harness.run_steps(3);
    harness.get_by_label("Use it as the environment").click();
    harness.run_steps(3);
    assert_eq!(editor(&mut harness).document.scene().light.environment, "/elsewhere/sky.hdr");
}
