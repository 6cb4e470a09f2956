//! The Python package of biscale. It calls what the commands of the program call, and holds no logic of its own.

mod arrays;
mod effective;
mod errors;
mod run;
mod scene;
mod tables;
mod values;

use pyo3::prelude::*;

/// The compiled part of the package.
#[pymodule]
mod _core {
    use std::ffi::OsString;

    use biscale::math::directions::{HemispherePairGrid, angles_of_direction, direction_of_angles};
    use biscale::{InputError, cli};
    use glam::DVec3;
    use pyo3::prelude::*;
    use pyo3::types::{PyDict, PyTuple};

    #[pymodule_export]
    use crate::effective::EffectiveBrdf;
    #[pymodule_export]
    use crate::scene::Scene;
    use crate::scene::{shipped_scenes, unpickle};
    use crate::tables::renderer_tables;
    use crate::{arrays, errors};

    /// Most pairs that a call draws.
    const MAX_PAIRS: usize = 100_000_000;

    /// The version of the package.
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name that Python expects")]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    /// Unit vectors `(..., 3)` at the polar angle `theta` from +z and the azimuth `phi` from +x towards +y [rad].
    #[pyfunction]
    fn from_angles<'py>(theta: &Bound<'py, PyAny>, phi: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (angles, broadcast) = arrays::numbers(["theta", "phi"], theta, phi)?;
        let vectors = angles.iter().flat_map(|&(theta, phi)| direction_of_angles(theta, phi).to_array());
        broadcast.doubles(theta.py(), vectors.collect(), Some(3))
    }

    /// The angles `(theta, phi)` [rad] of unit vectors `(..., 3)`, with `phi` from 0 to 2π.
    #[pyfunction]
    fn to_angles<'py>(w: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyTuple>> {
        let py = w.py();
        let (directions, broadcast) = arrays::directions::<DVec3>("w", w)?;
        let (theta, phi) = directions.into_iter().map(angles_of_direction).unzip();
        PyTuple::new(py, [broadcast.doubles(py, theta, None)?, broadcast.doubles(py, phi, None)?])
    }

    /// Directions `wi` and `wo` of pairs up to 85° from the normal, half of them near the mirror direction: those over which tables and
    /// fits are measured.
    #[pyfunction]
    fn mirror_biased_pairs(py: Python<'_>, count: usize, seed: u64) -> PyResult<Bound<'_, PyTuple>> {
        if count > MAX_PAIRS {
            let expected = format!("a number of pairs up to {MAX_PAIRS}");
            return Err(errors::input_error(py, &InputError::new("count", count, expected)));
        }
        let pairs = biscale::metrics::mirror_biased_pairs(count, seed);
        let broadcast = arrays::Broadcast { shape: vec![pairs.len()], single: true };
        let (wi, wo): (Vec<_>, Vec<_>) = pairs.into_iter().map(|pair| (pair.i, pair.o)).unzip();
        PyTuple::new(py, [broadcast.vectors(py, &wi)?, broadcast.vectors(py, &wo)?])
    }

    /// The shipped scenes: a description by name.
    #[pyfunction]
    fn scenes(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        shipped_scenes(py)
    }

    /// Runs the command line with `arguments`, whose first one is the name of the program, and returns its exit code.
    #[pyfunction]
    fn _main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
        py.detach(|| cli::main(arguments, |scene, _| cli::no_editor(scene)))
    }

    /// The tables that the plugin for Mitsuba reads, on a grid of half and difference angles: numbers of θ_h, φ_h, φ_d and θ_d.
    #[pyfunction]
    fn _renderer_tables<'py>(
        py: Python<'py>,
        brdf: &EffectiveBrdf,
        grid: (usize, usize, usize, usize),
    ) -> PyResult<Bound<'py, PyDict>> {
        let (rings, azimuths, phi_d, theta_d) = grid;
        renderer_tables(py, brdf, HemispherePairGrid { rings, azimuths, phi_d, theta_d })
    }

    #[pyfunction]
    fn _unpickle(py: Python<'_>, text: String, name: String, files: Vec<(String, Vec<u8>)>) -> PyResult<Scene> {
        unpickle(py, text, name, files)
    }
}
