//! What stays between pictures: the object, its lights and shadows, the device. Each is made anew only when its input
//! changed.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use biscale::close_up::{CloseUp, Wearing, on_object};
use biscale::filtering::{EffectiveBrdf, Reflectance, SumMaterial};
use biscale::gpu::{Gpu, GpuError, Tier};
use biscale::large_scale::environment::{self, Environment};
use biscale::large_scale::light_choice::worth_shading;
use biscale::large_scale::lights::{self, Lights};
use biscale::large_scale::shading::Background;
use biscale::large_scale::shadow::Occluder;
use biscale::large_scale::shadow_cache::ShadowCache;
use biscale::large_scale::{
    CameraView, DirectionalLight, GpuRenderer, ObjectMesh, RenderInput, Rendered, objects, render,
};
use biscale::pipeline::Outcome;
use biscale::scene::{self, Camera, LoadedScene, Switch};
use biscale::{Cancel, Error, Result};
use glam::Vec3;

/// The large scale of a scene, ready to be shaded.
#[derive(Default)]
pub struct Studio {
    object: Option<Object>,
    environment: Option<((String, PathBuf), Environment)>,
    lights: Option<((scene::Light, PathBuf, Switch), Lights)>,
    /// For the object and the lights above.
    shadows: Option<ShadowCache>,
    gpu: Device,
}

struct Object {
    /// With whether its shadows are forced.
    key: (scene::Object, PathBuf, Switch),
    mesh: Arc<ObjectMesh>,
    occluder: Option<Occluder>,
}

#[derive(Default)]
enum Device {
    #[default]
    NotAsked,
    /// Why pictures are made on the CPU.
    None(String),
    /// It was in use and failed, for this reason.
    Lost(String),
    /// The adapter that is software, used only where it is asked for.
    Slower(String),
    Open(Box<OnDevice>),
}

struct OnDevice {
    gpu: Gpu,
    /// For the object above, with the BRDF that it shades with.
    renderer: Option<(GpuRenderer, Arc<EffectiveBrdf>)>,
}

/// A tile with the materials of its slots, for pictures so close that it shows.
pub type Close = (CloseUp, (Vec<usize>, Vec<SumMaterial>));

/// How a picture is made.
pub struct Shot<'a> {
    pub camera: &'a Camera,
    pub outcome: &'a Outcome,
    pub size: [usize; 2],
    pub samples_per_side: usize,
    /// Whether a shadow cache may be made: it takes longer than a draft and pays when the camera moves on.
    pub settle: bool,
    /// `auto`, `gpu` or `cpu`.
    pub backend: &'a str,
}

impl Studio {
    /// Takes the scene's object and lights over where they changed.
    pub fn prepare(&mut self, loaded: &LoadedScene) -> Result<()> {
        let shadow = loaded.scene.effects.self_shadow;
        let key = (loaded.scene.object.clone(), loaded.base_dir.clone(), shadow);
        if self.object.as_ref().is_none_or(|object| object.key != key) {
            let mesh = Arc::new(objects::build(&key.0, &key.1)?);
            let occluder = match key.2 {
                Switch::Off => None,
                Switch::On => Some(Occluder::always(&mesh)),
                Switch::Auto => Occluder::of(&mesh),
            };
            self.object = Some(Object { key, mesh, occluder });
            self.lights = None;
            self.shadows = None;
            if let Device::Open(device) = &mut self.gpu {
                device.renderer = None;
            }
        }
        let key = (loaded.scene.light.environment.clone(), loaded.base_dir.clone());
        if self.environment.as_ref().is_none_or(|(last, _)| *last != key) {
            let environment = environment::load(&key.0, &key.1)?;
            self.environment = Some((key, environment));
            self.lights = None;
        }
        let key = (loaded.scene.light.clone(), loaded.base_dir.clone(), loaded.scene.effects.faint_lights);
        if self.lights.as_ref().is_none_or(|(last, _)| *last != key)
            && let Some((_, environment)) = &self.environment
        {
            let mut lights = lights::of_environment(&key.0, environment.clone());
            if let (true, Some(object)) = (key.2 != Switch::On, &self.object) {
                lights.directional = worth_shading(&object.mesh, &lights.directional);
            }
            self.lights = Some((key, lights));
            self.shadows = None;
        }
        Ok(())
    }

    /// Notes about the object and the lights that a person should read.
    pub fn warnings(&self) -> Vec<String> {
        let of_object = self.object.iter().flat_map(|object| &object.mesh.warnings);
        of_object.chain(self.lights.iter().flat_map(|(_, lights)| &lights.warnings)).cloned().collect()
    }

    /// The object and its lights, for whoever asks what is where.
    pub fn set(&self) -> Option<(Arc<ObjectMesh>, Arc<Vec<DirectionalLight>>)> {
        let lights = self.lights.as_ref().map(|(_, lights)| Arc::new(lights.directional.clone()))?;
        Some((self.object.as_ref()?.mesh.clone(), lights))
    }

    /// How far the camera is from the object, in radii, automatic framing resolved.
    pub fn distance(&self, camera: &Camera, size: [usize; 2]) -> f32 {
        let of = |object: &Object| {
            let view = CameraView::new(camera, &object.mesh, size).ok()?;
            Some((view.eye - object.mesh.bounds.center).dot(view.back) / object.mesh.bounds.radius)
        };
        self.object.as_ref().and_then(of).unwrap_or(4.0)
    }

    /// One picture of what was prepared, and the milliseconds that the table it reads took.
    ///
    /// # Errors
    /// A camera that cannot be, or [`Error::Cancelled`].
    pub fn shoot(&mut self, shot: &Shot, close: Option<&Close>, cancel: &Cancel) -> Result<(Rendered, f64)> {
        let (Some(object), Some((_, lights))) = (&self.object, &self.lights) else {
            return Err(Error::failed("nothing was prepared"));
        };
        let directional = &lights.directional;
        if shot.settle
            && self.shadows.is_none()
            && let Some(occluder) = &object.occluder
            && !directional.is_empty()
        {
            self.shadows = Some(occluder.cache(&object.mesh, directional));
            cancel.check()?;
        }
        let occluder = object.occluder.as_ref().filter(|_| !directional.is_empty());
        let reflectance = Cancellable { brdf: &shot.outcome.brdf, cancel };
        let mut table_ms = 0.0;
        let input = RenderInput {
            mesh: &object.mesh,
            occluder,
            shadow_cache: self.shadows.as_ref(),
            lights: directional,
            camera: shot.camera,
            reflectance: &reflectance,
            size: shot.size,
            samples_per_side: shot.samples_per_side,
            background: &Background::default(),
        };
        let mut rendered = match self.gpu.shoot(&input, shot, &mut table_ms, cancel)? {
            Some(rendered) => rendered,
            None => {
                let pictured = shot.outcome.for_pictures(cancel)?;
                table_ms += pictured.ms;
                let reflectance = Cancellable { brdf: &pictured.brdf, cancel };
                render(&RenderInput { reflectance: &reflectance, ..input })?
            }
        };
        cancel.check()?;
        if let Some((tile, assigned)) = close {
            let start = Instant::now();
            let wearing = Wearing { material_of_slot: &assigned.0, materials: &assigned.1 };
            tile.blend_into(&mut rendered.picture, &input, wearing, cancel)?;
            rendered.times.shading_ms += start.elapsed().as_secs_f64() * 1e3;
        }
        Ok((rendered, table_ms))
    }

    /// Whether a picture is so close that the tiles themselves show.
    pub fn is_close(&self, camera: &Camera, size: [usize; 2]) -> bool {
        let of = |object: &Object| {
            CameraView::new(camera, &object.mesh, size).is_ok_and(|view| on_object::shows(&view, &object.mesh))
        };
        self.object.as_ref().is_some_and(of)
    }

    /// What became of a device that failed while it was in use.
    pub fn trouble(&self) -> Option<String> {
        match &self.gpu {
            Device::Lost(why) => Some(why.clone()),
            _ => None,
        }
    }

    /// There is only this adapter, which is software: it is not opened to find that out.
    pub fn leave_out(&mut self, name: &str) {
        if matches!(self.gpu, Device::NotAsked) {
            self.gpu = Device::Slower(name.to_owned());
        }
    }

    /// Where pictures are made, in words.
    pub fn device(&self) -> String {
        match &self.gpu {
            Device::NotAsked => "CPU".to_owned(),
            Device::Slower(name) => format!("CPU ({name} would be slower)"),
            Device::None(why) => format!("CPU ({why})"),
            Device::Lost(_) => "CPU (the graphics device failed)".to_owned(),
            Device::Open(device) if device.renderer.is_some() => device.gpu.description(),
            Device::Open(device) => format!("CPU, beside {}", device.gpu.description()),
        }
    }
}

/// Tests set it: the next picture on a device finds it lost.
#[cfg(test)]
pub static LOSE_DEVICE: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(false);

impl Device {
    /// A picture on the device; `None` where the CPU is to make it. What fails here fails for good.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    fn shoot(
        &mut self,
        input: &RenderInput,
        shot: &Shot,
        table_ms: &mut f64,
        cancel: &Cancel,
    ) -> Result<Option<Rendered>> {
        if shot.backend == "cpu" {
            *self = Self::NotAsked;
            return Ok(None);
        }
        if matches!(self, Self::NotAsked) || matches!(self, Self::Slower(_)) && shot.backend == "gpu" {
            *self = match Gpu::open() {
                // The processor in disguise is slower than our own routes: it is not kept open.
                Ok(gpu) if gpu.tier != Tier::Hardware && shot.backend != "gpu" => Self::Slower(gpu.adapter.name),
                Ok(gpu) => Self::Open(Box::new(OnDevice { gpu, renderer: None })),
                Err(_) => Self::None("no graphics adapter".to_owned()),
            };
        }
        let Self::Open(device) = self else { return Ok(None) };
        #[cfg(test)]
        if LOSE_DEVICE.swap(false, std::sync::atomic::Ordering::SeqCst) {
            device.gpu.device.destroy();
        }
        let rendered = device.wear(input, shot, table_ms, cancel).and_then(|worn| match &device.renderer {
            Some((renderer, _)) if worn => renderer.render(&device.gpu, input, cancel).map(Some),
            _ => Ok(None),
        });
        match rendered {
            Ok(rendered) => Ok(rendered),
            Err(Error::Cancelled) => Err(Error::Cancelled),
            Err(Error::Input(_)) => Ok(None),
            Err(error) => {
                *self = Self::Lost(error.to_string());
                Ok(None)
            }
        }
    }
}

impl OnDevice {
    /// Takes the material over, as a table where that is there or pays, else as sums; whether the device shades it.
    fn wear(&mut self, input: &RenderInput, shot: &Shot, table_ms: &mut f64, cancel: &Cancel) -> Result<bool> {
        let exact = &shot.outcome.brdf;
        // A graphics processor has a draft's sums done before the CPU has a table.
        let pictured = match shot.outcome.pictured() {
            None if self.gpu.tier == Tier::Software || shot.settle => {
                let pictured = shot.outcome.for_pictures(cancel)?;
                *table_ms += pictured.ms;
                Some(pictured.brdf)
            }
            known => known,
        };
        // The processor in disguise is not asked for sums where the processor itself reads a table.
        let sums = Some(exact).filter(|_| self.gpu.tier == Tier::Hardware || pictured.is_none());
        for brdf in pictured.iter().chain(sums) {
            let made = match &mut self.renderer {
                Some((_, last)) if Arc::ptr_eq(last, brdf) => Ok(()),
                Some((renderer, last)) => renderer.set_brdf(&self.gpu, brdf).map(|()| *last = brdf.clone()),
                none => GpuRenderer::new(&self.gpu, input.mesh, input.occluder, brdf)
                    .map(|renderer| *none = Some((renderer, brdf.clone()))),
            };
            match made {
                Err(GpuError::Unsupported(_)) => {}
                made => return made.map(|()| true).map_err(Error::from),
            }
        }
        self.renderer = None;
        Ok(false)
    }
}

/// Answers nothing once it is cancelled, so that the picture ends soon; it is thrown away then.
struct Cancellable<'a> {
    brdf: &'a EffectiveBrdf,
    cancel: &'a Cancel,
}

impl Reflectance for Cancellable<'_> {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        if !self.cancel.is_set() {
            self.brdf.eval_lights(lights, o, out);
        }
    }
}
