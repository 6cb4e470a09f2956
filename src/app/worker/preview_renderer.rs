//! Rendering of preview images. The renderer caches the object, lights, shadows and GPU state, and recomputes each only
//! when its input changes.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use crate::base::{Cancel, Error, Result};
use crate::brdf::MaterialAssignment;
use crate::effective::{Black, EffectiveBrdf, Reflectance};
use crate::pipeline::{GpuTile, Outcome};
use crate::render::image::render::RenderTimes;
use crate::render::image::shading::Background;
use crate::render::image::tone_map::ToneMap;
use crate::render::lighting::environment::Environment;
use crate::render::lighting::light_selection::significant_lights;
use crate::render::lighting::lights::Lights;
use crate::render::lighting::{environment, lights};
use crate::render::render;
use crate::render::shadow::Occluder;
use crate::render::shadow::shadow_cache::ShadowCache;
use crate::render::tile_view::{ShadedMaterials, TileScene, on_object};
use crate::render::{CameraView, DirectionalLight, ObjectMesh, RenderInput, Rendered, object};
use crate::scene;
use crate::scene::{Camera, LoadedScene, Switch};
use glam::Vec3;

use super::gpu_state::{GpuState, PreviewInput};
use super::screen::{GpuImage, ImagePool, Screen};

/// The object, lights and shadows of a scene, ready to be shaded.
#[derive(Default)]
pub struct PreviewRenderer {
    object: Option<Object>,
    environment: Option<((String, PathBuf), Environment)>,
    lights: Option<((scene::Light, PathBuf, Switch), Lights)>,
    /// Belongs to the object and the lights above.
    shadows: Option<ShadowCache>,
    gpu: GpuState,
    screen: Option<Screen>,
    images: ImagePool,
}

struct Object {
    /// The last part is the setting that forces shadows on or off.
    key: (scene::Object, PathBuf, Switch),
    mesh: Arc<ObjectMesh>,
    occluder: Option<Occluder>,
}

/// An image on the window's GPU.
pub struct GpuPreview {
    pub image: Arc<GpuImage>,
    pub times: RenderTimes,
    /// Milliseconds spent on the shading table.
    pub table_ms: f64,
}

/// A tile with the materials of its slots, for images in which the tile itself is visible.
pub type CloseUpTile = (TileScene, MaterialAssignment);

/// Material of the object.
#[derive(Clone, Copy)]
pub enum ShadedMaterial<'a> {
    Outcome(&'a Outcome),
    /// A tile whose visibility and facet sum the GPU computes.
    GpuTile(&'a Arc<GpuTile>),
}

/// Settings of one image.
pub struct RenderRequest<'a> {
    pub camera: &'a Camera,
    pub material: ShadedMaterial<'a>,
    pub size: [usize; 2],
    pub samples_per_side: usize,
    /// Allows building a shadow cache, which takes longer than a draft and pays off when the camera moves.
    pub build_caches: bool,
    /// `auto`, `gpu` or `cpu`.
    pub backend: &'a str,
}

impl PreviewRenderer {
    /// Rebuilds the object and the lights if the scene changed them.
    pub fn prepare(&mut self, loaded: &LoadedScene) -> Result<()> {
        let shadow = loaded.scene.effects.self_shadow;
        let key = (loaded.scene.object.clone(), loaded.base_dir.clone(), shadow);
        if self.object.as_ref().is_none_or(|object| object.key != key) {
            let mesh = Arc::new(object::build(&key.0, &key.1)?);
            let occluder = match key.2 {
                Switch::Off => None,
                Switch::On => Some(Occluder::new(&mesh)),
                Switch::Auto => Occluder::if_needed(&mesh),
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
            let mut lights = lights::from_environment(&key.0, environment.clone());
            if let (true, Some(object)) = (key.2 != Switch::On, &self.object) {
                lights.directional = significant_lights(&object.mesh, &lights.directional);
            }
            self.lights = Some((key, lights));
            self.shadows = None;
        }
        Ok(())
    }

    /// Warnings about the object and the lights.
    pub fn warnings(&self) -> Vec<String> {
        let of_object = self.object.iter().flat_map(|object| &object.mesh.warnings);
        of_object.chain(self.lights.iter().flat_map(|(_, lights)| &lights.warnings)).cloned().collect()
    }

    /// The object and its lights, for picking.
    pub fn lit_object(&self) -> Option<(Arc<ObjectMesh>, Arc<Vec<DirectionalLight>>)> {
        let lights = self.lights.as_ref().map(|(_, lights)| Arc::new(lights.directional.clone()))?;
        Some((self.object.as_ref()?.mesh.clone(), lights))
    }

    /// Distance from the camera to the object in the object's radii, with automatic framing resolved.
    pub fn distance(&self, camera: &Camera, size: [usize; 2]) -> f32 {
        let of = |object: &Object| {
            let view = CameraView::new(camera, &object.mesh, size).ok()?;
            Some((view.eye - object.mesh.bounds.center).dot(view.back) / object.mesh.bounds.radius)
        };
        self.object.as_ref().and_then(of).unwrap_or(4.0)
    }

    /// Sets the GPU on which the window draws.
    pub fn set_screen(&mut self, screen: Option<&Screen>) {
        self.screen = screen.cloned();
        // The window's GPU displays images without reading them back, so it replaces a separately opened one.
        if let (Some(screen), GpuState::Open(open)) = (screen, &self.gpu)
            && !open.is_on(screen)
            && screen.is_hardware
        {
            self.gpu = GpuState::Unopened;
        }
    }

    /// Renders the prepared scene to an image on the window's GPU; `None` if that GPU cannot render it.
    ///
    /// # Errors
    /// An invalid camera, or [`Error::Cancelled`].
    pub fn render_to_screen(
        &mut self,
        request: &RenderRequest,
        tone_map: &ToneMap,
        cancel: &Cancel,
    ) -> Result<Option<GpuPreview>> {
        let (Some(object), Some((_, lights)), Some(screen)) = (&self.object, &self.lights, &self.screen) else {
            return Ok(None);
        };
        let occluder = object.occluder.as_ref();
        let preview_input = PreviewInput { mesh: &object.mesh, occluder, request, screen: Some(screen) };
        let background = Background::default();
        let input = render_input(object, lights, request, &Black, &background);
        let images = &mut self.images;
        let shown = self.gpu.run(preview_input, cancel, |renderer, gpu| {
            if !std::ptr::eq(gpu, &*screen.gpu) {
                return Ok(None);
            }
            let image = images.next(screen, request.size)?;
            let times = renderer.show(gpu, &input, tone_map, &image.view, cancel)?;
            Ok(Some((image, times)))
        })?;
        let preview =
            |(shown, table_ms): (Option<_>, f64)| shown.map(|(image, times)| GpuPreview { image, times, table_ms });
        Ok(shown.and_then(preview))
    }

    /// Renders the prepared scene; also returns the milliseconds spent on the shading table.
    ///
    /// # Errors
    /// An invalid camera, or [`Error::Cancelled`].
    pub fn render(
        &mut self,
        request: &RenderRequest,
        close: Option<&CloseUpTile>,
        cancel: &Cancel,
    ) -> Result<(Rendered, f64)> {
        let (Some(object), Some((_, lights)), ShadedMaterial::Outcome(outcome)) =
            (&self.object, &self.lights, request.material)
        else {
            return Err(Error::failed("nothing was prepared"));
        };
        let (occluder, background) = (object.occluder.as_ref(), Background::default());
        let preview_input = PreviewInput { mesh: &object.mesh, occluder, request, screen: self.screen.as_ref() };
        let exact = Cancellable { brdf: &outcome.brdf, cancel };
        let input = render_input(object, lights, request, &exact, &background);
        let on_gpu = self.gpu.run(preview_input, cancel, |renderer, gpu| renderer.render(gpu, &input, cancel))?;
        let (mut rendered, table_ms) = match on_gpu {
            Some(rendered) => rendered,
            None => {
                if let (true, None, Some(occluder)) = (request.build_caches, &self.shadows, input.occluder) {
                    self.shadows = Some(occluder.cache(&object.mesh, &lights.directional));
                    cancel.check()?;
                }
                let shading_brdf = outcome.shading_brdf(cancel)?;
                let reflectance = Cancellable { brdf: &shading_brdf.brdf, cancel };
                let shadow_cache = self.shadows.as_ref();
                (render(&RenderInput { reflectance: &reflectance, shadow_cache, ..input })?, shading_brdf.ms)
            }
        };
        cancel.check()?;
        if let Some((tile, assignment)) = close {
            let start = Instant::now();
            let materials =
                ShadedMaterials { material_of_slot: &assignment.material_of_slot, materials: &assignment.materials };
            let shadow_cache = self.shadows.as_ref();
            tile.blend_into(&mut rendered.image, &RenderInput { shadow_cache, ..input }, materials, cancel)?;
            rendered.times.shading_ms += start.elapsed().as_secs_f64() * 1e3;
        }
        Ok((rendered, table_ms))
    }

    /// Returns true if the camera is so close that the tiles themselves are visible.
    pub fn is_close(&self, camera: &Camera, size: [usize; 2]) -> bool {
        let of = |object: &Object| {
            CameraView::new(camera, &object.mesh, size)
                .is_ok_and(|view| on_object::tiles_are_visible(&view, &object.mesh))
        };
        self.object.as_ref().is_some_and(of)
    }

    /// Returns true if images are rendered on a hardware GPU.
    pub fn is_hardware(&self) -> bool {
        self.gpu.is_hardware()
    }

    /// Reason why the GPU failed while it was in use.
    pub fn gpu_error(&self) -> Option<String> {
        self.gpu.gpu_error()
    }

    /// Records that the only adapter is this software adapter, so that it is not opened.
    pub fn exclude_software(&mut self, name: &str) {
        self.gpu.exclude_software(name);
    }

    /// Description of the processor that renders images.
    pub fn rendered_on(&self) -> String {
        self.gpu.describe()
    }
}

/// Collects the inputs of an image. Without directional lights there are no shadows.
fn render_input<'a>(
    object: &'a Object,
    lights: &'a Lights,
    request: &'a RenderRequest,
    reflectance: &'a dyn Reflectance,
    background: &'a Background,
) -> RenderInput<'a> {
    RenderInput {
        mesh: &object.mesh,
        occluder: object.occluder.as_ref().filter(|_| !lights.directional.is_empty()),
        shadow_cache: None,
        lights: &lights.directional,
        camera: request.camera,
        reflectance,
        size: request.size,
        samples_per_side: request.samples_per_side,
        background,
    }
}

/// A BRDF that returns at once after a cancel, so that rendering ends soon; the image is then discarded.
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
