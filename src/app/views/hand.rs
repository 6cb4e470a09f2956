//! What a hand with a mouse, a finger or a pen does on a view: every place it went through, also where a frame took long.

use eframe::egui::{Event, PointerButton, Pos2, Rect, Ui};
use glam::Vec2;

/// What the hand does in paint mode, in parts of the tile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hand {
    /// It presses here, this hard.
    Press(Vec2, f32),
    Lifted,
}

/// The same on the screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Touch {
    At(Pos2, f32),
    Lifted,
}

/// What happened since the last frame, in its order. `pressing` is kept between frames: how hard the hand is down.
pub fn strokes(ui: &Ui, area: Rect, pressing: &mut Option<f32>) -> Vec<Touch> {
    // A dialog over the view takes the hand.
    let is_ours = |at: Pos2| area.contains(at) && ui.ctx().layer_id_at(at) == Some(ui.layer_id());
    let events = ui.input(|input| input.events.clone());
    follow(&events, is_ours, pressing)
}

/// A pen presses as hard as it says, a mouse fully.
fn follow(events: &[Event], is_ours: impl Fn(Pos2) -> bool, pressing: &mut Option<f32>) -> Vec<Touch> {
    let mut touches = Vec::new();
    let mut force = *pressing;
    for event in events {
        match event {
            Event::Touch { force: Some(now), .. } => force = Some(*now),
            Event::PointerButton { pos, button: PointerButton::Primary, pressed: true, .. } if is_ours(*pos) => {
                *pressing = Some(force.unwrap_or(1.0));
                touches.push(Touch::At(*pos, force.unwrap_or(1.0)));
            }
            Event::PointerButton { button: PointerButton::Primary, pressed: false, .. } if pressing.is_some() => {
                (*pressing, force) = (None, None);
                touches.push(Touch::Lifted);
            }
            Event::PointerMoved(at) if pressing.is_some() => {
                *pressing = force.or(*pressing);
                touches.push(Touch::At(*at, pressing.unwrap_or(1.0)));
            }
            Event::PointerGone | Event::WindowFocused(false) if pressing.is_some() => {
                (*pressing, force) = (None, None);
                touches.push(Touch::Lifted);
            }
            _ => {}
        }
    }
    touches
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::egui::{Modifiers, TouchDeviceId, TouchId, TouchPhase, pos2};

    fn button(x: f32, pressed: bool) -> Event {
        let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
        Event::PointerButton { pos: pos2(x, 0.0), button, pressed, modifiers }
    }

    fn force(force: f32) -> Event {
        let (device_id, id, phase) = (TouchDeviceId(1), TouchId(1), TouchPhase::Move);
        Event::Touch { device_id, id, phase, pos: pos2(0.0, 0.0), force: Some(force) }
    }

    #[test]
    fn a_whole_stroke_within_one_slow_frame_is_not_lost() {
        let mut pressing = None;
        let moved = |x: f32| Event::PointerMoved(pos2(x, 0.0));
        let events = [moved(0.0), button(1.0, true), moved(2.0), moved(3.0), button(3.0, false), moved(9.0)];
        let at = |x: f32| Touch::At(pos2(x, 0.0), 1.0);
        assert_eq!(follow(&events, |_| true, &mut pressing), [at(1.0), at(2.0), at(3.0), Touch::Lifted]);
        assert_eq!(pressing, None);
        assert_eq!(follow(&events, |_| false, &mut pressing), [], "another widget was pressed");
    }

    #[test]
    fn a_pen_presses_as_hard_as_it_says_at_each_place() {
        let mut pressing = None;
        let moved = |x: f32| Event::PointerMoved(pos2(x, 0.0));
        let first = [force(0.25), button(1.0, true), force(0.75), moved(2.0)];
        let found = follow(&first, |_| true, &mut pressing);
        assert_eq!(found, [Touch::At(pos2(1.0, 0.0), 0.25), Touch::At(pos2(2.0, 0.0), 0.75)]);
        // The next frame goes on where this one stopped.
        assert_eq!(follow(&[moved(3.0)], |_| true, &mut pressing), [Touch::At(pos2(3.0, 0.0), 0.75)]);
        assert_eq!(follow(&[Event::PointerGone], |_| true, &mut pressing), [Touch::Lifted]);
    }
}
