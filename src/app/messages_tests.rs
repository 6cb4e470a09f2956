use eframe::egui::ViewportId;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::*;

fn harness() -> Harness<'static, Messages> {
    Harness::builder().with_size([600.0, 400.0]).build_ui_state(
        |ui, messages: &mut Messages| {
            let over = ui.max_rect();
            messages.ui(ui.ctx(), over);
        },
        Messages::default(),
    )
}

fn repaint_delay(harness: &Harness<'_, Messages>) -> f64 {
    harness.output().viewport_output[&ViewportId::ROOT].repaint_delay.as_secs_f64()
}

#[test]
fn notes_disappear_after_their_reading_time_and_first_steps_stay() {
    let mut harness = harness();
    harness.state_mut().put(Level::Note, "a", "Wrote a file.");
    harness.state_mut().put(Level::Guide, "c", "First steps.");
    harness.run_steps(4);
    assert_eq!(harness.state().texts().len(), 2);
    // No frame is painted until the note disappears.
    let delay = repaint_delay(&harness);
    assert!((1.0..10.0).contains(&delay), "{delay}");
    // Each step takes a quarter of a second.
    harness.run_steps(40);
    assert_eq!(harness.state().texts(), ["First steps."]);
    let delay = repaint_delay(&harness);
    assert!(delay > 1e6, "without changes no frame is painted: {delay}");
}

#[test]
fn the_reading_time_of_a_note_behind_an_error_begins_once_the_error_is_gone() {
    let mut harness = harness();
    harness.state_mut().put(Level::Error, "b", "Not saved.");
    harness.state_mut().put(Level::Note, "a", "Wrote a file.");
    harness.run_steps(40);
    assert_eq!(harness.state().texts(), ["Not saved.", "Wrote a file."]);
    let delay = repaint_delay(&harness);
    assert!(delay > 1e6, "nothing disappears while the error stays: {delay}");
    harness.state_mut().clear("b");
    harness.run_steps(4);
    assert_eq!(harness.state().texts(), ["Wrote a file."]);
    harness.run_steps(40);
    assert!(harness.state().texts().is_empty());
}

#[test]
fn a_note_under_the_pointer_stays() {
    let mut harness = harness();
    harness.state_mut().put(Level::Note, "a", "Wrote a file.");
    harness.run_steps(3);
    harness.get_by_label("Wrote a file.").hover();
    harness.run_steps(60);
    assert_eq!(harness.state().texts(), ["Wrote a file."]);
    harness.event(egui::Event::PointerGone);
    harness.run_steps(20);
    assert!(harness.state().texts().is_empty());
}

#[test]
fn one_message_is_visible_errors_first_and_a_button_shows_the_others() {
    let mut harness = harness();
    for (source, text) in [("a", "one"), ("b", "two"), ("c", "three"), ("d", "four"), ("e", "one")] {
        let level = if source == "a" { Level::Error } else { Level::Note };
        harness.state_mut().put(level, source, text);
    }
    harness.run_steps(3);
    let visible = |harness: &Harness<'_, Messages>| {
        ["one", "two", "three", "four"].map(|text| harness.query_all_by_label(text).count())
    };
    assert_eq!(visible(&harness), [1, 0, 0, 0]);
    harness.get_by_label("3 more").click();
    harness.run_steps(3);
    assert_eq!(visible(&harness), [1, 1, 1, 1]);
    harness.get_by_label("Show fewer messages").click();
    harness.run_steps(3);
    assert_eq!(visible(&harness), [1, 0, 0, 0]);
}
