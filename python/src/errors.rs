//! Errors of the library as exceptions of `biscale._errors`.

use std::any::Any;

use biscale::{Error, InputError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The exception of an error.
pub fn raised(py: Python<'_>, error: &anyhow::Error) -> PyErr {
    match error.downcast_ref::<Error>() {
        Some(Error::Input(input)) => input_error(py, input),
        Some(Error::Cancelled) => exception(py, "Cancelled", "cancelled".to_owned(), None),
        Some(Error::Gpu(gpu)) => exception(py, "DeviceError", gpu.to_string(), None),
        _ => exception(py, "InternalError", format!("{error:#}"), None),
    }
}

/// The exception of an error of the caller's input.
pub fn input_error(py: Python<'_>, error: &InputError) -> PyErr {
    let fields = || {
        let fields = PyDict::new(py);
        fields.set_item("file", error.file.as_ref().map(|file| file.to_string_lossy()))?;
        fields.set_item("field", &error.place)?;
        fields.set_item("found", &error.found)?;
        fields.set_item("expected", &error.expected)?;
        fields.set_item("hint", &error.hint)?;
        Ok(fields)
    };
    match fields() {
        Ok(fields) => exception(py, "InputError", error.to_string(), Some(&fields)),
        Err(error) => error,
    }
}

/// The exception of a panic.
pub fn panicked(py: Python<'_>, payload: &(dyn Any + Send)) -> PyErr {
    let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_default();
    exception(py, "InternalError", format!("biscale stopped at an error of its own: {text}"), None)
}

fn exception(py: Python<'_>, class: &str, message: String, fields: Option<&Bound<'_, PyDict>>) -> PyErr {
    let raise = || py.import("biscale._errors")?.getattr(class)?.call((message,), fields);
    match raise() {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// An error of the library, as the result of a call from Python.
pub trait OrRaise<T> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T, E: Into<anyhow::Error>> OrRaise<T> for Result<T, E> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|error| raised(py, &error.into()))
    }
}
