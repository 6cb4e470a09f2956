//! The large scale of a scene, ready to be rendered with any material.

use std::sync::Arc;

use super::image::shading::ImageBackground;
use super::lighting::lights::Lights;
use super::shadow::Occluder;
use super::shadow::shadow_cache::ShadowCache;
use super::stages::{BuildObject, BuildShadowCache, LoadEnvironment, PlaceLights, PlacedLights, RenderObject};
use super::{ObjectMesh, RenderInput};
use crate::base::Result;
use crate::cache::Key;
use crate::effective::Reflectance;
use crate::pipeline::{Keyed, Pipeline, StageTimes};
use crate::plan::Settings;
use crate::scene::{Camera, LoadedScene};

/// Object, lights, shadows and camera of a scene. Images of several materials share it.
#[derive(Debug, Clone)]
pub struct RenderScene {
    object: Keyed<RenderObject>,
    lights: Keyed<PlacedLights>,
    pub camera: Camera,
    shadow_cache: Option<Arc<Option<ShadowCache>>>,
    /// The tolerance of [`RenderInput`].
    tolerance: f32,
}

impl RenderScene {
    /// The render scene of a scene that is rendered once.
    ///
    /// # Errors
    /// As [`RenderScene::with`].
    pub fn new(loaded: &LoadedScene) -> Result<Self> {
        Self::with(&Pipeline::new(), loaded)
    }

    /// The render scene of a scene. Object, environment and lights are stages of the pipeline, so that an edit of the
    /// scene recomputes only what it changes.
    ///
    /// # Errors
    /// An object or an environment that cannot be used.
    pub fn with(pipeline: &Pipeline, loaded: &LoadedScene) -> Result<Self> {
        // Images report the times of their own steps.
        let times = &mut StageTimes::new();
        let object = pipeline.get(BuildObject::new(loaded, pipeline), times)?;
        let environment = pipeline.get(LoadEnvironment::new(loaded, pipeline), times)?;
        let lights = pipeline.get(PlaceLights { loaded, object: &object, environment: &environment }, times)?;
        let camera = loaded.scene.camera.clone().unwrap_or_default();
        let tolerance = Settings::of(&loaded.scene).point_tolerance();
        Ok(Self { object, lights, camera, shadow_cache: None, tolerance })
    }

    /// Computes the shadow cache. It saves time if several images follow, or if an image has more shading points than
    /// the object has vertices.
    ///
    /// # Errors
    /// [`crate::base::Error::Cancelled`].
    pub fn cache_shadows(&mut self, pipeline: &Pipeline) -> Result<()> {
        let stage = BuildShadowCache { object: &self.object, lights: &self.lights };
        self.shadow_cache = Some(pipeline.get(stage, &mut StageTimes::new())?.value);
        Ok(())
    }

    /// Takes the shadow cache of an earlier render scene with the same object and lights.
    pub fn reuse_shadows(&mut self, earlier: &Self) {
        if earlier.keys() == self.keys() {
            self.shadow_cache.clone_from(&earlier.shadow_cache);
        }
    }

    /// The key of the object, which changes with it.
    pub fn object_key(&self) -> Key {
        self.object.key
    }

    /// The keys of the object and of the lights.
    pub fn keys(&self) -> [Key; 2] {
        [self.object.key, self.lights.key]
    }

    pub fn mesh(&self) -> &ObjectMesh {
        &self.object.mesh
    }

    /// The occluder of the object; `None` if self-shadowing is off or impossible, or if there is no light.
    pub fn occluder(&self) -> Option<&Occluder> {
        self.object.occluder.as_ref().filter(|_| !self.lights().directional.is_empty())
    }

    /// The occluder of the object in any light; `None` if self-shadowing is off or impossible.
    pub fn object_occluder(&self) -> Option<&Occluder> {
        self.object.occluder.as_ref()
    }

    pub fn lights(&self) -> &Lights {
        &self.lights.lights
    }

    /// The number of lights left out because no part of the object faces them or because they are too faint.
    pub fn dropped_lights(&self) -> usize {
        self.lights.dropped
    }

    /// Warnings about the object and the lights.
    pub fn warnings(&self) -> impl Iterator<Item = &String> {
        self.mesh().warnings.iter().chain(&self.lights().warnings)
    }

    pub fn shadow_cache(&self) -> Option<&ShadowCache> {
        self.shadow_cache.as_deref().and_then(Option::as_ref)
    }

    /// Collects the input of [`super::render`] for one material; `size` is in pixels.
    pub fn input<'a>(
        &'a self,
        reflectance: &'a dyn Reflectance,
        size: [usize; 2],
        samples_per_side: usize,
        background: &'a ImageBackground,
    ) -> RenderInput<'a> {
        RenderInput {
            mesh: self.mesh(),
            occluder: self.occluder(),
            shadow_cache: self.shadow_cache(),
            lights: &self.lights().directional,
            camera: &self.camera,
            reflectance,
            size,
            samples_per_side,
            tolerance: self.tolerance,
            background,
        }
    }
}
