//! Arrays of directions and of results.

use biscale::InputError;
use biscale::metrics::Pair;
use glam::{DVec3, Vec3};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::errors::{self, OrRaise};

/// Largest difference of the length of a direction from 1.
const MAX_LENGTH_ERROR: f64 = 1e-3;

/// Arrays that were broadcast against each other: their common shape, and whether all are in single precision.
pub struct Broadcast {
    pub shape: Vec<usize>,
    pub single: bool,
}

/// An argument: its name and its array, whose last axis is one item.
struct Argument<'a, 'py> {
    name: &'a str,
    array: Bound<'py, PyAny>,
    shape: Vec<usize>,
    single: bool,
}

fn refuse(py: Python<'_>, name: &str, found: impl std::fmt::Display, expected: &str) -> PyErr {
    errors::input_error(py, &InputError::new(name, found, expected))
}

impl<'a, 'py> Argument<'a, 'py> {
    /// `width` is the length of the last axis; 0 for numbers.
    fn new(name: &'a str, value: &Bound<'py, PyAny>, width: usize) -> PyResult<Self> {
        let py = value.py();
        let numpy = py.import("numpy")?;
        // Arrays that come from another process may be misaligned.
        let convert = |dtype: &str| numpy.call_method1("require", (value, dtype, ["C_CONTIGUOUS", "ALIGNED"]));
        let single = value.getattr("dtype").and_then(|dtype| dtype.str()).is_ok_and(|name| name == "float32");
        let array = convert(if single { "float32" } else { "float64" })
            .map_err(|error| refuse(py, name, error.value(py), "an array of numbers"))?;
        let mut shape: Vec<usize> = array.getattr("shape")?.extract()?;
        if width > 0 && shape.pop() != Some(width) {
            let found = format!("an array of shape {}", array.getattr("shape")?);
            return Err(refuse(py, name, found, &format!("an array whose last axis has {width} numbers")));
        }
        Ok(Self { name, array, shape, single })
    }

    /// Converts the items of the broadcast array.
    fn read<T>(&self, shape: &[usize], width: usize, make: impl Fn(&[f64]) -> T) -> PyResult<Vec<T>> {
        let py = self.array.py();
        let numpy = py.import("numpy")?;
        let mut full = shape.to_vec();
        let mut array = self.array.clone();
        if width > 0 {
            full.push(width);
        }
        if self.shape != shape {
            let wide = numpy.call_method1("broadcast_to", (array, PyTuple::new(py, full)?))?;
            array = numpy.call_method1("ascontiguousarray", (wide,))?;
        }
        let width = width.max(1);
        if self.single {
            let array: PyReadonlyArrayDyn<'_, f32> = array.cast::<PyArrayDyn<f32>>()?.readonly();
            let mut item = vec![0.0; width];
            let items = array.as_slice()?.chunks_exact(width).map(|values| {
                item.iter_mut().zip(values).for_each(|(to, from)| *to = f64::from(*from));
                make(&item)
            });
            return Ok(items.collect());
        }
        let array: PyReadonlyArrayDyn<'_, f64> = array.cast::<PyArrayDyn<f64>>()?.readonly();
        Ok(array.as_slice()?.chunks_exact(width).map(make).collect())
    }
}

/// The common shape of arguments.
fn broadcast(arguments: &[&Argument<'_, '_>]) -> PyResult<Broadcast> {
    let [first, rest @ ..] = arguments else { return Ok(Broadcast { shape: Vec::new(), single: false }) };
    let mut shape = first.shape.clone();
    for argument in rest {
        let (mut wide, other) = (shape.clone(), &argument.shape);
        while wide.len() < other.len() {
            wide.insert(0, 1);
        }
        let offset = wide.len() - other.len();
        for (k, &length) in other.iter().enumerate() {
            let place = &mut wide[offset + k];
            if *place != length && *place != 1 && length != 1 {
                let found = format!("the shapes {shape:?} and {other:?} of items");
                let names = format!("{}, {}", first.name, argument.name);
                return Err(refuse(first.array.py(), &names, found, "shapes that broadcast"));
            }
            *place = if *place == 1 { length } else { *place };
        }
        shape = wide;
    }
    Ok(Broadcast { shape, single: arguments.iter().all(|argument| argument.single) })
}

/// A direction in the precision that a computation takes.
pub trait Direction: Copy + Send {
    fn new(components: &[f64]) -> Self;
    fn length_squared(self) -> f64;
}

impl Direction for Vec3 {
    fn new(components: &[f64]) -> Self {
        DVec3::from_slice(components).as_vec3()
    }

    fn length_squared(self) -> f64 {
        self.as_dvec3().length_squared()
    }
}

impl Direction for DVec3 {
    fn new(components: &[f64]) -> Self {
        Self::from_slice(components)
    }

    fn length_squared(self) -> f64 {
        Self::length_squared(self)
    }
}

/// Directions `name` of one argument.
pub fn directions<D: Direction>(name: &str, value: &Bound<'_, PyAny>) -> PyResult<(Vec<D>, Broadcast)> {
    let argument = Argument::new(name, value, 3)?;
    let broadcast = broadcast(&[&argument])?;
    let directions = argument.read(&broadcast.shape, 3, D::new)?;
    check_unit(name, &directions, &broadcast.shape).or_raise(value.py())?;
    Ok((directions, broadcast))
}

/// Directions towards light and viewer, broadcast against each other.
pub fn pairs<D: Direction>(wi: &Bound<'_, PyAny>, wo: &Bound<'_, PyAny>) -> PyResult<(Vec<(D, D)>, Broadcast)> {
    let arguments = [Argument::new("wi", wi, 3)?, Argument::new("wo", wo, 3)?];
    let broadcast = broadcast(&[&arguments[0], &arguments[1]])?;
    let [i, o] = arguments.each_ref().map(|argument| argument.read(&broadcast.shape, 3, D::new));
    let (i, o) = (i?, o?);
    check_unit("wi", &i, &broadcast.shape).or_raise(wi.py())?;
    check_unit("wo", &o, &broadcast.shape).or_raise(wi.py())?;
    Ok((i.into_iter().zip(o).collect(), broadcast))
}

/// As [`pairs`], for effective BRDFs, which compute in single precision.
pub fn pairs_of_vec3(wi: &Bound<'_, PyAny>, wo: &Bound<'_, PyAny>) -> PyResult<(Vec<Pair>, Broadcast)> {
    let (pairs, broadcast) = pairs::<Vec3>(wi, wo)?;
    Ok((pairs.into_iter().map(|(i, o)| Pair { i, o }).collect(), broadcast))
}

/// Directions and uniform numbers, two per direction, broadcast against each other.
pub fn directions_and_uniform(
    wi: &Bound<'_, PyAny>,
    u: &Bound<'_, PyAny>,
) -> PyResult<(Vec<Vec3>, Vec<[f64; 2]>, Broadcast)> {
    let arguments = (Argument::new("wi", wi, 3)?, Argument::new("u", u, 2)?);
    let broadcast = broadcast(&[&arguments.0, &arguments.1])?;
    let directions = arguments.0.read(&broadcast.shape, 3, <Vec3 as Direction>::new)?;
    let uniform = arguments.1.read(&broadcast.shape, 2, |pair| [pair[0], pair[1]])?;
    check_unit("wi", &directions, &broadcast.shape).or_raise(wi.py())?;
    let outside = |pair: &[f64; 2]| pair.iter().any(|number| !(0.0..=1.0).contains(number));
    if let Some(at) = uniform.iter().position(outside) {
        let place = format!("u{}", shown_index(at, &broadcast.shape));
        return Err(refuse(wi.py(), &place, format!("{:?}", uniform[at]), "two numbers from 0 to 1"));
    }
    Ok((directions, uniform, broadcast))
}

/// Two arrays of numbers, broadcast against each other.
pub fn numbers(names: [&str; 2], a: &Bound<'_, PyAny>, b: &Bound<'_, PyAny>) -> PyResult<(Vec<(f64, f64)>, Broadcast)> {
    let py = a.py();
    let arguments = [Argument::new(names[0], a, 0)?, Argument::new(names[1], b, 0)?];
    let broadcast = broadcast(&[&arguments[0], &arguments[1]])?;
    let [a, b] = arguments.each_ref().map(|argument| argument.read(&broadcast.shape, 0, |number| number[0]));
    let numbers: Vec<(f64, f64)> = a?.into_iter().zip(b?).collect();
    if let Some(at) = numbers.iter().position(|(a, b)| !(a.is_finite() && b.is_finite())) {
        let place = format!("{}, {}{}", names[0], names[1], shown_index(at, &broadcast.shape));
        return Err(refuse(py, &place, format!("{:?}", numbers[at]), "finite numbers"));
    }
    Ok((numbers, broadcast))
}

/// Checks that directions have the length 1. The error names the index of the first that has not.
fn check_unit<D: Direction>(name: &str, directions: &[D], shape: &[usize]) -> Result<(), biscale::Error> {
    let range = (1.0 - MAX_LENGTH_ERROR).powi(2)..=(1.0 + MAX_LENGTH_ERROR).powi(2);
    let Some(at) = directions.iter().position(|direction| !range.contains(&direction.length_squared())) else {
        return Ok(());
    };
    let place = format!("{name}{}", shown_index(at, shape));
    let found = format!("a vector of length {}", directions[at].length_squared().sqrt());
    Err(InputError::new(place, found, "a unit vector (to 1e-3)").into())
}

/// The index of an item of an array in brackets; nothing for a single item.
fn shown_index(mut at: usize, shape: &[usize]) -> String {
    if shape.is_empty() {
        return String::new();
    }
    let mut index = vec![0; shape.len()];
    for (place, &length) in index.iter_mut().zip(shape).rev() {
        *place = at % length.max(1);
        at /= length.max(1);
    }
    format!("{index:?}")
}

impl Broadcast {
    /// An array of vectors, in the precision of the arguments.
    pub fn vectors<'py>(&self, py: Python<'py>, values: &[Vec3]) -> PyResult<Bound<'py, PyAny>> {
        let components = values.iter().flat_map(|value| value.to_array());
        self.array(py, values.len() * 3, components, Some(3))
    }

    /// An array of numbers, in the precision of the arguments.
    pub fn numbers<'py>(&self, py: Python<'py>, values: &[f32]) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, values.len(), values.iter().copied(), None)
    }

    fn array<'py>(
        &self,
        py: Python<'py>,
        count: usize,
        values: impl Iterator<Item = f32>,
        width: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let shape: Vec<usize> = self.shape.iter().copied().chain(width).collect();
        if self.single {
            let mut all = Vec::with_capacity(count);
            all.extend(values);
            return Ok(PyArray1::from_vec(py, all).reshape(shape)?.into_any());
        }
        let mut all = Vec::with_capacity(count);
        all.extend(values.map(f64::from));
        Ok(PyArray1::from_vec(py, all).reshape(shape)?.into_any())
    }

    /// An array of numbers in double precision.
    pub fn doubles<'py>(&self, py: Python<'py>, values: Vec<f64>, width: Option<usize>) -> PyResult<Bound<'py, PyAny>> {
        let shape: Vec<usize> = self.shape.iter().copied().chain(width).collect();
        if self.single {
            let values: Vec<f32> = values.into_iter().map(|value| value as f32).collect();
            return Ok(PyArray1::from_vec(py, values).reshape(shape)?.into_any());
        }
        Ok(PyArray1::from_vec(py, values).reshape(shape)?.into_any())
    }
}
