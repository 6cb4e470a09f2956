//! The class `Scene`.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use biscale::InputError;
use biscale::cli;
use biscale::cli::render::{Shot, shade, shade_slab};
use biscale::cli::watch::Watch;
use biscale::pipeline::Pipeline;
use biscale::render::RenderScene;
use biscale::scene::{EditableScene, LoadedScene, SceneBundle, keys_of, shipped};
use glam::{DVec3, Vec3};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyTuple};

use crate::effective::EffectiveBrdf;
use crate::errors::{self, OrRaise};
use crate::run::{Access, run};
use crate::{arrays, values};

/// A scene: the tile, its materials, and the object that shows them.
///
/// `scene` is the name of a shipped scene (`biscale.scenes()`) or the path of a scene file. A scene keeps what it computed: after
/// one key changed, only what depends on it is computed again.
#[pyclass(frozen, module = "biscale")]
pub struct Scene {
    scene: Mutex<EditableScene>,
    pipeline: Pipeline,
    /// Keeps the folder of a scene that was unpickled.
    folder: Option<Py<PyAny>>,
}

/// Options of a computation, as the command line has them.
#[derive(Default)]
pub struct Options<'py> {
    pub quality: Option<String>,
    pub seed: Option<u64>,
    pub backend: Option<String>,
    pub effects: Option<Bound<'py, PyMapping>>,
}

impl Options<'_> {
    /// The overrides that the command line makes of its options.
    fn overrides(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let mut texts = Vec::new();
        texts.extend(self.quality.iter().map(|name| format!("quality.preset={name:?}")));
        texts.extend(self.backend.iter().map(|name| format!("quality.backend={name:?}")));
        texts.extend(self.seed.iter().map(|seed| format!("quality.seed={seed}")));
        let effects = self.effects.as_ref().map(PyMappingMethods::items).transpose()?;
        for effect in effects.iter().flatten() {
            let (name, switch): (Bound<'_, PyAny>, Bound<'_, PyAny>) = effect.extract()?;
            let switch = match switch.extract::<bool>() {
                Ok(on) => (if on { "on" } else { "off" }).to_owned(),
                Err(_) => switch.str()?.extract::<String>()?,
            };
            let name: String = name.str()?.extract()?;
            texts.push(cli::effect_override(&name, &switch).map_err(|error| errors::input_error(py, &error))?);
        }
        Ok(texts)
    }
}

impl Scene {
    fn new_with(scene: EditableScene, folder: Option<Py<PyAny>>) -> Self {
        Self { scene: Mutex::new(scene), pipeline: biscale::gpu::pipeline(), folder }
    }

    fn lock(&self) -> MutexGuard<'_, EditableScene> {
        self.scene.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn loaded(&self, py: Python<'_>, options: &Options<'_>) -> PyResult<LoadedScene> {
        let texts = options.overrides(py)?;
        let loaded = self.lock().with_overrides(&texts).or_raise(py)?;
        if loaded.scene.quality.backend == "gpu" {
            let found = "`gpu`, which this package was built without (feature `gpu`)";
            return Err(errors::input_error(py, &InputError::new("quality.backend", found, "`auto` or `cpu`")));
        }
        Ok(loaded)
    }
}

#[pymethods]
impl Scene {
    #[new]
    fn new(py: Python<'_>, scene: PathBuf) -> PyResult<Self> {
        let opened = EditableScene::open(&scene.to_string_lossy()).or_raise(py)?;
        Ok(Self::new_with(opened, None))
    }

    /// Parses the text of a scene file (TOML). Relative paths start at `folder`.
    #[staticmethod]
    #[pyo3(signature = (text, folder = None))]
    fn parse(py: Python<'_>, text: &str, folder: Option<PathBuf>) -> PyResult<Self> {
        let parsed = EditableScene::parse(text, &folder.unwrap_or_default(), "scene").or_raise(py)?;
        Ok(Self::new_with(parsed, None))
    }

    /// The name of the shipped scene, or the stem of the file.
    #[getter]
    fn name(&self) -> String {
        self.lock().loaded().name.clone()
    }

    /// The value of a key, with its default; None for an optional key that is not set.
    fn __getitem__<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let value = self.lock().get(key).or_raise(py)?;
        value.map(|value| values::from_toml(py, &value)).transpose()
    }

    /// Whether the scene has a key, set or not.
    fn __contains__(&self, key: &str) -> bool {
        self.lock().get(key).is_ok()
    }

    /// Sets a key, as `--set` does.
    fn __setitem__(&self, py: Python<'_>, key: String, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let value = values::to_toml(&key, value)?;
        self.lock().set(&[(key, value)]).or_raise(py)
    }

    /// Sets several keys, all of them or none.
    fn set(&self, py: Python<'_>, edits: &Bound<'_, PyMapping>) -> PyResult<()> {
        let edits = edits.items()?;
        let edits = edits.iter().map(|edit| {
            let (key, value): (String, Bound<'_, PyAny>) = edit.extract()?;
            let value = values::to_toml(&key, &value)?;
            Ok((key, value))
        });
        let edits: Vec<_> = edits.collect::<PyResult<_>>()?;
        self.lock().set(&edits).or_raise(py)
    }

    /// An independent copy.
    fn copy(&self, py: Python<'_>) -> Self {
        Self::new_with(self.lock().clone(), self.folder.as_ref().map(|folder| folder.clone_ref(py)))
    }

    fn __copy__(&self, py: Python<'_>) -> Self {
        self.copy(py)
    }

    fn __deepcopy__(&self, py: Python<'_>, memo: &Bound<'_, PyAny>) -> Self {
        let _ = memo;
        self.copy(py)
    }

    /// The text of a scene file with all keys.
    fn to_toml(&self, py: Python<'_>) -> PyResult<String> {
        self.lock().to_toml().or_raise(py)
    }

    /// A key of everything that results depend on: the scene, the content of its files, the build of the package, and `more`.
    #[pyo3(signature = (more = None))]
    fn key(&self, py: Python<'_>, more: Option<&[u8]>) -> PyResult<String> {
        Ok(SceneBundle::of(&self.lock()).or_raise(py)?.key(more.unwrap_or_default()).name())
    }

    /// The keys of this scene: `key`, `unit`, `type`, `range`, `choices`, `default`, `doc` and `value` of each.
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let keys = keys_of(&self.lock().loaded().scene).or_raise(py)?;
        values::from_json(py, &keys)
    }

    /// Computes the effective BRDF, as `biscale eval` does.
    ///
    /// `quality` is a preset (`draft`, `standard`, `fine`, `reference`, `wu2011`), `backend` is `auto` or `cpu`, and `effects` forces
    /// effects of the plan `on` or `off`. `progress` is called with the completed fraction and stops the computation by
    /// returning False. Raises `Cancelled` then.
    #[pyo3(signature = (*, quality = None, seed = None, backend = None, effects = None, progress = None))]
    fn effective(
        &self,
        py: Python<'_>,
        quality: Option<String>,
        seed: Option<u64>,
        backend: Option<String>,
        effects: Option<Bound<'_, PyMapping>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<EffectiveBrdf> {
        let loaded = self.loaded(py, &Options { quality, seed, backend, effects })?;
        let mut pipeline = self.pipeline.clone();
        run(py, Access::Exclusive, progress, move |job| {
            pipeline.set_cancel(job.cancel.clone());
            EffectiveBrdf::compute(loaded, pipeline)
        })
    }

    /// Estimates f̄ [1/sr] of pairs by ray casting (photons for slabs), and its standard error.
    ///
    /// The directions are unit vectors `(..., 3)` that broadcast: `wi` towards the light, `wo` towards the viewer. The estimate
    /// ends at the relative standard error `target`.
    #[pyo3(signature = (wi, wo, *, target = None, seed = None, effects = None, progress = None))]
    #[expect(clippy::too_many_arguments, reason = "they are the keywords of a Python function")]
    fn reference<'py>(
        &self,
        py: Python<'py>,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        target: Option<f64>,
        seed: Option<u64>,
        effects: Option<Bound<'py, PyMapping>>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let quality = Some("reference".to_owned());
        let loaded = self.loaded(py, &Options { quality, seed, effects, ..Options::default() })?;
        if let Some(target) = target.filter(|target| !(*target > 0.0 && *target < 1.0)) {
            let error = InputError::new("target", target, "a relative error between 0 and 1");
            return Err(errors::input_error(py, &error));
        }
        let mut pipeline = self.pipeline.clone();
        let (pairs, broadcast) = arrays::pairs::<DVec3>(wi, wo)?;
        let (values, errors) = run(py, Access::Exclusive, progress, move |job| {
            pipeline.set_cancel(job.cancel.clone());
            if loaded.scene.slab.is_some() {
                let target = target.unwrap_or(biscale::pipeline::PHOTON_TARGET);
                let slab = pipeline.slab_reference(&loaded, &pairs, target)?;
                return Ok((slab.values, slab.errors));
            }
            let single = |(i, o): (DVec3, DVec3)| biscale::metrics::Pair { i: i.as_vec3(), o: o.as_vec3() };
            let pairs: Vec<_> = pairs.into_iter().map(single).collect();
            // The squared error falls in proportion to the rays.
            let goal = target.unwrap_or(f64::from(loaded.scene.quality.reference_target));
            let progress = job.progress();
            let part = |_, error: f64| progress((goal / error.max(goal)).powi(2) as f32);
            let estimates = pipeline.reference(&loaded, &pairs, target, part)?;
            Ok(estimates
                .iter()
                .map(|estimate| (estimate.f_bar, estimate.standard_error))
                .unzip::<_, _, Vec<Vec3>, Vec<Vec3>>())
        })?;
        PyTuple::new(py, [broadcast.vectors(py, &values)?, broadcast.vectors(py, &errors)?])
    }

    /// Renders the scene's object, as `biscale render` does: linear RGB, `(height, width, 3)`, float32.
    ///
    /// `size` is width and height in pixels; `samples` is the number of samples per pixel side at edges.
    #[pyo3(
        signature = (size = (768, 768), *, samples = 2, quality = None, seed = None, backend = None, effects = None, progress = None),
        text_signature = "($self, size=(768, 768), *, samples=2, quality=None, seed=None, backend=None, effects=None, progress=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "they are the keywords of a Python function")]
    fn render<'py>(
        &self,
        py: Python<'py>,
        size: (usize, usize),
        samples: u8,
        quality: Option<String>,
        seed: Option<u64>,
        backend: Option<String>,
        effects: Option<Bound<'py, PyMapping>>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let loaded = self.loaded(py, &Options { quality, seed, backend, effects })?;
        let mut pipeline = self.pipeline.clone();
        let image = run(py, Access::Exclusive, progress, move |job| {
            pipeline.set_cancel(job.cancel.clone());
            let render_scene = RenderScene::with(&pipeline, &loaded)?;
            let watch = Watch::unseen(job.cancel.clone());
            let shot = Shot { size: [size.0, size.1], samples_per_side: usize::from(samples), watch };
            if loaded.scene.slab.is_some() {
                let mut outcome = pipeline.slab(&loaded)?;
                return Ok(shade_slab(&pipeline, &loaded, &render_scene, &mut outcome, &shot)?.image);
            }
            let outcome = pipeline.effective(&loaded)?;
            Ok(shade(&pipeline, &loaded, &render_scene, &outcome, &shot)?.image)
        })?;
        let values: Vec<f32> = image.pixels.iter().flat_map(|pixel| pixel.to_array()).collect();
        Ok(PyArray1::from_vec(py, values).reshape([image.height, image.width, 3])?.into_any())
    }

    fn __repr__(&self) -> String {
        format!("<biscale.Scene {:?}>", self.lock().loaded().name)
    }

    /// Pickles the scene with the content of the files that it names.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PickledScene)> {
        let SceneBundle { text, name, files } = SceneBundle::of(&self.lock()).or_raise(py)?;
        let files = files.into_iter().map(|(name, bytes)| (name, PickledBytes(bytes))).collect();
        Ok((py.import("biscale._core")?.getattr("_unpickle")?, (text, name, files)))
    }
}

/// Text, name, and files of a scene.
type PickledScene = (String, String, Vec<(String, PickledBytes)>);

/// Bytes that become `bytes` in Python.
pub struct PickledBytes(pub Vec<u8>);

impl<'py> IntoPyObject<'py> for PickledBytes {
    type Target = pyo3::types::PyBytes;
    type Output = Bound<'py, Self::Target>;
    type Error = std::convert::Infallible;

    fn into_pyobject(self, py: Python<'py>) -> Result<Self::Output, Self::Error> {
        Ok(pyo3::types::PyBytes::new(py, &self.0))
    }
}

/// Restores a pickled scene. Its files lie in a temporary folder as long as the scene and its copies exist.
pub fn unpickle(py: Python<'_>, text: String, name: String, files: Vec<(String, Vec<u8>)>) -> PyResult<Scene> {
    let bundle = SceneBundle { text, name, files };
    if bundle.files.is_empty() {
        return Ok(Scene::new_with(bundle.unpack(Path::new("")).or_raise(py)?, None));
    }
    let keywords = PyDict::new(py);
    keywords.set_item("prefix", "biscale-")?;
    let folder = py.import("tempfile")?.getattr("TemporaryDirectory")?.call((), Some(&keywords))?;
    let path: PathBuf = folder.getattr("name")?.extract()?;
    Ok(Scene::new_with(bundle.unpack(&path).or_raise(py)?, Some(folder.unbind())))
}

/// Names and descriptions of the shipped scenes.
pub fn shipped_scenes(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let scenes = PyDict::new(py);
    for name in shipped::names() {
        scenes.set_item(name, shipped::description(name))?;
    }
    Ok(scenes)
}
