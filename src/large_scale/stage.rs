//! What stays between pictures of a scene: the object, its lights and the camera.

use super::lights::{self, Lights};
use super::shading::Background;
use super::shadow::Occluder;
use super::{ObjectMesh, RenderInput, objects};
use crate::error::Result;
use crate::filtering::Reflectance;
use crate::scene::{Camera, LoadedScene};

/// The large scale of a scene, ready for any material.
pub struct Stage {
    pub mesh: ObjectMesh,
    /// `None` where nothing can be shadowed.
    pub occluder: Option<Occluder>,
    pub lights: Lights,
    pub camera: Camera,
}

impl Stage {
    /// # Errors
    /// An object or an environment that cannot be used.
    pub fn new(loaded: &LoadedScene) -> Result<Self> {
        let mesh = objects::build(&loaded.scene.object, &loaded.base_dir)?;
        let lights = lights::build(&loaded.scene.light, &loaded.base_dir)?;
        let occluder = if lights.directional.is_empty() { None } else { Occluder::of(&mesh) };
        Ok(Self { mesh, occluder, lights, camera: loaded.scene.camera.clone().unwrap_or_default() })
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
            shadow_cache: None,
            lights: &self.lights.directional,
            camera: &self.camera,
            reflectance,
            size,
            samples_per_side,
            background,
        }
    }
}
