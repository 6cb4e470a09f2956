//! Input events that wait for the next frame, so that no click is lost while a frame takes long.

use std::collections::VecDeque;

use eframe::egui::{Event, Pos2};

/// Distance within which egui takes a press and a release for a click [points].
const CLICK_DISTANCE: f32 = 6.0;

/// Events that wait for later frames.
#[derive(Debug, Default)]
pub struct EventQueue {
    waiting: VecDeque<Event>,
    /// Number of events of the last call that no frame has taken. A window that is not shown offers them again.
    given: usize,
}

impl EventQueue {
    /// Takes the new events of a frame, and leaves in `events` those that belong into one frame: the pointer does not
    /// move away from where a button was pressed or released. egui takes the last position of the pointer in a frame
    /// for that of its clicks and drags, so a click before a movement in the same frame would hit what lies at its end.
    /// Returns true if events wait for the next frame.
    pub fn split(&mut self, events: &mut Vec<Event>) -> bool {
        let back: Vec<Event> = events.drain(..self.given.min(events.len())).collect();
        back.into_iter().rev().for_each(|event| self.waiting.push_front(event));
        self.waiting.extend(events.drain(..));
        let mut button_at: Option<Pos2> = None;
        while let Some(event) = self.waiting.pop_front() {
            let (at, is_button) = match &event {
                Event::PointerButton { pos, .. } => (Some(*pos), true),
                Event::PointerMoved(pos) => (Some(*pos), false),
                _ => (None, false),
            };
            if let (Some(at), Some(button_at)) = (at, button_at)
                && at.distance(button_at) > CLICK_DISTANCE
            {
                self.waiting.push_front(event);
                break;
            }
            button_at = at.filter(|_| is_button).or(button_at);
            events.push(event);
        }
        self.given = events.len();
        !self.waiting.is_empty()
    }

    /// Notes that a frame took the events.
    pub fn taken(&mut self) {
        self.given = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::egui::{self, Modifiers, PointerButton, pos2};
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;

    fn button(pos: Pos2, pressed: bool) -> Event {
        Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
    }

    /// Sends events in one frame, through a queue or not, and returns what was clicked, and the value of a slider.
    fn after(events: impl Fn(&dyn Fn(&str) -> Pos2) -> Vec<Event>, queued: bool) -> (Vec<&'static str>, f32) {
        let ui = |ui: &mut egui::Ui, state: &mut (Vec<&'static str>, f32)| {
            for name in ["first", "second"] {
                if ui.button(name).clicked() {
                    state.0.push(name);
                }
            }
            let slider = ui.add(egui::Slider::new(&mut state.1, 0.0..=1.0).show_value(false));
            slider.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, "slider"));
        };
        let mut harness = Harness::new_ui_state(ui, (Vec::new(), 0.5));
        harness.run_steps(2);
        let mut events = events(&|name| harness.get_by_label(name).rect().center());
        let mut queue = EventQueue::default();
        loop {
            let more = queued && queue.split(&mut events);
            harness.input_mut().events.append(&mut events);
            harness.step();
            queue.taken();
            if !more {
                return harness.state().clone();
            }
        }
    }

    #[test]
    fn a_click_before_a_movement_in_the_same_frame_is_not_lost() {
        let events = |of: &dyn Fn(&str) -> Pos2| {
            let (first, away) = (of("first"), pos2(300.0, 300.0));
            vec![Event::PointerMoved(first), button(first, true), button(first, false), Event::PointerMoved(away)]
        };
        assert_eq!(after(events, true).0, ["first"]);
        assert!(after(events, false).0.is_empty(), "egui itself keeps the click; the queue is not needed");
    }

    #[test]
    fn two_clicks_in_one_frame_both_count() {
        let events = |of: &dyn Fn(&str) -> Pos2| {
            let click = |name| [Event::PointerMoved(of(name)), button(of(name), true), button(of(name), false)];
            [click("first"), click("second")].concat()
        };
        assert_eq!(after(events, true).0, ["first", "second"]);
    }

    #[test]
    fn a_slider_that_is_released_keeps_its_value_when_the_pointer_moves_on_in_the_same_frame() {
        let events = |of: &dyn Fn(&str) -> Pos2| {
            let (at, away) = (of("slider"), pos2(0.0, 300.0));
            vec![Event::PointerMoved(at), button(at, true), button(at, false), Event::PointerMoved(away)]
        };
        let value = after(events, true).1;
        assert!((value - 0.5).abs() < 0.1, "{value}");
    }

    #[test]
    fn a_double_click_stays_in_one_frame_and_the_order_of_events_is_kept() {
        let at = pos2(5.0, 5.0);
        let key = Event::Text("a".to_owned());
        let sent = [button(at, true), button(at, false), key, button(at, true), button(at, false)];
        let mut events = sent.to_vec();
        assert!(!EventQueue::default().split(&mut events));
        assert_eq!(events, sent);
    }

    #[test]
    fn events_that_no_frame_took_keep_their_order() {
        let (here, there) = (pos2(5.0, 5.0), pos2(90.0, 5.0));
        let first = [button(here, true), button(here, false)];
        let second = [Event::PointerMoved(there), button(there, true), button(there, false)];
        let mut queue = EventQueue::default();
        let mut events = [&first[..], &second[..]].concat();
        for _ in 0..3 {
            assert!(queue.split(&mut events));
            assert_eq!(events, first, "a window that is not shown offers them again");
        }
        queue.taken();
        events.clear();
        assert!(!queue.split(&mut events));
        assert_eq!(events, second);
    }
}
