//! The tables that the plugin for Mitsuba reads.

use std::sync::Arc;

use biscale::effective::{Nodes, Representation, ShadingTable};
use biscale::export::DirectionSampler;
use biscale::geometry::mirror_planes;
use biscale::math::directions::HemispherePairGrid;
use glam::{DVec3, Vec3};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::effective::EffectiveBrdf;
use crate::run::{Access, run};

/// The tables of an effective BRDF: `values` of G over half and difference angles, `areas`, and those of the sampler.
pub fn renderer_tables<'py>(
    py: Python<'py>,
    brdf: &EffectiveBrdf,
    grid: HemispherePairGrid,
) -> PyResult<Bound<'py, PyDict>> {
    let outcome = brdf.opaque(py, "mitsuba")?;
    let (table, sampler) = run(py, Access::Exclusive, None, |job| {
        let mut pipeline = brdf.pipeline.clone();
        pipeline.set_cancel(job.cancel.clone());
        // What `biscale render` reads: close to the BRDF, and faster.
        let shading = outcome.shading_brdf(&job.cancel)?.brdf;
        // The error of a sum over fewer facets is not symmetric, even if the tile is.
        let is_table = matches!(shading.direct_representation(), Representation::Table(_));
        let is_symmetric = is_table || Arc::ptr_eq(&shading, &outcome.brdf);
        let mirrors = if is_symmetric { mirror_planes(&pipeline.mesh(&brdf.loaded)?) } else { [false; 2] };
        let g = |lights: &[Vec3], o: Vec3, out: &mut [DVec3]| {
            out.iter_mut().zip(lights).for_each(|(out, i)| *out = shading.g(*i, o).as_dvec3());
            f64::from(shading.relative_projected_area(o))
        };
        let table = ShadingTable::resample(g, Nodes { mirrors, ..Nodes::all(grid) }, &job.cancel)?;
        let isotropic = !outcome.plan.is_on("anisotropy");
        Ok((table, DirectionSampler::new(&shading, isotropic, &job.progress())?))
    })?;
    let sampler = sampler.tables();
    let tables = PyDict::new(py);
    let values = table.values().iter().flat_map(|value| value.to_array()).collect();
    let shape = [grid.rings, grid.azimuths, grid.phi_d, grid.theta_d + 2, 4];
    tables.set_item("values", PyArray1::from_vec(py, values).reshape(shape)?)?;
    let (polar, areas) = table.areas();
    let shape = [polar.ring_count(), polar.azimuths];
    tables.set_item("areas", PyArray1::from_vec(py, areas.to_vec()).reshape(shape)?)?;
    tables.set_item("crowding", HemispherePairGrid::CROWDING)?;
    tables.set_item("phi", sampler.phi)?;
    tables.set_item("theta", sampler.theta)?;
    for (name, ([height, width], densities)) in [("luminance", sampler.luminance), ("vndf", sampler.vndf)] {
        let densities = densities.iter().map(|&density| density as f32).collect();
        let shape = [sampler.phi.len(), sampler.theta.len(), height, width];
        tables.set_item(name, PyArray1::from_vec(py, densities).reshape(shape)?)?;
    }
    Ok(tables)
}
