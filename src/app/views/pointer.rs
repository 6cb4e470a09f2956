//! Mouse, touch and pen input on a view. Every position of a stroke is reported, even if one frame takes long.

use eframe::egui::{Event, PointerButton, Pos2, Rect, Ui};
use glam::Vec2;

/// Pointer input in paint mode, in fractions of the tile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pointer {
    /// Position and pressure (0 to 1).
    Press(Vec2, f32),
    Released,
}

/// Pointer input in screen points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ScreenPointer {
    At(Pos2, f32),
    Released,
}

/// Returns the input since the last frame, in order. `pressure` persists between frames and is `None` while released.
pub fn strokes(ui: &Ui, area: Rect, pressure: &mut Option<f32>) -> Vec<ScreenPointer> {
    // A dialog over the view takes the input.
    let is_on_view = |at: Pos2| area.contains(at) && ui.ctx().layer_id_at(at) == Some(ui.layer_id());
    let events = ui.input(|input| input.events.clone());
    convert(&events, is_on_view, pressure)
}

/// Converts events. A pen reports its pressure, and a mouse has pressure 1.
fn convert(events: &[Event], is_on_view: impl Fn(Pos2) -> bool, pressure: &mut Option<f32>) -> Vec<ScreenPointer> {
    let mut inputs = Vec::new();
    let mut force = *pressure;
    for event in events {
        match event {
            Event::Touch { force: Some(now), .. } => force = Some(*now),
            Event::PointerButton { pos, button: PointerButton::Primary, pressed: true, .. } if is_on_view(*pos) => {
                *pressure = Some(force.unwrap_or(1.0));
                inputs.push(ScreenPointer::At(*pos, force.unwrap_or(1.0)));
            }
            Event::PointerButton { button: PointerButton::Primary, pressed: false, .. } if pressure.is_some() => {
                (*pressure, force) = (None, None);
                inputs.push(ScreenPointer::Released);
            }
            Event::PointerMoved(at) if pressure.is_some() => {
                *pressure = force.or(*pressure);
                inputs.push(ScreenPointer::At(*at, pressure.unwrap_or(1.0)));
            }
            Event::PointerGone | Event::WindowFocused(false) if pressure.is_some() => {
                (*pressure, force) = (None, None);
                inputs.push(ScreenPointer::Released);
            }
            _ => {}
        }
    }
    inputs
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
        let mut pressure = None;
        let moved = |x: f32| Event::PointerMoved(pos2(x, 0.0));
        let events = [moved(0.0), button(1.0, true), moved(2.0), moved(3.0), button(3.0, false), moved(9.0)];
        let at = |x: f32| ScreenPointer::At(pos2(x, 0.0), 1.0);
        assert_eq!(convert(&events, |_| true, &mut pressure), [at(1.0), at(2.0), at(3.0), ScreenPointer::Released]);
        assert_eq!(pressure, None);
        assert_eq!(convert(&events, |_| false, &mut pressure), [], "another widget was pressed");
    }

    #[test]
    fn each_position_of_a_stroke_has_the_pressure_of_the_pen() {
        let mut pressure = None;
        let moved = |x: f32| Event::PointerMoved(pos2(x, 0.0));
        let first = [force(0.25), button(1.0, true), force(0.75), moved(2.0)];
        let found = convert(&first, |_| true, &mut pressure);
        assert_eq!(found, [ScreenPointer::At(pos2(1.0, 0.0), 0.25), ScreenPointer::At(pos2(2.0, 0.0), 0.75)]);
        // The next frame continues the stroke.
        assert_eq!(convert(&[moved(3.0)], |_| true, &mut pressure), [ScreenPointer::At(pos2(3.0, 0.0), 0.75)]);
        assert_eq!(convert(&[Event::PointerGone], |_| true, &mut pressure), [ScreenPointer::Released]);
    }
}
