//! Places of the strip and of the Cost tab: they stay while results arrive, and wide texts stay inside.

use eframe::egui::{Key, Rect, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::cost_strip::{deep, of_size, point};
use super::{editor, quick};
use crate::app::editor::Editor;
use crate::app::panels::effects::caption;
use crate::plan::{effect_names, switch_mut};
use crate::report::EffectCost;

fn costs() -> Vec<EffectCost> {
    let cost = |name| EffectCost {
        name,
        on_ms: 21_631.0,
        off_ms: 100.0,
        std_error_ms: Some(12.0),
        auto_ms: 100.0,
        rel_l2: 0.05,
        mean_delta_e: 12.3,
        high_delta_e: 20.0,
    };
    effect_names().map(cost).collect()
}

fn record_costs(harness: &mut Harness<'static, Option<Editor>>, costs: Vec<EffectCost>) {
    let version = editor(harness).document.version();
    editor(harness).accuracy.costs = Some((version, costs));
    harness.run_steps(2);
}

#[test]
fn the_strip_stays_in_place_while_its_image_is_measured() {
    let mut harness = of_size(deep("off"), 1440.0, 900.0);
    let places = |harness: &Harness<'static, Option<Editor>>| -> Vec<Rect> {
        ["1 effect left out", "CPU"].map(|label| harness.get_by_label_contains(label).rect()).to_vec()
    };
    let before = places(&harness);
    let version = editor(&mut harness).document.version();
    editor(&mut harness).accuracy.activity = Some("Settings 1 of 5".to_owned());
    harness.step();
    assert_eq!(places(&harness), before);
    editor(&mut harness).accuracy.record(version, vec![point(4096, 1300.0, 61.0)], point(128, 410.0, 52.0));
    harness.run_steps(2);
    assert_eq!(places(&harness), before);
    editor(&mut harness).object.requested_at = Some(std::time::Instant::now());
    harness.step();
    assert_eq!(places(&harness), before);
}

#[test]
fn the_cost_tab_stays_in_place_while_results_arrive() {
    let mut harness = of_size(quick(), 1440.0, 1900.0);
    // During an export nothing is measured that would replace the recorded points.
    editor(&mut harness).exporting = Some((0.0, "Testing"));
    harness.key_press(Key::F6);
    harness.run_steps(3);
    let place = |harness: &Harness<'static, Option<Editor>>| harness.get_by_label("Compare with reference").rect();
    let version = editor(&mut harness).document.version();
    let (level, better) = (point(512, 200.0, 36.0), point(512, 200.0, 56.0));
    let now = point(128, 600.0, 37.0);
    let mut last = None;
    for levels in [vec![], vec![level], vec![level, better]] {
        editor(&mut harness).accuracy.record(version, levels, now);
        harness.run_steps(2);
        let place = place(&harness);
        assert_eq!(*last.get_or_insert(place), place);
    }
    let buttons = |harness: &Harness<'static, Option<Editor>>| harness.get_by_label("All decisions").rect();
    harness.get_by_label("Measure each").click_accesskit();
    harness.run_steps(2);
    let before = buttons(&harness);
    editor(&mut harness).accuracy.measuring = false;
    record_costs(&mut harness, costs());
    assert_eq!(buttons(&harness), before);
}

#[test]
fn every_measured_effect_lies_within_its_panel_at_widths_280_and_400() {
    let mut harness = of_size(quick(), 1400.0, 3000.0);
    harness.key_press(Key::F6);
    harness.run_steps(3);
    for (width, window) in [(280.0, 1410.0), (400.0, 1420.0)] {
        editor(&mut harness).settings.parameters_width = width;
        harness.set_size(vec2(window, 3000.0));
        harness.run_steps(4);
        // In a window of another width the panel is another one.
        harness.get_by_label_contains("Shortcuts: ").click_accesskit();
        harness.run_steps(8);
        record_costs(&mut harness, costs());
        let rows: Vec<Rect> = harness.get_all_by_label("+21531.0 ± 12.0 ms, ΔE 12.3").map(|node| node.rect()).collect();
        assert_eq!(rows.len(), effect_names().count(), "{width}");
        for row in rows {
            assert!(row.left() >= window - width && row.right() <= window, "{width}: {row:?}");
        }
    }
}

#[test]
fn a_difference_below_its_error_is_within_noise() {
    let mut harness = of_size(quick(), 1400.0, 3000.0);
    harness.key_press(Key::F6);
    harness.run_steps(3);
    let mut costs = costs();
    costs.iter_mut().for_each(|cost| cost.on_ms = cost.off_ms + 11.9);
    record_costs(&mut harness, costs.clone());
    assert!(harness.get_all_by_label("within noise (± 12.0 ms), ΔE 12.3").count() > 0);
    costs.iter_mut().for_each(|cost| cost.on_ms = cost.off_ms + 12.1);
    record_costs(&mut harness, costs);
    assert!(harness.query_by_label_contains("within noise").is_none());
}

#[test]
fn each_switch_stands_in_one_group_with_its_reason_as_a_visible_text() {
    let mut harness = of_size(quick(), 1400.0, 3000.0);
    harness.key_press(Key::F6);
    harness.run_steps(3);
    let plan = editor(&mut harness).object.effects().to_vec();
    let shown = |harness: &Harness<'static, Option<Editor>>| -> Vec<&'static str> {
        effect_names().filter(|name| harness.query_all_by_label(&caption(name)).count() == 1).collect()
    };
    let physics = shown(&harness);
    harness.get_by_label_contains("Shortcuts: ").click_accesskit();
    harness.run_steps(8);
    assert!(!physics.is_empty() && physics.len() < effect_names().count());
    assert_eq!(shown(&harness), effect_names().collect::<Vec<_>>());
    for name in effect_names() {
        assert!(switch_mut(&mut Default::default(), name).is_some());
        let Some(effect) = plan.iter().find(|effect| effect.name == name) else { continue };
        let reason = effect.reason.replace("f̄", "the effective BRDF");
        assert!(harness.query_all_by_label(&reason).count() > 0, "{name}: {reason}");
    }
}
