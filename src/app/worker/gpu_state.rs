//! GPU state of one worker: opened only if it is useful, with the object and the material that it shades.

use std::sync::Arc;

use crate::base::{Cancel, Error, Result};
use crate::effective::{EffectiveBrdf, Representation};
use crate::gpu::{Gpu, GpuError, GpuRenderer, Tier};
use crate::interreflection::InterreflectionTable;
use crate::pipeline::GpuTile;
use crate::render::RenderScene;

use super::preview_renderer::{RenderRequest, ShadedMaterial};
use super::screen::Screen;

/// State of a worker's GPU.
#[derive(Default)]
pub enum GpuState {
    #[default]
    Unopened,
    /// No GPU, for this reason; the CPU renders.
    None(String),
    /// Failed while in use, for this reason.
    Lost(String),
    /// Name of a software adapter, used only if the backend is `gpu`.
    Software(String),
    Open(OpenGpu),
}

/// An open GPU and its renderer.
pub struct OpenGpu {
    gpu: Arc<Gpu>,
    is_hardware: bool,
    /// Renderer of the current object, with its current material.
    renderer: Option<(Box<GpuRenderer>, RendererMaterial)>,
}

/// Material that a GPU renderer shades with, and the interreflection that a draft adds to it.
struct RendererMaterial(MaterialSource, Option<Arc<InterreflectionTable>>);

enum MaterialSource {
    Brdf(Arc<EffectiveBrdf>),
    Tile(Arc<GpuTile>),
    Nothing,
}

impl RendererMaterial {
    fn is_same(&self, other: &Self) -> bool {
        let is_same_source = match (&self.0, &other.0) {
            (MaterialSource::Brdf(a), MaterialSource::Brdf(b)) => Arc::ptr_eq(a, b),
            (MaterialSource::Tile(a), MaterialSource::Tile(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        is_same_source && self.1.as_ref().map(Arc::as_ptr) == other.1.as_ref().map(Arc::as_ptr)
    }
}

/// Inputs of one image on the GPU.
#[derive(Clone, Copy)]
pub struct PreviewInput<'a> {
    pub scene: &'a RenderScene,
    pub request: &'a RenderRequest<'a>,
    pub screen: Option<&'a Screen>,
}

impl GpuState {
    /// Drops the renderer because the object changed.
    pub fn forget_object(&mut self) {
        if let Self::Open(open) = self {
            open.renderer = None;
        }
    }

    /// Records that the only adapter is this software adapter, so that it is not opened.
    pub fn exclude_software(&mut self, name: &str) {
        if matches!(self, Self::Unopened) {
            *self = Self::Software(name.to_owned());
        }
    }

    /// Returns true if a hardware GPU is open.
    pub fn is_hardware(&self) -> bool {
        matches!(self, Self::Open(open) if open.is_hardware)
    }

    /// Runs `work` on the GPU with the requested material; also returns the milliseconds spent on the shading table.
    ///
    /// Returns `None` if the CPU has to render. After a GPU failure the CPU renders all further images.
    ///
    /// # Errors
    /// Returns [`Error::Cancelled`] if the work was cancelled.
    pub fn run<T>(
        &mut self,
        input: PreviewInput,
        cancel: &Cancel,
        work: impl FnOnce(&mut GpuRenderer, &Gpu) -> Result<T>,
    ) -> Result<Option<(T, f64)>> {
        let backend = input.request.backend;
        if backend == "cpu" {
            *self = Self::Unopened;
            return Ok(None);
        }
        if matches!(self, Self::Unopened) || matches!(self, Self::Software(_)) && backend == "gpu" {
            *self = Self::open(backend == "gpu", input.screen);
        }
        let Self::Open(open) = self else { return Ok(None) };
        let done = open.set_material(input, cancel).and_then(|table_ms| match (&mut open.renderer, table_ms) {
            (Some((renderer, _)), Some(table_ms)) => work(renderer, &open.gpu).map(|done| Some((done, table_ms))),
            _ => Ok(None),
        });
        match done {
            Ok(done) => Ok(done),
            Err(Error::Cancelled) => Err(Error::Cancelled),
            Err(Error::Input(_)) => Ok(None),
            // The image exceeds the GPU's limits; the next one may be smaller.
            Err(Error::Gpu(GpuError::TooLarge { .. } | GpuError::OutOfMemory(_) | GpuError::Unsupported(_))) => {
                open.renderer = None;
                Ok(None)
            }
            Err(error) => {
                *self = Self::Lost(error.to_string());
                Ok(None)
            }
        }
    }

    /// Opens a GPU. A software adapter is opened only if `required`.
    fn open(required: bool, screen: Option<&Screen>) -> Self {
        let gpu = match screen.filter(|screen| required || screen.is_hardware) {
            Some(screen) => Ok((screen.gpu.clone(), screen.is_hardware)),
            None => Gpu::open().map(|gpu| {
                let is_hardware = gpu.tier == Tier::Hardware;
                (Arc::new(gpu), is_hardware)
            }),
        };
        match gpu {
            // A software adapter is slower than this program's CPU code.
            Ok((gpu, false)) if !required => Self::Software(gpu.adapter.name.clone()),
            Ok((gpu, is_hardware)) => Self::Open(OpenGpu { gpu, is_hardware, renderer: None }),
            Err(_) => Self::None("no graphics adapter".to_owned()),
        }
    }

    /// Reason why the GPU failed while it was in use.
    pub fn gpu_error(&self) -> Option<String> {
        match self {
            Self::Lost(why) => Some(why.clone()),
            _ => None,
        }
    }

    /// Description of the processor that renders images.
    pub fn describe(&self) -> String {
        match self {
            Self::Unopened => "CPU".to_owned(),
            Self::Software(name) => format!("CPU ({name} would be slower)"),
            Self::None(why) => format!("CPU ({why})"),
            Self::Lost(_) => "CPU (the GPU failed)".to_owned(),
            Self::Open(open) if open.renderer.is_some() => open.gpu.description(),
            Self::Open(open) => format!("CPU, beside {}", open.gpu.description()),
        }
    }
}

impl OpenGpu {
    /// Sets the requested material: as a shading table if one exists or pays off, else as a sum.
    ///
    /// Returns the milliseconds spent on the table, or `None` if the GPU does not shade this material.
    fn set_material(&mut self, input: PreviewInput, cancel: &Cancel) -> Result<Option<f64>> {
        let outcome = match input.request.material {
            ShadedMaterial::Outcome(outcome) => outcome,
            ShadedMaterial::GpuTile(tile) => {
                return Ok(self.set_renderer_material(input, MaterialSource::Tile(tile.clone()))?.then_some(0.0));
            }
        };
        let mut table_ms = 0.0;
        // A GPU evaluates a draft's sums sooner than the CPU builds a table; for a clustered sum it builds no table.
        let representation = outcome.brdf.direct_representation();
        let is_clustered = matches!(representation, Representation::Direct(direct) if direct.has_clustered_sum());
        let shading_brdf = match outcome.known_shading_brdf() {
            None if is_clustered || !self.is_hardware || input.request.build_caches => {
                let shading_brdf = outcome.shading_brdf(cancel)?;
                table_ms = shading_brdf.ms;
                Some(shading_brdf.brdf)
            }
            known => known,
        };
        // A software adapter does not evaluate sums if the CPU can read a table.
        let sums = Some(&outcome.brdf).filter(|_| self.is_hardware || shading_brdf.is_none());
        for brdf in shading_brdf.iter().chain(sums) {
            if self.set_renderer_material(input, MaterialSource::Brdf(brdf.clone()))? {
                return Ok(Some(table_ms));
            }
        }
        self.renderer = None;
        Ok(None)
    }

    /// Sets the material of the renderer; returns false if the GPU does not support it.
    fn set_renderer_material(&mut self, input: PreviewInput, source: MaterialSource) -> Result<bool> {
        let material = RendererMaterial(source, input.request.bounced.cloned());
        if self.renderer.as_ref().is_some_and(|(_, last)| last.is_same(&material)) {
            return Ok(true);
        }
        let gpu = &self.gpu;
        let mut renderer = match self.renderer.take() {
            Some((renderer, _)) => renderer,
            None => Box::new(GpuRenderer::new(gpu, input.scene.mesh(), input.scene.object_occluder())?),
        };
        let set = match &material.0 {
            MaterialSource::Brdf(brdf) => renderer.set_brdf(gpu, brdf).map(|()| brdf.base_area),
            MaterialSource::Tile(tile) => renderer.set_tile(gpu, &tile.input).map(|()| tile.input.base_area),
            MaterialSource::Nothing => Ok(0.0),
        };
        let set = set.and_then(|base_area| match &material.1 {
            Some(bounced) => renderer.add_bounced(gpu, bounced, base_area),
            None => Ok(()),
        });
        let is_supported = match set {
            Ok(()) => true,
            Err(GpuError::Unsupported(_) | GpuError::TooLarge { .. }) => false,
            Err(error) => return Err(error.into()),
        };
        // The renderer's pipelines are reused for the next material.
        self.renderer =
            Some((renderer, if is_supported { material } else { RendererMaterial(MaterialSource::Nothing, None) }));
        Ok(is_supported)
    }

    /// Returns true if this is the GPU on which the window draws.
    pub fn is_on(&self, screen: &Screen) -> bool {
        Arc::ptr_eq(&self.gpu, &screen.gpu)
    }
}
