//! Controls for values of several shapes: one number or one for each axis or channel, a number or `auto`, short lists.

use std::cell::Cell;

use crate::scene::{Field, FieldShape};
use eframe::egui::Ui;
use toml::Value;

use super::controls::{color_button, number_ui, starting_value, vector_ui};
use super::fields::{PanelContext, suffix};

/// Draws a number, or one number for each axis or channel. A button between them changes the form.
pub(super) fn number_or_vector_ui(
    ui: &mut Ui,
    value: &mut Value,
    range: (f64, f64, f64),
    length: usize,
    field: &Field,
    context: &PanelContext,
    wrong: &Cell<bool>,
) {
    let id = ui.next_auto_id().with("split");
    let entries = entries(value, length);
    let is_equal = entries.iter().all(|entry| *entry == entries[0]);
    let mut split = !is_equal || ui.data(|data| data.get_temp(id)).unwrap_or(false);
    let (parts, tip) =
        if length == 3 { ("RGB", "One value for each colour channel") } else { ("x, y", "One value along each axis") };
    if ui.toggle_value(&mut split, parts).on_hover_text(tip).changed() && !split && !is_equal {
        let mean = entries.iter().sum::<f64>() / length as f64;
        *value = joined(value, mean, length);
    }
    ui.data_mut(|data| data.insert_temp(id, split));
    if split {
        let mut list = Value::Array(entries.iter().map(|entry| Value::Float(*entry)).collect());
        let before = list.clone();
        vector_ui(ui, &mut list, (range.0, range.1), wrong);
        if list != before {
            *value = list;
        }
    } else {
        let mut number = Value::Float(entries[0]);
        let before = number.clone();
        number_ui(ui, &mut number, range, &suffix(field.unit, context), field.default, wrong);
        if number != before {
            *value = joined(value, number.as_float().unwrap_or(entries[0]), length);
        }
    }
}

/// The entries of a list, or a number for each of them.
fn entries(value: &Value, length: usize) -> Vec<f64> {
    let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|number| number as f64));
    let one = number(value).unwrap_or_default();
    let of_list = |list: &Vec<Value>| list.iter().map(|entry| number(entry).unwrap_or_default()).collect::<Vec<_>>();
    value.as_array().map(of_list).filter(|list| list.len() == length).unwrap_or_else(|| vec![one; length])
}

/// A number in the form of the last value: as a list, or as one number.
fn joined(last: &Value, number: f64, length: usize) -> Value {
    if last.is_array() { Value::Array(vec![Value::Float(number); length]) } else { Value::Float(number) }
}

/// Draws a number that may be chosen automatically.
pub(super) fn number_or_auto_ui(
    ui: &mut Ui,
    value: &mut Value,
    shape: &FieldShape,
    automatic: &str,
    field: &Field,
    context: &PanelContext,
    wrong: &Cell<bool>,
) {
    let FieldShape::Number { min, max, soft_max } = *shape else { return };
    let mut is_auto = value.is_str();
    if ui.toggle_value(&mut is_auto, "Auto").on_hover_text("Chosen by the program").changed() {
        *value = if is_auto {
            Value::String(automatic.to_owned())
        } else {
            starting_value(shape).unwrap_or_else(|| value.clone())
        };
    }
    if !value.is_str() {
        number_ui(ui, value, (min, max, soft_max), &suffix(field.unit, context), field.default, wrong);
    }
}

/// Draws the entries of a list of fixed length: colours or whole numbers.
pub(super) fn list_ui(ui: &mut Ui, value: &mut Value, of: &FieldShape, wrong: &Cell<bool>) {
    let Value::Array(list) = value else { return };
    match *of {
        FieldShape::Color { .. } => list.iter_mut().for_each(|color| color_button(ui, color)),
        FieldShape::Integer { min, max } => {
            let mut numbers =
                Value::Array(list.iter().map(|entry| Value::Float(entry.as_integer().unwrap_or(min) as f64)).collect());
            let before = numbers.clone();
            vector_ui(ui, &mut numbers, (min as f64, max as f64), wrong);
            if numbers != before {
                let whole = |entry: f64| Value::Integer(entry.round() as i64);
                *list = entries(&numbers, list.len()).into_iter().map(whole).collect();
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_keeps_its_form_and_a_list_of_another_length_counts_as_none() {
        let list = |numbers: &[f64]| Value::Array(numbers.iter().map(|number| Value::Float(*number)).collect());
        assert_eq!(entries(&Value::Integer(2), 3), [2.0; 3]);
        assert_eq!(entries(&list(&[1.0, 2.0]), 2), [1.0, 2.0]);
        assert_eq!(entries(&list(&[1.0]), 2), [0.0; 2]);
        assert_eq!(joined(&list(&[1.0, 2.0]), 0.5, 2), list(&[0.5, 0.5]));
        assert_eq!(joined(&Value::Float(1.0), 0.5, 2), Value::Float(0.5));
    }
}
