//! The bar of a colour map: the histogram of its driver, the colours, and stops to drag.

use crate::app::theme::ACCENT;
use crate::app::worker::{DriverValues, HISTOGRAM_REACH};
use crate::color_map::layers::stop_map;
use crate::render::image::tone_map::srgb_byte;
use crate::scene::{GradientStop, StopUnit};
use eframe::egui::{
    self, Align2, Color32, EventFilter, FontId, Id, Key, Modifiers, Pos2, Rect, Response, Sense, Stroke, Ui,
    WidgetInfo, pos2, vec2,
};
use glam::Vec3;

use super::knots;
use super::stop_row;

/// Heights of the histogram, of the colours and of the handles [points].
const HISTOGRAM: f32 = 48.0;
const COLORS: f32 = 20.0;
const HANDLES: f32 = 15.0;
/// Width of a handle, and of a column of colour [points].
const HANDLE: f32 = 11.0;
const COLUMN: f32 = 2.0;
/// Parts of the shown range: the margin beyond the outermost stop, the least distance of two knots, and a step of a key.
const MARGIN: f64 = 0.05;
const GAP: f64 = 0.004;
const STEP: f64 = 0.01;
/// Deviations that are shown where no stop lies beyond.
const SHOWN: f64 = 2.5;
/// Colour of what is visible and lit at the picked point.
pub const SEEN: Color32 = Color32::from_rgb(230, 140, 30);

/// Content of the bar besides the stops.
pub struct BarInputs<'a> {
    pub unit: StopUnit,
    pub values: Option<&'a DriverValues>,
    /// The stops are weights: greys that are edited as numbers.
    pub are_weights: bool,
}

/// State of a bar between frames.
#[derive(Clone, Copy, Default)]
pub(super) struct BarState {
    /// The selected knot.
    pub selected: usize,
    /// The shown range while a stop is dragged.
    range: Option<(f64, f64)>,
    /// The knot that gets the focus in the next frame. In the frame of a click, it would lose the focus at once.
    focus: Option<usize>,
}

/// Positions of values on the bar.
struct Scale {
    area: Rect,
    low: f64,
    high: f64,
}

impl Scale {
    fn x(&self, value: f64) -> f32 {
        self.area.left() + ((value - self.low) / (self.high - self.low)) as f32 * self.area.width()
    }

    fn value(&self, x: f32) -> f64 {
        self.low + f64::from((x - self.area.left()) / self.area.width()) * (self.high - self.low)
    }

    /// The value at a position, with as many digits as a point on the screen resolves.
    fn round_value(&self, x: f32) -> f64 {
        round(self.value(x), (self.high - self.low) / f64::from(self.area.width()))
    }
}

/// Rounds to a power of ten below a step.
pub(super) fn round(value: f64, step: f64) -> f64 {
    if step.is_nan() || step <= 0.0 || !value.is_finite() {
        return value;
    }
    let digits = -step.log10().floor();
    let scale = 10.0_f64.powf(digits.abs());
    if digits >= 0.0 { (value * scale).round() / scale } else { (value / scale).round() * scale }
}

/// Draws the bar and, below it, the selected stop.
pub fn ui(ui: &mut Ui, stops: &mut Vec<GradientStop>, inputs: &BarInputs<'_>) {
    let id = ui.scope_id().with("stops");
    let mut state = ui.data(|data| data.get_temp::<BarState>(id)).unwrap_or_default();
    let size = vec2(ui.available_width(), HISTOGRAM + COLORS + HANDLES);
    let (area, bar) = ui.allocate_exact_size(size, Sense::click());
    bar.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, "Colour bar"));
    let inner = area.shrink2(vec2(0.5 * HANDLE + 1.0, 0.0));
    let (low, high) = state.range.unwrap_or_else(|| shown_range(stops, inputs));
    let scale = Scale { area: inner, low, high };
    let gap = GAP * (high - low);
    if let Some(knot) = state.focus.take() {
        ui.memory_mut(|memory| memory.request_focus(id.with(knot)));
    }
    if bar.double_clicked()
        && let Some(at) = bar.interact_pointer_pos()
        && let Some(added) = knots::add_stop(stops, scale.round_value(at.x), gap)
    {
        (state.selected, state.focus) = (added, Some(added));
        ui.ctx().request_repaint();
    }
    let is_dragged = handles(ui, id, stops, &scale, &mut state);
    state.range = is_dragged.then_some((low, high));
    state.selected = state.selected.min(knots::knots(stops).len().saturating_sub(1));
    paint(ui, stops, inputs, &scale, &state, id);
    readout(ui, &bar, &scale, inputs);
    stop_row::ui(ui, stops, &mut state.selected, inputs, gap);
    ui.data_mut(|data| data.insert_temp(id, state));
}

/// All stops and the bulk of the driver's values, with a margin.
fn shown_range(stops: &[GradientStop], inputs: &BarInputs<'_>) -> (f64, f64) {
    let ends = stops
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), stop| (low.min(stop.value), high.max(stop.value)));
    let bulk = [-SHOWN, SHOWN].map(|deviations| in_unit(deviations, inputs));
    let (low, high) = match (inputs.unit, inputs.values) {
        // Without its deviation, only the stops are known.
        (StopUnit::Value, None) => ends,
        _ => (ends.0.min(bulk[0]), ends.1.max(bulk[1])),
    };
    let span = if high > low { high - low } else { low.abs().max(1.0) };
    (low - MARGIN * span, high + MARGIN * span)
}

/// A number of deviations from the driver's mean in the unit of the stops.
fn in_unit(deviations: f64, inputs: &BarInputs<'_>) -> f64 {
    match (inputs.unit, inputs.values) {
        (StopUnit::Value, Some(values)) => values.unit.mean + deviations * values.unit.deviation,
        _ => deviations,
    }
}

/// Handles input on every knot. Returns true while one is dragged.
fn handles(ui: &mut Ui, id: Id, stops: &mut Vec<GradientStop>, scale: &Scale, state: &mut BarState) -> bool {
    let (mut is_dragged, mut removed) = (false, None);
    let count = knots::knots(stops).len();
    let span = scale.high - scale.low;
    let gap = GAP * span;
    for knot in 0..count {
        let Some(value) = knots::knots(stops).get(knot).map(|range| stops[range.start].value) else { continue };
        let response = ui.interact(handle_rect(scale, value), id.with(knot), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::slider(true, value, format!("Stop {} of {count}", knot + 1)));
        if response.clicked() || response.drag_started() {
            response.request_focus();
        }
        if response.has_focus() || response.is_pointer_button_down_on() {
            state.selected = knot;
        }
        if response.dragged()
            && let Some(at) = response.interact_pointer_pos()
        {
            is_dragged = true;
            knots::move_knot(stops, knot, scale.round_value(at.x), gap);
        }
        if response.has_focus() {
            let moved = arrow_steps(ui, response.id) * STEP * span;
            if moved != 0.0 {
                knots::move_knot(stops, knot, round(value + moved, 0.1 * STEP * span), gap);
            }
            let deletes = ui.input_mut(|input| {
                [Key::Delete, Key::Backspace].into_iter().any(|key| input.consume_key(Modifiers::NONE, key))
            });
            removed = removed.or(deletes.then_some(knot));
        }
        response.on_hover_cursor(egui::CursorIcon::ResizeHorizontal).on_hover_text(
            "Drag, or press the left and right arrows. Delete removes the stop. Tab selects the next one.",
        );
    }
    if let Some(knot) = removed
        && knots::remove_knot(stops, knot)
    {
        state.selected = knot.saturating_sub(1);
        state.focus = Some(state.selected);
        ui.ctx().request_repaint();
    }
    is_dragged
}

/// The steps of the arrow keys that were pressed on the focused handle; Shift makes ten of one.
fn arrow_steps(ui: &Ui, id: Id) -> f64 {
    let filter = EventFilter { horizontal_arrows: true, ..EventFilter::default() };
    ui.memory_mut(|memory| memory.set_focus_lock_filter(id, filter));
    ui.input_mut(|input| {
        let mut steps = 0.0;
        for (modifiers, factor) in [(Modifiers::SHIFT, 10.0), (Modifiers::NONE, 1.0)] {
            for (key, sign) in [(Key::ArrowLeft, -1.0), (Key::ArrowRight, 1.0)] {
                steps += sign * factor * input.count_and_consume_key(modifiers, key) as f64;
            }
        }
        steps
    })
}

fn handle_rect(scale: &Scale, value: f64) -> Rect {
    let top = scale.area.bottom() - HANDLES;
    Rect::from_center_size(pos2(scale.x(value), top + 0.5 * HANDLES), vec2(HANDLE, HANDLES + 4.0))
}

fn paint(ui: &Ui, stops: &[GradientStop], inputs: &BarInputs<'_>, scale: &Scale, state: &BarState, id: Id) {
    let area = scale.area;
    let painter = ui.painter().with_clip_rect(area.expand(HANDLE).intersect(ui.clip_rect()));
    let plot = Rect::from_min_max(area.min, pos2(area.right(), area.top() + HISTOGRAM));
    painter.rect_filled(plot, 3.0, ui.visuals().extreme_bg_color);
    if let Some(values) = inputs.values {
        let peak = values.whole.iter().chain(values.seen.iter().flatten()).fold(1e-6_f32, |peak, part| peak.max(*part));
        let bins = values.whole.len();
        let x = |bin: usize| {
            let deviations = HISTOGRAM_REACH * (2.0 * bin as f64 / bins as f64 - 1.0);
            scale.x(in_unit(deviations, inputs)).clamp(plot.left(), plot.right())
        };
        let y = |part: f32| plot.bottom() - 0.94 * plot.height() * part / peak;
        for (bin, part) in values.whole.iter().enumerate() {
            let column = Rect::from_min_max(pos2(x(bin), y(*part)), pos2(x(bin + 1), plot.bottom()));
            painter.rect_filled(column, 0.0, ui.visuals().weak_text_color().gamma_multiply(0.55));
        }
        if let Some(seen) = &values.seen {
            let points: Vec<Pos2> =
                (0..bins).flat_map(|bin| [pos2(x(bin), y(seen[bin])), pos2(x(bin + 1), y(seen[bin]))]).collect();
            painter.add(egui::Shape::line(points, Stroke::new(1.6, SEEN)));
        }
    }
    let colors = Rect::from_min_max(pos2(area.left(), plot.bottom()), pos2(area.right(), plot.bottom() + COLORS));
    let map = stop_map(stops);
    let mut x = colors.left();
    while x < colors.right() {
        let color = map.color(scale.value(x + 0.5 * COLUMN)).as_vec3();
        let right = (x + COLUMN).min(colors.right());
        let column = Rect::from_min_max(pos2(x, colors.top()), pos2(right, colors.bottom()));
        painter.rect_filled(column, 0.0, srgb(color));
        x += COLUMN;
    }
    for (knot, range) in knots::knots(stops).into_iter().enumerate() {
        let focused = ui.memory(|memory| memory.has_focus(id.with(knot)));
        let outline = match (knot == state.selected, focused) {
            (_, true) => Stroke::new(2.0, ACCENT),
            (true, _) => Stroke::new(1.5, ui.visuals().strong_text_color()),
            _ => Stroke::new(1.0, ui.visuals().weak_text_color()),
        };
        let both = [stops[range.start].color, stops[range.end - 1].color].map(srgb);
        handle(&painter, handle_rect(scale, stops[range.start].value), both, outline);
    }
}

/// Draws a handle with its tip on the bar: the colour below the value on the left, that above it on the right.
fn handle(painter: &egui::Painter, area: Rect, [below, above]: [Color32; 2], outline: Stroke) {
    let (top, shoulder) = (area.top() + 1.0, area.top() + 6.0);
    let (left, right, bottom, middle) = (area.left(), area.right(), area.bottom() - 2.0, area.center().x);
    let half = |side: f32, color: Color32| {
        let corners = vec![pos2(middle, top), pos2(side, shoulder), pos2(side, bottom), pos2(middle, bottom)];
        egui::Shape::convex_polygon(corners, color, Stroke::NONE)
    };
    painter.add(half(left, below));
    painter.add(half(right, above));
    let around =
        [pos2(middle, top), pos2(right, shoulder), pos2(right, bottom), pos2(left, bottom), pos2(left, shoulder)];
    painter.add(egui::Shape::closed_line(around.to_vec(), outline));
}

/// Shows the value under the pointer, and the help of the bar.
fn readout(ui: &Ui, bar: &Response, scale: &Scale, inputs: &BarInputs<'_>) {
    if let Some(at) = bar.hover_pos() {
        let value = scale.round_value(at.x.clamp(scale.area.left(), scale.area.right()));
        let text = format!("{value}{}", stop_row::suffix(inputs.unit));
        let color = ui.visuals().text_color();
        let corner = scale.area.left_top() + vec2(4.0, 2.0);
        ui.painter().text(corner, Align2::LEFT_TOP, text, FontId::proportional(10.5), color);
    }
    let seen = if inputs.values.is_some_and(|values| values.seen.is_some()) {
        " Orange: the values that are visible and lit at the picked point."
    } else {
        ""
    };
    bar.clone().on_hover_text(format!(
        "Colours by the driver's value. Grey: how often each value occurs on the tile.{seen} Double-click to add a stop."
    ));
}

/// The displayed form of a linear colour.
fn srgb(color: Vec3) -> Color32 {
    let [r, g, b] = color.clamp(Vec3::ZERO, Vec3::ONE).to_array().map(srgb_byte);
    Color32::from_rgb(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_rounded_to_what_a_point_on_the_screen_resolves() {
        assert_eq!(round(0.123_456, 0.02), 0.12);
        assert_eq!(round(-1.999_7, 0.003), -2.0);
        assert_eq!(round(123_456.0, 250.0), 123_500.0);
        assert_eq!(round(1.25e-7, 1e-9), 1.25e-7);
        assert_eq!(round(f64::INFINITY, 1.0), f64::INFINITY);
    }
}
