//! The class `EffectiveBrdf`.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use biscale::base::{check_output, require_finite};
use biscale::cli::export::Report;
use biscale::cli::fit::{fit_model, slab_report};
use biscale::export::slab::SlabFormat;
use biscale::export::{self, DirectionSampler, ExportMeta, ExportOptions, ExportResolution, RadianceBasis};
use biscale::fit::Model;
use biscale::fit::fit_slab;
use biscale::pipeline::{Outcome, Pipeline, SlabOutcome};
use biscale::scene::LoadedScene;
use biscale::{Cancel, InputError};
use glam::{DVec3, Vec3};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};

use crate::errors;
use crate::run::{Access, Job, run};
use crate::{arrays, values};

/// The effective BRDF of a scene: f̄(i, o) [1/sr], with the light's cosine.
///
/// Directions are unit vectors `(..., 3)` in the frame of the tile: z is the large-scale normal, x and y lie along the tile. `wi`
/// points to the light and `wo` to the viewer; they broadcast. Results are float32 if all directions are, else float64; they are
/// computed in single precision.
#[pyclass(frozen, module = "biscale")]
pub struct EffectiveBrdf {
    pub loaded: LoadedScene,
    pub pipeline: Pipeline,
    result: Evaluated,
    sampler: OnceLock<DirectionSampler>,
}

/// The result of a scene.
enum Evaluated {
    Opaque(Box<Outcome>),
    Slab(Box<SlabOutcome>),
}

impl EffectiveBrdf {
    pub fn compute(loaded: LoadedScene, pipeline: Pipeline) -> anyhow::Result<Self> {
        let result = if loaded.scene.slab.is_some() {
            Evaluated::Slab(Box::new(pipeline.slab(&loaded)?))
        } else {
            Evaluated::Opaque(Box::new(pipeline.effective(&loaded)?))
        };
        Ok(Self { loaded, pipeline, result, sampler: OnceLock::new() })
    }

    /// The result of a scene without a slab.
    pub fn opaque(&self, py: Python<'_>, method: &str) -> PyResult<&Outcome> {
        match &self.result {
            Evaluated::Opaque(outcome) => Ok(outcome),
            Evaluated::Slab(_) => {
                let error =
                    InputError::new("slab", "a scene with a slab", format!("a scene without it for `{method}`"));
                Err(errors::input_error(py, &error))
            }
        }
    }

    /// Evaluates a function of pairs in parallel.
    fn map_pairs<'py>(
        &self,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        progress: Option<&Bound<'py, PyAny>>,
        value: impl Fn(Vec3, Vec3) -> Vec3 + Sync + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (pairs, broadcast) = arrays::pairs_of_vec3(wi, wo)?;
        let values = run(wi.py(), Access::Shared, progress, move |job| {
            Ok(job.cancel.map("pairs", pairs.len(), |k| value(pairs[k].i, pairs[k].o))?)
        })?;
        broadcast.vectors(wi.py(), &values)
    }

    /// The sampler, which the first call tabulates.
    fn sampler(
        &self,
        py: Python<'_>,
        outcome: &Outcome,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<&DirectionSampler> {
        if let Some(sampler) = self.sampler.get() {
            return Ok(sampler);
        }
        let isotropic = !outcome.plan.is_on("anisotropy");
        let new = run(py, Access::Exclusive, progress, |job| {
            Ok(DirectionSampler::new(&outcome.brdf, isotropic, &job.progress())?)
        })?;
        Ok(self.sampler.get_or_init(|| new))
    }

    fn meta(&self, outcome: &Outcome, cancel: &Cancel) -> anyhow::Result<ExportMeta> {
        let mut pipeline = self.pipeline.clone();
        pipeline.set_cancel(cancel.clone());
        // Estimated here, so that it can be cancelled.
        outcome.errors_unless(cancel)?;
        Ok(ExportMeta::of(&self.loaded, outcome, pipeline.mesh(&self.loaded)?.closes_plane))
    }

    fn write(&self, path: &Path, options: &ExportOptions, job: &Job) -> anyhow::Result<serde_json::Value> {
        if let Some(resolution) = &options.resolution {
            resolution.check()?;
        }
        let progress = job.progress();
        match &self.result {
            Evaluated::Slab(outcome) => {
                check_output(path, &self.loaded.files())?;
                let written = SlabFormat::of(path)?.write(&outcome.slab, &self.loaded, options, path, &progress)?;
                Ok(serde_json::json!({ "output": path, "note": written.note, "pairs": written.pairs }))
            }
            Evaluated::Opaque(outcome) => {
                for output in export::outputs(path)? {
                    check_output(&output, &self.loaded.files())?;
                }
                let meta = self.meta(outcome, &job.cancel)?;
                let written = export::write(&outcome.brdf, &meta, options, path, &progress)?;
                Ok(serde_json::to_value(Report::new(path, outcome, &written))?)
            }
        }
    }
}

#[pymethods]
impl EffectiveBrdf {
    /// f̄ [1/sr], the light's cosine included: `(..., 3)`. The same bits as `biscale eval`.
    #[pyo3(signature = (wi, wo, *, progress = None))]
    fn eval<'py>(
        &self,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = wi.py();
        let (values, broadcast) = match &self.result {
            Evaluated::Opaque(outcome) => {
                let (pairs, broadcast) = arrays::pairs_of_vec3(wi, wo)?;
                let eval = |job: &Job| {
                    let values = outcome.brdf.eval_pairs(&pairs, &job.cancel)?;
                    Ok(require_finite(&values).map(|()| values)?)
                };
                (run(py, Access::Shared, progress, eval)?, broadcast)
            }
            Evaluated::Slab(outcome) => {
                let (pairs, broadcast) = arrays::pairs::<DVec3>(wi, wo)?;
                (run(py, Access::Shared, progress, |job| Ok(outcome.eval_pairs(&pairs, &job.cancel)?))?, broadcast)
            }
        };
        broadcast.vectors(py, &values)
    }

    /// The BRDF [1/sr]: f̄ over the light's cosine; 0 for a light at or below the horizon.
    #[pyo3(signature = (wi, wo, *, progress = None))]
    fn brdf<'py>(
        &self,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let brdf = &self.opaque(wi.py(), "brdf")?.brdf;
        self.map_pairs(wi, wo, progress, |i, o| if i.z > 0.0 { brdf.eval(i, o) / i.z } else { Vec3::ZERO })
    }

    /// G = a_v(o) f̄(i, o) / A [1/sr], which is reciprocal and bounded.
    #[pyo3(signature = (wi, wo, *, progress = None))]
    fn g<'py>(
        &self,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let brdf = &self.opaque(wi.py(), "g")?.brdf;
        self.map_pairs(wi, wo, progress, |i, o| brdf.g(i, o))
    }

    /// a_v(w) / A: the visible projected area of the tile along `w` over its base area.
    fn projected_area<'py>(&self, w: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let brdf = &self.opaque(w.py(), "projected_area")?.brdf;
        let (directions, broadcast) = arrays::directions::<Vec3>("w", w)?;
        let values = run(w.py(), Access::Shared, None, |job| {
            Ok(job.cancel.map("areas", directions.len(), |k| brdf.relative_projected_area(directions[k]))?)
        })?;
        broadcast.numbers(w.py(), &values)
    }

    /// The part of the light from `w` that is reflected, by a fixed quadrature with steps of 1° and 3°.
    #[pyo3(signature = (w, *, progress = None))]
    fn albedo<'py>(&self, w: &Bound<'py, PyAny>, progress: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let brdf = &self.opaque(w.py(), "albedo")?.brdf;
        let (directions, broadcast) = arrays::directions::<Vec3>("w", w)?;
        let values =
            run(w.py(), Access::Shared, progress, |job| Ok(export::reflectances(brdf, &directions, &job.cancel)?))?;
        broadcast.vectors(w.py(), &values)
    }

    /// The estimated standard error of f̄ at pairs; NaN with the paper's method.
    #[pyo3(signature = (wi, wo, *, progress = None))]
    fn standard_error<'py>(
        &self,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let outcome = self.opaque(wi.py(), "standard_error")?;
        let (pairs, broadcast) = arrays::pairs_of_vec3(wi, wo)?;
        let values = run(wi.py(), Access::Exclusive, progress, |job| {
            Ok(match outcome.errors_unless(&job.cancel)? {
                Some(estimator) => estimator.standard_errors(&pairs, &job.cancel)?,
                None => vec![Vec3::NAN; pairs.len()],
            })
        })?;
        broadcast.vectors(wi.py(), &values)
    }

    /// Draws directions in proportion to f̄, from two uniform numbers `u` `(..., 2)` each.
    ///
    /// Returns `wo`, the density `pdf` [1/sr] and `weight`, which is f̄(wo, wi) / pdf: the light that leaves along `wo` of what
    /// arrives along `wi`, and by reciprocity the light that a viewer at `wi` sees from `wo`. The mean weight is the albedo. A
    /// direction that leaves the hemisphere is zero, with density and weight 0.
    #[pyo3(signature = (wi, u, *, progress = None))]
    fn sample<'py>(
        &self,
        wi: &Bound<'py, PyAny>,
        u: &Bound<'py, PyAny>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let py = wi.py();
        let outcome = self.opaque(py, "sample")?;
        let (viewers, uniform, broadcast) = arrays::directions_and_uniform(wi, u)?;
        let sampler = self.sampler(py, outcome, progress)?;
        let drawn = run(py, Access::Shared, progress, |job| {
            Ok(sampler.sample_all(&outcome.brdf, &viewers, &uniform, &job.cancel)?)
        })?;
        let directions: Vec<Vec3> = drawn.iter().map(|drawn| drawn.direction).collect();
        let weights: Vec<Vec3> = drawn.iter().map(|drawn| drawn.weight).collect();
        let pdf: Vec<f32> = drawn.iter().map(|drawn| drawn.pdf).collect();
        let arrays =
            [broadcast.vectors(py, &directions)?, broadcast.numbers(py, &pdf)?, broadcast.vectors(py, &weights)?];
        PyTuple::new(py, arrays)
    }

    /// The density [1/sr] with which `sample` draws `wo` for `wi`.
    #[pyo3(signature = (wi, wo, *, progress = None))]
    fn pdf<'py>(
        &self,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = wi.py();
        let outcome = self.opaque(py, "pdf")?;
        let (pairs, broadcast) = arrays::pairs_of_vec3(wi, wo)?;
        let sampler = self.sampler(py, outcome, progress)?;
        let values = run(py, Access::Shared, progress, |job| {
            Ok(job.cancel.map("pairs", pairs.len(), |k| sampler.pdf(pairs[k].i, pairs[k].o))?)
        })?;
        broadcast.numbers(py, &values)
    }

    /// The arrays of an `.npz` file that `biscale export` writes: `theta_i`, `phi_i`, `theta_o`, `phi_o` [rad],
    /// `brdf` and `g` [1/sr] over all four axes and RGB, `projected_area`, and `meta` (JSON).
    #[pyo3(signature = (theta = 16, phi = 64, *, theta_o = None, phi_o = None, progress = None))]
    fn table<'py>(
        &self,
        py: Python<'py>,
        theta: usize,
        phi: usize,
        theta_o: Option<usize>,
        phi_o: Option<usize>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let outcome = self.opaque(py, "table")?;
        let (theta_o, phi_o) = (theta_o.unwrap_or(theta), phi_o.unwrap_or(phi));
        let resolution = Some(ExportResolution { theta_i: theta, phi_i: phi, theta_o, phi_o });
        let options = ExportOptions { resolution, ..ExportOptions::default() };
        let bytes = run(py, Access::Exclusive, progress, |job| {
            let meta = self.meta(outcome, &job.cancel)?;
            Ok(export::npz_bytes(&outcome.brdf, &meta, &options, &job.progress())?)
        })?;
        let file = py.import("io")?.getattr("BytesIO")?.call1((PyBytes::new(py, &bytes),))?;
        let arrays = py.import("numpy")?.call_method1("load", (file,))?;
        let table = PyDict::new(py);
        for name in arrays.getattr("files")?.try_iter()? {
            let name = name?;
            table.set_item(&name, arrays.get_item(&name)?)?;
        }
        Ok(table)
    }

    /// Writes a table, as `biscale export` does; the ending selects the format. Returns the report of `--json`.
    ///
    /// `resolution` holds the steps of theta and phi, `resolution_o` those of the second direction alone, and `radiance` is `klems`
    /// or `tensor-tree`.
    #[pyo3(signature = (path, *, resolution = None, resolution_o = None, radiance = "klems", progress = None))]
    fn export<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        resolution: Option<(usize, usize)>,
        resolution_o: Option<(usize, usize)>,
        radiance: &str,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let radiance = match radiance {
            "klems" => RadianceBasis::Klems,
            "tensor-tree" => RadianceBasis::TensorTree,
            other => {
                let error = InputError::new("radiance", format!("`{other}`"), "`klems` or `tensor-tree`");
                return Err(errors::input_error(py, &error));
            }
        };
        let resolution = resolution.or(resolution_o).map(|(theta_i, phi_i)| {
            let (theta_o, phi_o) = resolution_o.unwrap_or((theta_i, phi_i));
            ExportResolution { theta_i, phi_i, theta_o, phi_o }
        });
        let options = ExportOptions { resolution, radiance };
        let report = run(py, Access::Exclusive, progress, |job| self.write(&path, &options, job))?;
        values::from_json(py, &report)
    }

    /// Fits analytic models, as `biscale fit` does: one report per model.
    #[pyo3(signature = (*, progress = None))]
    fn fit<'py>(&self, py: Python<'py>, progress: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let reports = run(py, Access::Exclusive, progress, |job| match &self.result {
            Evaluated::Slab(outcome) => {
                Ok(serde_json::json!([slab_report(&fit_slab(&outcome.slab, &job.progress())?)]))
            }
            Evaluated::Opaque(outcome) => {
                let fitted = |model: Model| Ok(fit_model(&outcome.brdf, model, &job.progress())?.1);
                let reports: Vec<_> = Model::ALL.into_iter().map(fitted).collect::<anyhow::Result<_>>()?;
                Ok(serde_json::to_value(reports)?)
            }
        })?;
        values::from_json(py, &reports)
    }

    /// The health of the result: `warnings` in words, and the numbers behind them.
    #[getter]
    fn health<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &self.result {
            Evaluated::Slab(outcome) => values::from_json(py, &outcome.health),
            Evaluated::Opaque(outcome) => {
                let measure = |job: &Job| Ok(outcome.health_unless(&job.cancel)?);
                values::from_json(py, run(py, Access::Exclusive, None, measure)?)
            }
        }
    }

    /// The stated error of the result, or None: with the paper's method and for slabs.
    #[getter]
    fn error<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let estimate = match &self.result {
            Evaluated::Slab(_) => None,
            Evaluated::Opaque(outcome) => run(py, Access::Exclusive, None, |job| {
                Ok(outcome.errors_unless(&job.cancel)?.map(|errors| errors.estimate()))
            })?,
        };
        values::from_json(py, &estimate)
    }

    /// The effects of the plan: whether each is on, and why.
    #[getter]
    fn plan<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &self.result {
            Evaluated::Slab(outcome) => values::from_json(py, &outcome.effects),
            Evaluated::Opaque(outcome) => values::from_json(py, &outcome.plan.effects),
        }
    }

    /// The stages that ran, and the milliseconds of each.
    #[getter]
    fn times_ms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let times = match &self.result {
            Evaluated::Slab(outcome) => &outcome.times,
            Evaluated::Opaque(outcome) => &outcome.times,
        };
        let stages = PyDict::new(py);
        times.iter().try_for_each(|(name, ms)| stages.set_item(name, ms))?;
        Ok(stages)
    }

    /// The representation, in words.
    #[getter]
    fn form(&self) -> String {
        match &self.result {
            Evaluated::Slab(outcome) => outcome.describe(),
            Evaluated::Opaque(outcome) => outcome.brdf.representation.describe(),
        }
    }

    /// Notes on the computation.
    #[getter]
    fn notes(&self) -> Vec<String> {
        match &self.result {
            Evaluated::Slab(_) => Vec::new(),
            Evaluated::Opaque(outcome) => outcome.notes.clone(),
        }
    }

    fn __repr__(&self) -> String {
        format!("<biscale.EffectiveBrdf of {:?}: {}>", self.loaded.name, self.form())
    }
}
