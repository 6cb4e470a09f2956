//! Values between TOML, JSON and Python.

use biscale::InputError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString};
use serde::Serialize;
use toml::Value;

use crate::errors::{self, OrRaise};

/// Largest depth of lists and dictionaries in a value.
const MAX_DEPTH: usize = 32;

/// Converts a value of a scene's key. Arrays of numpy become lists.
pub fn to_toml(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Value> {
    nested(key, value, MAX_DEPTH)
}

fn nested(key: &str, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    let py = value.py();
    let refused = |found: String, expected: &str| errors::input_error(py, &InputError::new(key, found, expected));
    let Some(inner) = depth.checked_sub(1) else {
        return Err(refused("a value that contains itself".to_owned(), "lists and dictionaries that end"));
    };
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(value.is_truthy()?));
    }
    if value.is_instance_of::<PyInt>() {
        let number = value.extract().map_err(|_| refused(value.to_string(), "a whole number of 64 bits"))?;
        return Ok(Value::Integer(number));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(value.extract()?));
    }
    if value.is_instance_of::<PyString>() {
        return Ok(Value::String(value.extract()?));
    }
    if let Ok(table) = value.cast::<PyDict>() {
        let entries = table.iter().map(|(name, value)| {
            let name: String = name.str()?.extract()?;
            let value = nested(&name, &value, inner)?;
            Ok((name, value))
        });
        return Ok(Value::Table(entries.collect::<PyResult<_>>()?));
    }
    // Paths of `pathlib`.
    if value.hasattr("__fspath__")? {
        return Ok(Value::String(py.import("os")?.call_method1("fspath", (value,))?.extract()?));
    }
    // Numbers and arrays of numpy.
    if value.hasattr("tolist")? {
        return nested(key, &value.call_method0("tolist")?, inner);
    }
    if let Ok(entries) = value.try_iter() {
        return Ok(Value::Array(entries.map(|entry| nested(key, &entry?, inner)).collect::<PyResult<_>>()?));
    }
    let found = format!("a value of type `{}`", value.get_type().name()?);
    Err(refused(found, "a number, a text, a list or a dictionary"))
}

/// Converts a value of a scene to Python.
pub fn from_toml<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::String(text) => text.into_pyobject(py)?.into_any(),
        Value::Integer(number) => number.into_pyobject(py)?.into_any(),
        Value::Float(number) => number.into_pyobject(py)?.into_any(),
        Value::Boolean(flag) => flag.into_pyobject(py)?.to_owned().into_any(),
        Value::Datetime(moment) => moment.to_string().into_pyobject(py)?.into_any(),
        Value::Array(values) => {
            let values: Vec<_> = values.iter().map(|value| from_toml(py, value)).collect::<PyResult<_>>()?;
            PyList::new(py, values)?.into_any()
        }
        Value::Table(table) => {
            let dictionary = PyDict::new(py);
            for (key, value) in table {
                dictionary.set_item(key, from_toml(py, value)?)?;
            }
            dictionary.into_any()
        }
    })
}

/// Converts what `--json` prints to Python.
pub fn from_json<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).or_raise(py)?;
    py.import("json")?.call_method1("loads", (text,))
}
