//! What stays between pictures: the object, its lights and shadows, the device. Each is made anew only when its input
//! changed.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use crate::base::{Cancel, Error, Result};
use crate::effective::{Black, EffectiveBrdf, Material, Reflectance};
use crate::pipeline::{GpuTile, Outcome};
use crate::render::image::render::RenderTimes;
use crate::render::image::shading::Background;
use crate::render::image::tone_map::ToneMap;
use crate::render::lighting::environment::Environment;
use crate::render::lighting::light_choice::worth_shading;
use crate::render::lighting::lights::Lights;
use crate::render::lighting::{environment, lights};
use crate::render::render;
use crate::render::shadow::Occluder;
use crate::render::shadow::shadow_cache::ShadowCache;
use crate::render::tile_view::{CloseUp, ShadedMaterials, on_object};
use crate::render::{CameraView, DirectionalLight, ObjectMesh, RenderInput, Rendered, object};
use crate::scene;
use crate::scene::{Camera, LoadedScene, Switch};
use glam::Vec3;

use super::device::{Device, Subject};
use super::screen::{DeviceImage, Screen, Turns};

/// The large scale of a scene, ready to be shaded.
#[derive(Default)]
pub struct ImageStudio {
    object: Option<Object>,
    environment: Option<((String, PathBuf), Environment)>,
    lights: Option<((scene::Light, PathBuf, Switch), Lights)>,
    /// For the object and the lights above.
    shadows: Option<ShadowCache>,
    gpu: Device,
    screen: Option<Screen>,
    images: Turns,
}

struct Object {
    /// With whether its shadows are forced.
    key: (scene::Object, PathBuf, Switch),
    mesh: Arc<ObjectMesh>,
    occluder: Option<Occluder>,
}

/// A picture that is on the window's device.
pub struct Shown {
    pub image: Arc<DeviceImage>,
    pub times: RenderTimes,
    /// What the table took that it reads.
    pub table_ms: f64,
}

/// A tile with the materials of its slots, for pictures so close that it shows.
pub type Close = (CloseUp, (Vec<usize>, Vec<Material>));

/// What the object wears.
#[derive(Clone, Copy)]
pub enum Worn<'a> {
    Known(&'a Outcome),
    /// A tile whose visibility and product the device makes.
    GpuTile(&'a Arc<GpuTile>),
}

/// How a picture is made.
pub struct Shot<'a> {
    pub camera: &'a Camera,
    pub material: Worn<'a>,
    pub size: [usize; 2],
    pub samples_per_side: usize,
    /// Whether a shadow cache may be made: it takes longer than a draft and pays when the camera moves on.
    pub settle: bool,
    /// `auto`, `gpu` or `cpu`.
    pub backend: &'a str,
}

impl ImageStudio {
    /// Takes the scene's object and lights over where they changed.
    pub fn prepare(&mut self, loaded: &LoadedScene) -> Result<()> {
        let shadow = loaded.scene.effects.self_shadow;
        let key = (loaded.scene.object.clone(), loaded.base_dir.clone(), shadow);
        if self.object.as_ref().is_none_or(|object| object.key != key) {
            let mesh = Arc::new(object::build(&key.0, &key.1)?);
            let occluder = match key.2 {
                Switch::Off => None,
                Switch::On => Some(Occluder::always(&mesh)),
                Switch::Auto => Occluder::of(&mesh),
            };
            self.object = Some(Object { key, mesh, occluder });
            self.lights = None;
            self.shadows = None;
            self.gpu.forget_object();
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

    /// What the window draws on.
    pub fn show_on(&mut self, screen: Option<&Screen>) {
        self.screen = screen.cloned();
        // A device of its own gives way to the window's, which shows without reading back.
        if let (Some(screen), Device::Open(device)) = (screen, &self.gpu)
            && !device.is_of(screen)
            && screen.is_fast
        {
            self.gpu = Device::NotAsked;
        }
    }

    /// A picture of what was prepared as an image on the window's device; `None` where that cannot make it.
    ///
    /// # Errors
    /// A camera that cannot be, or [`Error::Cancelled`].
    pub fn show(&mut self, shot: &Shot, tone_map: &ToneMap, cancel: &Cancel) -> Result<Option<Shown>> {
        let (Some(object), Some((_, lights)), Some(screen)) = (&self.object, &self.lights, &self.screen) else {
            return Ok(None);
        };
        let subject = Subject { mesh: &object.mesh, occluder: object.occluder.as_ref(), shot, screen: Some(screen) };
        let background = Background::default();
        let input = input(object, lights, shot, &Black, &background);
        let images = &mut self.images;
        let shown = self.gpu.run(subject, cancel, |renderer, gpu| {
            if !std::ptr::eq(gpu, &*screen.gpu) {
                return Ok(None);
            }
            let image = images.next(screen, shot.size)?;
            let times = renderer.show(gpu, &input, tone_map, &image.view, cancel)?;
            Ok(Some((image, times)))
        })?;
        let made = |(shown, table_ms): (Option<_>, f64)| shown.map(|(image, times)| Shown { image, times, table_ms });
        Ok(shown.and_then(made))
    }

    /// One picture of what was prepared, and the milliseconds that the table it reads took.
    ///
    /// # Errors
    /// A camera that cannot be, or [`Error::Cancelled`].
    pub fn shoot(&mut self, shot: &Shot, close: Option<&Close>, cancel: &Cancel) -> Result<(Rendered, f64)> {
        let (Some(object), Some((_, lights)), Worn::Known(outcome)) = (&self.object, &self.lights, shot.material)
        else {
            return Err(Error::failed("nothing was prepared"));
        };
        let (occluder, background) = (object.occluder.as_ref(), Background::default());
        let subject = Subject { mesh: &object.mesh, occluder, shot, screen: self.screen.as_ref() };
        let exact = Cancellable { brdf: &outcome.brdf, cancel };
        let seen = input(object, lights, shot, &exact, &background);
        let on_device = self.gpu.run(subject, cancel, |renderer, gpu| renderer.render(gpu, &seen, cancel))?;
        let (mut rendered, table_ms) = match on_device {
            Some(rendered) => rendered,
            None => {
                if let (true, None, Some(occluder)) = (shot.settle, &self.shadows, seen.occluder) {
                    self.shadows = Some(occluder.cache(&object.mesh, &lights.directional));
                    cancel.check()?;
                }
                let shading_brdf = outcome.shading_brdf(cancel)?;
                let reflectance = Cancellable { brdf: &shading_brdf.brdf, cancel };
                let shadow_cache = self.shadows.as_ref();
                (render(&RenderInput { reflectance: &reflectance, shadow_cache, ..seen })?, shading_brdf.ms)
            }
        };
        cancel.check()?;
        if let Some((tile, assigned)) = close {
            let start = Instant::now();
            let wearing = ShadedMaterials { material_of_slot: &assigned.0, materials: &assigned.1 };
            let shadow_cache = self.shadows.as_ref();
            tile.blend_into(&mut rendered.image, &RenderInput { shadow_cache, ..seen }, wearing, cancel)?;
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

    /// Whether pictures are made on a graphics processor.
    pub fn is_fast(&self) -> bool {
        self.gpu.is_fast()
    }

    /// What became of a device that failed while it was in use.
    pub fn trouble(&self) -> Option<String> {
        self.gpu.trouble()
    }

    /// There is only this adapter, which is software: it is not opened to find that out.
    pub fn leave_out(&mut self, name: &str) {
        self.gpu.leave_out(name);
    }

    /// Where pictures are made, in words.
    pub fn device(&self) -> String {
        self.gpu.describe()
    }
}

/// All that a picture depends on; shadows only where there is light to cast them.
fn input<'a>(
    object: &'a Object,
    lights: &'a Lights,
    shot: &'a Shot,
    reflectance: &'a dyn Reflectance,
    background: &'a Background,
) -> RenderInput<'a> {
    RenderInput {
        mesh: &object.mesh,
        occluder: object.occluder.as_ref().filter(|_| !lights.directional.is_empty()),
        shadow_cache: None,
        lights: &lights.directional,
        camera: shot.camera,
        reflectance,
        size: shot.size,
        samples_per_side: shot.samples_per_side,
        background,
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
