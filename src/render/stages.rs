//! The stages of a render scene: object, environment, lights, and the shadows of the object on itself.

use super::ObjectMesh;
use super::lighting::environment::{self, Environment};
use super::lighting::light_selection::significant_lights;
use super::lighting::lights::{self, Lights};
use super::object;
use super::shadow::Occluder;
use super::shadow::shadow_cache::ShadowCache;
use crate::base::Result;
use crate::cache::{Key, KeyBuilder};
use crate::pipeline::{Env, Keyed, Pipeline, Stage};
use crate::scene::{LoadedScene, Switch};

/// An object and the hierarchy of its triangles that shadow rays need.
#[derive(Debug)]
pub struct RenderObject {
    pub mesh: ObjectMesh,
    /// `None` if self-shadowing is off or impossible.
    pub occluder: Option<Occluder>,
}

/// Builds the object of a scene.
pub struct BuildObject<'a> {
    loaded: &'a LoadedScene,
    file: Option<Key>,
}

impl<'a> BuildObject<'a> {
    pub fn new(loaded: &'a LoadedScene, pipeline: &Pipeline) -> Self {
        let path = loaded.scene.object.path.as_ref();
        Self { loaded, file: path.map(|path| pipeline.file_key(&loaded.base_dir, path)) }
    }
}

impl Stage for BuildObject<'_> {
    type Output = RenderObject;
    const NAME: &'static str = "object";
    const IGNORES_CANCEL: bool = true;

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.debug("object", &self.loaded.scene.object).debug("shadows", &self.loaded.scene.effects.self_shadow);
        if let Some(file) = &self.file {
            key.key("file", file);
        }
    }

    fn run(&self, _: &Env) -> Result<RenderObject> {
        let mesh = object::build(&self.loaded.scene.object, &self.loaded.base_dir)?;
        let occluder = match self.loaded.scene.effects.self_shadow {
            Switch::Off => None,
            Switch::On => Some(Occluder::new(&mesh)),
            Switch::Auto => Occluder::if_needed(&mesh),
        };
        Ok(RenderObject { mesh, occluder })
    }
}

/// Loads the environment of a scene.
pub struct LoadEnvironment<'a> {
    loaded: &'a LoadedScene,
    file: Key,
}

impl<'a> LoadEnvironment<'a> {
    pub fn new(loaded: &'a LoadedScene, pipeline: &Pipeline) -> Self {
        let path = loaded.scene.light.environment.as_ref();
        Self { loaded, file: pipeline.file_key(&loaded.base_dir, path) }
    }
}

impl Stage for LoadEnvironment<'_> {
    type Output = Environment;
    const NAME: &'static str = "environment";
    const IGNORES_CANCEL: bool = true;

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.debug("name", &self.loaded.scene.light.environment).key("file", &self.file);
    }

    fn run(&self, _: &Env) -> Result<Environment> {
        environment::load(&self.loaded.scene.light.environment, &self.loaded.base_dir)
    }
}

/// Splits the environment into directional lights and selects those that can change an image of the object.
pub struct PlaceLights<'a> {
    pub loaded: &'a LoadedScene,
    pub object: &'a Keyed<RenderObject>,
    pub environment: &'a Keyed<Environment>,
}

/// The lights of a scene, and the number of those that were left out.
#[derive(Debug)]
pub struct PlacedLights {
    pub lights: Lights,
    pub dropped: usize,
}

impl Stage for PlaceLights<'_> {
    type Output = PlacedLights;
    const NAME: &'static str = "lights";
    const IGNORES_CANCEL: bool = true;

    fn hash_into(&self, key: &mut KeyBuilder) {
        let scene = &self.loaded.scene;
        key.key("object", &self.object.key).key("environment", &self.environment.key);
        key.debug("light", &scene.light).debug("faint", &scene.effects.faint_lights);
    }

    fn run(&self, _: &Env) -> Result<PlacedLights> {
        let scene = &self.loaded.scene;
        lights::check(&scene.light)?;
        let mut lights = lights::from_environment(&scene.light, self.environment.value.as_ref().clone());
        let all = lights.directional.len();
        if scene.effects.faint_lights != Switch::On {
            lights.directional = significant_lights(&self.object.mesh, &lights.directional);
        }
        let dropped = all - lights.directional.len();
        Ok(PlacedLights { lights, dropped })
    }
}

/// Computes which lights each vertex of the object sees.
pub struct BuildShadowCache<'a> {
    pub object: &'a Keyed<RenderObject>,
    pub lights: &'a Keyed<PlacedLights>,
}

impl Stage for BuildShadowCache<'_> {
    type Output = Option<ShadowCache>;
    const NAME: &'static str = "shadow_cache";
    const IGNORES_CANCEL: bool = true;

    fn hash_into(&self, key: &mut KeyBuilder) {
        key.key("object", &self.object.key).key("lights", &self.lights.key);
    }

    fn run(&self, _: &Env) -> Result<Option<ShadowCache>> {
        let RenderObject { mesh, occluder } = &**self.object;
        let lights = &self.lights.lights.directional;
        Ok(occluder.as_ref().filter(|_| !lights.is_empty()).map(|occluder| occluder.cache(mesh, lights)))
    }
}
