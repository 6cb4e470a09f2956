//! The graphics device of one worker: opened where it is of use, with the object and the material that it shades.

use std::sync::Arc;

use crate::base::{Cancel, Error, Result};
use crate::effective::{EffectiveBrdf, Representation};
use crate::gpu::{Gpu, GpuError, GpuRenderer, Tier};
use crate::pipeline::GpuTile;
use crate::render::ObjectMesh;
use crate::render::shadow::Occluder;

use super::screen::Screen;
use super::studio::{Shot, Worn};

#[derive(Default)]
pub enum Device {
    #[default]
    NotAsked,
    /// Why pictures are made on the CPU.
    None(String),
    /// It was in use and failed, for this reason.
    Lost(String),
    /// The adapter that is software, used only where it is asked for.
    Slower(String),
    Open(OnDevice),
}

pub struct OnDevice {
    gpu: Arc<Gpu>,
    /// Whether it is a graphics processor.
    is_fast: bool,
    /// For one object, with the BRDF that it shades with.
    renderer: Option<(Box<GpuRenderer>, Wears)>,
}

/// What a renderer wears.
enum Wears {
    Brdf(Arc<EffectiveBrdf>),
    Tile(Arc<GpuTile>),
    Nothing,
}

impl Wears {
    fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Brdf(a), Self::Brdf(b)) => Arc::ptr_eq(a, b),
            (Self::Tile(a), Self::Tile(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// What is shaded, and what of it the device needs.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    pub mesh: &'a ObjectMesh,
    pub occluder: Option<&'a Occluder>,
    pub shot: &'a Shot<'a>,
    pub screen: Option<&'a Screen>,
}

/// Tests set it: the next picture on a device finds it lost.
#[cfg(test)]
pub static LOSE_DEVICE: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(false);

impl Device {
    /// Another object is to be shaded.
    pub fn forget_object(&mut self) {
        if let Self::Open(device) = self {
            device.renderer = None;
        }
    }

    /// There is only this adapter, which is software: it is not opened to find that out.
    pub fn leave_out(&mut self, name: &str) {
        if matches!(self, Self::NotAsked) {
            *self = Self::Slower(name.to_owned());
        }
    }

    /// Whether this is a graphics processor.
    pub fn is_fast(&self) -> bool {
        matches!(self, Self::Open(device) if device.is_fast)
    }

    /// Runs `work` on the device, wearing the material; also tells what the table took that it reads. `None` where the CPU
    /// is to do it. What fails here fails for good.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn run<T>(
        &mut self,
        subject: Subject,
        cancel: &Cancel,
        work: impl FnOnce(&mut GpuRenderer, &Gpu) -> Result<T>,
    ) -> Result<Option<(T, f64)>> {
        let backend = subject.shot.backend;
        if backend == "cpu" {
            *self = Self::NotAsked;
            return Ok(None);
        }
        if matches!(self, Self::NotAsked) || matches!(self, Self::Slower(_)) && backend == "gpu" {
            *self = Self::open(backend == "gpu", subject.screen);
        }
        let Self::Open(device) = self else { return Ok(None) };
        #[cfg(test)]
        if LOSE_DEVICE.swap(false, std::sync::atomic::Ordering::SeqCst) {
            device.gpu.device.destroy();
        }
        let done = device.wear(subject, cancel).and_then(|worn| match (&mut device.renderer, worn) {
            (Some((renderer, _)), Some(table_ms)) => work(renderer, &device.gpu).map(|done| Some((done, table_ms))),
            _ => Ok(None),
        });
        match done {
            Ok(done) => Ok(done),
            Err(Error::Cancelled) => Err(Error::Cancelled),
            Err(Error::Input(_)) => Ok(None),
            // Too much for it: the next picture may be less.
            Err(Error::Device(GpuError::TooLarge { .. } | GpuError::OutOfMemory(_) | GpuError::Unsupported(_))) => {
                device.renderer = None;
                Ok(None)
            }
            Err(error) => {
                *self = Self::Lost(error.to_string());
                Ok(None)
            }
        }
    }

    fn open(asked: bool, screen: Option<&Screen>) -> Self {
        let gpu = match screen.filter(|screen| asked || screen.is_fast) {
            Some(screen) => Ok((screen.gpu.clone(), screen.is_fast)),
            None => Gpu::open().map(|gpu| {
                let is_fast = gpu.tier == Tier::Hardware;
                (Arc::new(gpu), is_fast)
            }),
        };
        match gpu {
            // The processor in disguise is slower than our own routes: it is not kept open.
            Ok((gpu, false)) if !asked => Self::Slower(gpu.adapter.name.clone()),
            Ok((gpu, is_fast)) => Self::Open(OnDevice { gpu, is_fast, renderer: None }),
            Err(_) => Self::None("no graphics adapter".to_owned()),
        }
    }

    /// What became of a device that failed while it was in use.
    pub fn trouble(&self) -> Option<String> {
        match self {
            Self::Lost(why) => Some(why.clone()),
            _ => None,
        }
    }

    /// Where pictures are made, in words.
    pub fn describe(&self) -> String {
        match self {
            Self::NotAsked => "CPU".to_owned(),
            Self::Slower(name) => format!("CPU ({name} would be slower)"),
            Self::None(why) => format!("CPU ({why})"),
            Self::Lost(_) => "CPU (the graphics device failed)".to_owned(),
            Self::Open(device) if device.renderer.is_some() => device.gpu.description(),
            Self::Open(device) => format!("CPU, beside {}", device.gpu.description()),
        }
    }
}

impl OnDevice {
    /// Takes the material over, as a table where that is there or pays, else as sums; the table's milliseconds, or `None`
    /// where the device does not shade this material.
    fn wear(&mut self, subject: Subject, cancel: &Cancel) -> Result<Option<f64>> {
        let outcome = match subject.shot.material {
            Worn::Known(outcome) => outcome,
            Worn::GpuTile(tile) => return Ok(self.takes(subject, Wears::Tile(tile.clone()))?.then_some(0.0)),
        };
        let mut table_ms = 0.0;
        // A graphics processor has a draft's sums done before the CPU has a table; few facets of few normals are picked at once.
        let few = matches!(outcome.brdf.direct_form(), Representation::Direct(direct) if direct.has_few());
        let shading_brdf = match outcome.known_shading_brdf() {
            None if few || !self.is_fast || subject.shot.settle => {
                let shading_brdf = outcome.shading_brdf(cancel)?;
                table_ms = shading_brdf.ms;
                Some(shading_brdf.brdf)
            }
            known => known,
        };
        // The processor in disguise is not asked for sums where the processor itself reads a table.
        let sums = Some(&outcome.brdf).filter(|_| self.is_fast || shading_brdf.is_none());
        for brdf in shading_brdf.iter().chain(sums) {
            if self.takes(subject, Wears::Brdf(brdf.clone()))? {
                return Ok(Some(table_ms));
            }
        }
        self.renderer = None;
        Ok(None)
    }

    /// Whether the device shades this.
    fn takes(&mut self, Subject { mesh, occluder, .. }: Subject, what: Wears) -> Result<bool> {
        if self.renderer.as_ref().is_some_and(|(_, last)| last.is_same(&what)) {
            return Ok(true);
        }
        let gpu = &self.gpu;
        let mut renderer = match self.renderer.take() {
            Some((renderer, _)) => renderer,
            None => Box::new(GpuRenderer::new(gpu, mesh, occluder)?),
        };
        let worn = match &what {
            Wears::Brdf(brdf) => renderer.set_brdf(gpu, brdf),
            Wears::Tile(tile) => renderer.set_tile(gpu, &tile.sum),
            Wears::Nothing => Ok(()),
        };
        let taken = match worn {
            Ok(()) => true,
            Err(GpuError::Unsupported(_) | GpuError::TooLarge { .. }) => false,
            Err(error) => return Err(error.into()),
        };
        // Its pipelines stay for the next material.
        self.renderer = Some((renderer, if taken { what } else { Wears::Nothing }));
        Ok(taken)
    }

    pub fn is_of(&self, screen: &Screen) -> bool {
        Arc::ptr_eq(&self.gpu, &screen.gpu)
    }
}
