//! Controls for the value shapes of the scene catalogue.

use std::cell::Cell;

use crate::scene::{Field, FieldShape, Kind};
use eframe::egui::{self, DragValue, Slider, SliderClamping, Ui};
use toml::Value;

use super::fields::{PanelContext, caption, display_name, format_number, suffix};
use super::{alternatives, matrix};
use crate::app::views::thumbnails::{Choice, Thumbnails};
use crate::app::worker::Subject;

/// Makes a drag value reject text that is not a finite number, and set `wrong` if the user types such text.
fn finite<'a>(drag: DragValue<'a>, wrong: &'a Cell<bool>) -> DragValue<'a> {
    drag.custom_parser(move |text| {
        let plain: String = text.chars().filter(|letter| !letter.is_whitespace()).collect();
        let plain = plain.replace('\u{2212}', "-");
        // A fraction such as 1/3 is a number, too.
        let (above, below) = plain.split_once('/').unwrap_or((&plain, "1"));
        let value = above.parse::<f64>().ok()? / below.parse::<f64>().ok()?;
        wrong.set(wrong.get() || !value.is_finite());
        value.is_finite().then_some(value)
    })
}

/// Width of the number beside a slider [points].
const NUMBER_WIDTH: f32 = 76.0;

/// Draws the control of a value with the given shape.
pub(super) fn value_ui(ui: &mut Ui, value: &mut Value, shape: &FieldShape, field: &Field, context: &mut PanelContext) {
    let wrong = Cell::new(false);
    match *shape {
        FieldShape::Number { min, max, soft_max } => {
            if number_ui(ui, value, (min, max, soft_max), &suffix(field.unit, context), field.default, &wrong) {
                context.changing = Some(field.key);
            }
        }
        FieldShape::Integer { min, max } => integer_ui(ui, value, (min, max), field.default, &wrong),
        FieldShape::Color { max } => color_ui(ui, value, max, &wrong),
        FieldShape::Vector { min, max, .. } => vector_ui(ui, value, (min, max), &wrong),
        FieldShape::Bool => {
            let mut on = value.as_bool().unwrap_or_default();
            if ui.checkbox(&mut on, "").changed() {
                *value = Value::Boolean(on);
            }
        }
        FieldShape::Text => text_ui(ui, value, 40.0, str::to_owned),
        FieldShape::Path => {
            text_ui(ui, value, 66.0, file_name);
            if ui.button("…").on_hover_text("Choose a file").clicked() {
                context.browse = Some(field.key);
            }
        }
        FieldShape::Choice(names) => choice_ui(ui, value, names, field.key),
        FieldShape::AnyOf(shapes) => any_of_ui(ui, value, shapes, field, context, &wrong),
        FieldShape::List { of, min, max } if min == max => alternatives::list_ui(ui, value, of, &wrong),
        FieldShape::List { .. } if matrix::is_matrix(value) => matrix::ui(ui, value),
        FieldShape::List { .. } => {
            let entries = value.as_array().map_or(0, Vec::len);
            ui.weak(format!("{entries} values in the file"));
        }
        FieldShape::Stops { .. } | FieldShape::Table(_) | FieldShape::Tagged(_) => {}
    }
    if wrong.get() {
        let name = caption(field);
        context.error =
            Some(format!("{name} keeps its value, because the text is not a number. Type a number such as 0.25."));
    }
}

/// Returns true if a range spans decades, so that its slider is logarithmic.
fn is_logarithmic(min: f64, soft_max: f64) -> bool {
    min >= 0.0 && soft_max / min.max(1e-4) > 500.0
}

/// Draws the control of a number. Returns true while the user changes it.
pub(super) fn number_ui(
    ui: &mut Ui,
    value: &mut Value,
    (min, max, soft_max): (f64, f64, f64),
    suffix: &str,
    default: Option<f64>,
    wrong: &Cell<bool>,
) -> bool {
    let Some(before) = number(value) else { return false };
    // Displays 0.1 that was stored as f32 as 0.1, not as 0.10000000149.
    let mut now = tidy(before);
    let soft_min = if min < -10.0 * soft_max { -soft_max } else { min };
    let range = soft_min..=soft_max.max(now);
    let log = is_logarithmic(soft_min, soft_max) && soft_max > 2.0;
    ui.spacing_mut().slider_width = (ui.available_width() - NUMBER_WIDTH - 8.0).max(40.0);
    let slider = Slider::new(&mut now, range).show_value(false).clamping(SliderClamping::Never).logarithmic(log);
    let slider = ui.add(slider);
    if is_secondary(ui) {
        now = tidy(before);
    }
    let (speed, digits) = ((soft_max - soft_min).min(100.0) / 400.0, decimals(now));
    let drag = DragValue::new(&mut now).range(min..=max).speed(speed).max_decimals(digits).suffix(suffix);
    let drag = ui.add_sized([NUMBER_WIDTH, ui.spacing().interact_size.y], finite(drag, wrong));
    let is_focused = slider.has_focus() || drag.has_focus();
    let response = slider | drag;
    number_menu(&response, &mut now, default);
    if now.is_finite() && now != tidy(before) {
        *value = Value::Float(now.clamp(min, max));
    }
    response.dragged() || is_focused
}

/// Returns the decimals that show three significant digits.
fn decimals(value: f64) -> usize {
    match value.abs() {
        v if v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 || v == 0.0 => 2,
        v if v >= 0.1 => 3,
        _ => 4,
    }
}

/// Returns true if the secondary button is in use, with which a slider would follow the pointer.
fn is_secondary(ui: &Ui) -> bool {
    let button = egui::PointerButton::Secondary;
    ui.input(|input| input.pointer.button_down(button) || input.pointer.button_released(button))
}

/// The menu of a right click on a number: its default, a copy of it, and halves and doubles.
fn number_menu(response: &egui::Response, now: &mut f64, default: Option<f64>) {
    // A slider senses drags and no clicks.
    response.container_context_menu(|ui| {
        if let Some(default) = default
            && ui.button(format!("Reset to {}", format_number(default))).clicked()
        {
            *now = default;
        }
        if ui.button("Copy the number").clicked() {
            ui.copy_text(now.to_string());
        }
        ui.separator();
        for (name, factor) in [("Half", 0.5), ("Double", 2.0)] {
            if ui.button(name).clicked() {
                *now *= factor;
            }
        }
        ui.weak("Fractions can be typed: 1/3");
    });
}

fn integer_ui(ui: &mut Ui, value: &mut Value, (min, max): (i64, i64), default: Option<f64>, wrong: &Cell<bool>) {
    let Some(mut now) = value.as_integer() else { return };
    let before = now;
    let slider = (max - min <= 5000).then(|| {
        ui.spacing_mut().slider_width = (ui.available_width() - NUMBER_WIDTH - 8.0).max(40.0);
        let slider = Slider::new(&mut now, min..=max).show_value(false).logarithmic(min >= 0 && max > 200);
        ui.add(slider)
    });
    if is_secondary(ui) {
        now = before;
    }
    let drag = DragValue::new(&mut now).range(min..=max).speed(0.2);
    let drag = ui.add_sized([NUMBER_WIDTH, ui.spacing().interact_size.y], finite(drag, wrong));
    let response = slider.map_or_else(|| drag.clone(), |slider| slider | drag.clone());
    let mut number = now as f64;
    number_menu(&response, &mut number, default);
    if number != now as f64 {
        now = (number.round() as i64).clamp(min, max);
    }
    if now != before {
        *value = Value::Integer(now);
    }
}

/// Draws a button that opens the colour picker. The picker covers 0 to 1; a brighter colour keeps its brightness as a factor.
pub(super) fn color_button(ui: &mut Ui, value: &mut Value) {
    let Some(rgb) = rgb_of(value) else { return };
    let gain = rgb.iter().copied().fold(1.0, f32::max);
    let mut shown = rgb.map(|channel| channel / gain);
    if ui.color_edit_button_rgb(&mut shown).on_hover_text("Linear RGB").changed() {
        *value = color_value(shown.map(|channel| channel * gain));
    }
}

fn rgb_of(value: &Value) -> Option<[f32; 3]> {
    let mut rgb = [0.0f32; 3];
    for (channel, value) in rgb.iter_mut().zip(value.as_array()?) {
        *channel = number(value).unwrap_or(0.0) as f32;
    }
    Some(rgb)
}

fn color_value(rgb: [f32; 3]) -> Value {
    Value::Array(rgb.map(|channel| Value::Float(f64::from(channel))).to_vec())
}

/// Draws a colour, and its channels as numbers where the panel is wide enough.
fn color_ui(ui: &mut Ui, value: &mut Value, max: f64, wrong: &Cell<bool>) {
    /// Smallest widths of a number with two and with three decimals, and largest width [points].
    const WIDTHS: [f32; 3] = [36.0, 44.0, 48.0];
    color_button(ui, value);
    let Some(mut rgb) = rgb_of(value) else { return };
    let before = rgb;
    let width = ((ui.available_width() - 2.0 * ui.spacing().item_spacing.x) / 3.0).min(WIDTHS[2]);
    if width < WIDTHS[0] {
        return;
    }
    let decimals = if width < WIDTHS[1] { 2 } else { 3 };
    let least_width = std::mem::replace(&mut ui.spacing_mut().interact_size.x, width);
    for channel in &mut rgb {
        let (exact, step) = (*channel, 10.0_f32.powi(decimals as i32));
        let drag = DragValue::new(channel).range(0.0..=max as f32).speed(0.005).max_decimals(decimals);
        ui.add_sized([width, ui.spacing().interact_size.y], finite(drag, wrong));
        // A number that loses the focus has the decimals that it shows, which is no edit.
        if (*channel - (exact * step).round() / step).abs() < 1e-6 {
            *channel = exact;
        }
    }
    ui.spacing_mut().interact_size.x = least_width;
    if rgb != before && rgb.iter().all(|channel| channel.is_finite()) {
        *value = color_value(rgb);
    }
}

pub(super) fn vector_ui(ui: &mut Ui, value: &mut Value, (min, max): (f64, f64), wrong: &Cell<bool>) {
    let Value::Array(list) = value else { return };
    for entry in list {
        let Some(before) = number(entry) else { continue };
        let mut now = tidy(before);
        let drag = DragValue::new(&mut now).range(min..=max).speed(0.01).max_decimals(3);
        ui.add_sized([58.0, ui.spacing().interact_size.y], finite(drag, wrong));
        if now.is_finite() && now != tidy(before) {
            *entry = Value::Float(now);
        }
    }
}

/// Draws a text field. The value changes when the user ends typing, so that no half-typed path is opened.
/// `reserved` is the width left for the rest of the row [points].
fn text_ui(ui: &mut Ui, value: &mut Value, reserved: f32, shown: impl Fn(&str) -> String) {
    let Some(text) = value.as_str() else { return };
    let id = ui.next_auto_id().with("draft");
    let edited = ui.memory(|memory| memory.has_focus(id));
    let draft = ui.data_mut(|data| data.get_temp::<String>(id)).filter(|_| edited);
    let mut draft = draft.unwrap_or_else(|| if edited { text.to_owned() } else { shown(text) });
    let width = (ui.available_width() - reserved - 10.0).max(60.0);
    let response = ui.add(egui::TextEdit::singleline(&mut draft).id(id).desired_width(width));
    if response.has_focus() && edited {
        ui.data_mut(|data| data.insert_temp(id, draft));
        return;
    }
    if edited && response.lost_focus() && draft != text {
        *value = Value::String(draft);
    }
    ui.data_mut(|data| data.remove::<String>(id));
    response.on_hover_text(value.as_str().unwrap_or_default());
}

/// Returns the file name of a path, because the whole path is too long for a row.
fn file_name(path: &str) -> String {
    let name = std::path::Path::new(path).file_name();
    name.map_or_else(|| path.to_owned(), |name| name.to_string_lossy().into_owned())
}

fn choice_ui(ui: &mut Ui, value: &mut Value, names: &[&str], key: &str) {
    let now = value.as_str().unwrap_or_default().to_owned();
    let combo = egui::ComboBox::from_id_salt((key, "choice")).selected_text(display_name(&now));
    combo.width(ui.available_width().min(180.0)).show_ui(ui, |ui| {
        for name in names {
            if ui.selectable_label(*name == now, display_name(name)).clicked() {
                *value = Value::String((*name).to_owned());
            }
        }
    });
}

/// Draws the named choice or matrix of a weave pattern, the forms of a number, and the first shape of any other field.
fn any_of_ui(
    ui: &mut Ui,
    value: &mut Value,
    shapes: &[FieldShape],
    field: &Field,
    context: &mut PanelContext,
    wrong: &Cell<bool>,
) {
    match *shapes {
        [FieldShape::Number { min, max, soft_max }, FieldShape::Vector { length, .. }] => {
            alternatives::number_or_vector_ui(ui, value, (min, max, soft_max), length, field, context, wrong);
        }
        [ref number @ FieldShape::Number { .. }, FieldShape::Choice([automatic])] => {
            alternatives::number_or_auto_ui(ui, value, number, automatic, field, context, wrong);
        }
        [FieldShape::Choice(names), ..] => {
            matrix::pattern_ui(ui, value, names, field.key);
        }
        _ => {
            if let Some(first) = shapes.first() {
                value_ui(ui, value, first, field, context);
            }
        }
    }
}

/// Returns the value that an optional field gets when the user sets it.
pub(super) fn starting_value(shape: &FieldShape) -> Option<Value> {
    Some(match *shape {
        FieldShape::Number { min, soft_max, .. } => {
            Value::Float(if min > 0.0 { (min * soft_max).sqrt() } else { 0.5 * soft_max })
        }
        FieldShape::Integer { min, max } => Value::Integer((min + (max - min) / 8).min(4096).max(min)),
        FieldShape::Choice(names) => Value::String((*names.first()?).to_owned()),
        FieldShape::Path => Value::String(String::new()),
        _ => return None,
    })
}

/// Draws the choice of a tagged table's kind, with tooltips from the catalogue. Returns a newly chosen kind.
pub fn kind_ui(ui: &mut Ui, label: &str, now: &str, kinds: &[Kind]) -> Option<&'static str> {
    let mut chosen = None;
    let combo = egui::ComboBox::from_id_salt(("kind", label)).selected_text(display_name(now)).height(400.0);
    combo.width((ui.available_width() - 30.0).min(200.0)).show_ui(ui, |ui| {
        for kind in kinds {
            if ui.selectable_label(kind.kind == now, display_name(kind.kind)).on_hover_text(kind.doc).clicked()
                && kind.kind != now
            {
                chosen = Some(kind.kind);
            }
        }
    });
    chosen
}

/// Draws the choice of a tagged table's kind as [`kind_ui`] does, with an image of each.
pub fn pictured_kind_ui(
    ui: &mut Ui,
    label: &str,
    now: &str,
    kinds: &[Kind],
    (thumbnails, subject): (&Thumbnails, fn(&'static str) -> Subject),
) -> Option<&'static str> {
    let choices = kinds.iter().map(|kind| Choice {
        name: kind.kind,
        caption: display_name(kind.kind),
        doc: kind.doc.to_owned(),
        subject: subject(kind.kind),
    });
    let width = (ui.available_width() - 30.0).min(200.0);
    let combo = egui::ComboBox::from_id_salt(("kind", label)).selected_text(display_name(now)).width(width);
    thumbnails.picker(ui, combo, now, choices)
}

/// Draws the choice of an object in a combo box of this width, with an image of each. Returns a newly chosen kind.
pub fn object_kind_ui(
    ui: &mut Ui,
    now: &str,
    kinds: impl Iterator<Item = &'static str>,
    width: f32,
    thumbnails: &Thumbnails,
) -> Option<&'static str> {
    let choices = kinds.map(|kind| Choice {
        name: kind,
        caption: display_name(kind),
        doc: String::new(),
        subject: Subject::Object(kind),
    });
    let combo = egui::ComboBox::from_id_salt("object").selected_text(display_name(now)).width(width);
    thumbnails.picker(ui, combo, now, choices)
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|number| number as f64))
}

/// Rounds to the shortest decimal that gives the same f32.
fn tidy(value: f64) -> f64 {
    (value as f32).to_string().parse().unwrap_or(value)
}
