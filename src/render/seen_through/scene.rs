//! A scene with a slab, ready to be rendered.

use std::sync::Arc;

use super::{Backdrop, BuildBackdrop, SeenThrough, render};
use crate::base::{Cancel, Result};
use crate::pipeline::{Pipeline, SlabOutcome, StageTimes};
use crate::render::lighting::environment::Environment;
use crate::render::lighting::lights;
use crate::render::stages::LoadEnvironment;
use crate::render::{CameraView, DirectionalLight, RenderScene, Rendered};
use crate::scene::LoadedScene;
use crate::slab::{Slab, SlabView};

/// A slab and what lies behind it. Images from several cameras share it.
#[derive(Debug, Clone)]
pub struct SlabScene {
    slab: Arc<Slab>,
    view: Arc<SlabView>,
    backdrop: Arc<Backdrop>,
    /// The directional lights of the scene; the environment is part of the backdrop.
    lights: Vec<DirectionalLight>,
    /// Paths per point; 0 for drafts.
    pub paths: usize,
    seed: u64,
}

impl SlabScene {
    /// Prepares the slab of a scene for images of its object.
    ///
    /// # Errors
    /// An environment or a background that cannot be used.
    pub fn with(
        pipeline: &Pipeline,
        loaded: &LoadedScene,
        outcome: &SlabOutcome,
        render_scene: &RenderScene,
    ) -> Result<Self> {
        let light = &loaded.scene.light;
        let lights = lights::from_environment(light, Environment::default()).directional;
        Ok(Self {
            slab: outcome.slab.clone(),
            view: Arc::new(SlabView::new(outcome.slab.clone())),
            backdrop: Self::backdrop(pipeline, loaded, render_scene)?,
            lights,
            paths: outcome.settings.paths,
            seed: outcome.settings.seed,
        })
    }

    /// The backdrop behind the object of a scene.
    ///
    /// # Errors
    /// An environment or a background that cannot be used.
    pub fn backdrop(pipeline: &Pipeline, loaded: &LoadedScene, render_scene: &RenderScene) -> Result<Arc<Backdrop>> {
        let times = &mut StageTimes::new();
        let environment = pipeline.get(LoadEnvironment::new(loaded, pipeline), times)?;
        let rear = render_scene.mesh().positions.iter().map(|position| position.z).fold(f32::MAX, f32::min);
        Ok(pipeline.get(BuildBackdrop::new(loaded, pipeline, &environment, rear), times)?.value)
    }

    /// Renders the object of a scene.
    ///
    /// # Errors
    /// As [`render`].
    pub fn render(
        &self,
        render_scene: &RenderScene,
        size: [usize; 2],
        samples_per_side: usize,
        cancel: &Cancel,
    ) -> Result<Rendered> {
        render(&SeenThrough {
            mesh: render_scene.mesh(),
            camera: &render_scene.camera,
            backdrop: &self.backdrop,
            surface: &*self.view,
            reflectance: &*self.slab,
            transmittance: &*self.slab,
            lights: &self.lights,
            size,
            samples_per_side,
            paths: self.paths,
            seed: self.seed,
            cancel: cancel.clone(),
        })
    }

    /// The slab as a viewer sees it.
    pub fn view(&self) -> &SlabView {
        &self.view
    }

    /// Warnings about what lies behind the object.
    ///
    /// # Errors
    /// A camera that cannot frame the object.
    pub fn warnings(&self, render_scene: &RenderScene) -> Result<Vec<String>> {
        let Some(plane) = &self.backdrop.plane else { return Ok(Vec::new()) };
        let view = CameraView::new(&render_scene.camera, render_scene.mesh(), [1, 1])?;
        if view.eye.z > plane.z {
            return Ok(Vec::new());
        }
        let azimuth = render_scene.camera.azimuth_deg;
        Ok(vec![format!(
            "the camera at azimuth {azimuth}° is behind the plane of [background], which is seen from its +z side: choose an azimuth \
             from -90 to 90°"
        )])
    }

    /// Describes the computation of the image in words.
    pub fn describe(&self) -> String {
        match self.paths {
            0 => "one filtered lookup per lobe".to_owned(),
            paths => format!("{paths} paths per point through facets of both faces"),
        }
    }
}
