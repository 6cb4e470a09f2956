//! The large scale of a scene, ready to be rendered with any material.

use super::image::shading::Background;
use super::lighting::light_selection::significant_lights;
use super::lighting::lights;
use super::lighting::lights::Lights;
use super::shadow::Occluder;
use super::shadow::shadow_cache::ShadowCache;
use super::{ObjectMesh, RenderInput, object};
use crate::base::Result;
use crate::effective::Reflectance;
use crate::scene::{Camera, LoadedScene, Switch};

/// Object, lights, shadows and camera of a scene. Images of several materials share it.
pub struct RenderScene {
    pub mesh: ObjectMesh,
    /// `None` if self-shadowing is off or impossible.
    pub occluder: Option<Occluder>,
    pub lights: Lights,
    /// Number of lights left out because no part of the object faces them or because they are too faint.
    pub dropped_lights: usize,
    pub camera: Camera,
    shadow_cache: Option<ShadowCache>,
}

impl RenderScene {
    /// Builds the object and the lights of a scene.
    ///
    /// # Errors
    /// An object or an environment that cannot be used.
    pub fn new(loaded: &LoadedScene) -> Result<Self> {
        let mesh = object::build(&loaded.scene.object, &loaded.base_dir)?;
        let mut lights = lights::build(&loaded.scene.light, &loaded.base_dir)?;
        let effects = &loaded.scene.effects;
        let total_lights = lights.directional.len();
        if effects.faint_lights != Switch::On {
            lights.directional = significant_lights(&mesh, &lights.directional);
        }
        let dropped_lights = total_lights - lights.directional.len();
        let occluder = match effects.self_shadow {
            Switch::Off => None,
            _ if lights.directional.is_empty() => None,
            Switch::On => Some(Occluder::new(&mesh)),
            Switch::Auto => Occluder::if_needed(&mesh),
        };
        Ok(Self {
            mesh,
            occluder,
            lights,
            dropped_lights,
            camera: loaded.scene.camera.clone().unwrap_or_default(),
            shadow_cache: None,
        })
    }

    /// Computes the shadow cache. It saves time if several images follow, or if an image has more shading points than
    /// the object has vertices.
    pub fn cache_shadows(&mut self) {
        let cache = |occluder: &Occluder| occluder.cache(&self.mesh, &self.lights.directional);
        self.shadow_cache = self.occluder.as_ref().map(cache);
    }

    /// Collects the input of [`super::render`] for one material; `size` is in pixels.
    pub fn input<'a>(
        &'a self,
        reflectance: &'a dyn Reflectance,
        size: [usize; 2],
        samples_per_side: usize,
        background: &'a Background,
    ) -> RenderInput<'a> {
        RenderInput {
            mesh: &self.mesh,
            occluder: self.occluder.as_ref(),
            shadow_cache: self.shadow_cache.as_ref(),
            lights: &self.lights.directional,
            camera: &self.camera,
            reflectance,
            size,
            samples_per_side,
            background,
        }
    }
}
