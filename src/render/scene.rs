//! What stays between pictures of a scene: the object, its lights and the camera.

use super::image::shading::Background;
use super::lighting::light_choice::worth_shading;
use super::lighting::lights;
use super::lighting::lights::Lights;
use super::shadow::Occluder;
use super::shadow::shadow_cache::ShadowCache;
use super::{ObjectMesh, RenderInput, object};
use crate::base::Result;
use crate::effective::Reflectance;
use crate::scene::{Camera, LoadedScene, Switch};

/// The large scale of a scene, ready for any material.
pub struct RenderScene {
    pub mesh: ObjectMesh,
    /// `None` where nothing can be shadowed.
    pub occluder: Option<Occluder>,
    pub lights: Lights,
    /// Lights left out: nothing faces them, or they are too faint to be seen.
    pub dropped_lights: usize,
    pub camera: Camera,
    shadows: Option<ShadowCache>,
}

impl RenderScene {
    /// # Errors
    /// An object or an environment that cannot be used.
    pub fn new(loaded: &LoadedScene) -> Result<Self> {
        let mesh = object::build(&loaded.scene.object, &loaded.base_dir)?;
        let mut lights = lights::build(&loaded.scene.light, &loaded.base_dir)?;
        let effects = &loaded.scene.effects;
        let all = lights.directional.len();
        if effects.faint_lights != Switch::On {
            lights.directional = worth_shading(&mesh, &lights.directional);
        }
        let dropped_lights = all - lights.directional.len();
        let occluder = match effects.self_shadow {
            Switch::Off => None,
            _ if lights.directional.is_empty() => None,
            Switch::On => Some(Occluder::always(&mesh)),
            Switch::Auto => Occluder::of(&mesh),
        };
        Ok(Self {
            mesh,
            occluder,
            lights,
            dropped_lights,
            camera: loaded.scene.camera.clone().unwrap_or_default(),
            shadows: None,
        })
    }

    /// Makes the shadow cache: pays where the camera moves on, or where a picture has more points than the object vertices.
    pub fn settle(&mut self) {
        let cache = |occluder: &Occluder| occluder.cache(&self.mesh, &self.lights.directional);
        self.shadows = self.occluder.as_ref().map(cache);
    }

    /// All that a picture of the object in one material depends on, `size` in pixels.
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
            shadow_cache: self.shadows.as_ref(),
            lights: &self.lights.directional,
            camera: &self.camera,
            reflectance,
            size,
            samples_per_side,
            background,
        }
    }
}
