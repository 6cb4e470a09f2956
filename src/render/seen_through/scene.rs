//! A scene with a slab, ready to be rendered.

use std::sync::Arc;

use glam::Vec2;

use super::{Backdrop, BuildBackdrop, BuildView, Places, SeenThrough, render};
use crate::base::{Cancel, Result};
use crate::effective::{VaryingSurface, ViewLobes};
use crate::pipeline::{Pipeline, SlabOutcome, StageTimes};
use crate::render::lighting::environment::Environment;
use crate::render::lighting::lights;
use crate::render::stages::LoadEnvironment;
use crate::render::{CameraView, DirectionalLight, RenderScene, Rendered};
use crate::scene::LoadedScene;
use crate::slab::{BtdfView, Slab, SlabView};

/// A slab and what lies behind it. Images from several cameras share it.
#[derive(Debug, Clone)]
pub struct SlabScene {
    slab: Arc<Slab>,
    view: Arc<SlabView>,
    backdrop: Arc<Backdrop>,
    /// The directional lights of the scene; the environment is part of the backdrop.
    lights: Vec<DirectionalLight>,
    /// How often a captured sheet repeats along x and y.
    repeat: Vec2,
    /// Paths per point; 0 for drafts.
    pub paths: usize,
    /// Seed of the paths.
    pub seed: u64,
    /// The stages that ran to prepare the view and what lies behind.
    pub times: StageTimes,
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
        let mut times = StageTimes::new();
        Ok(Self {
            slab: outcome.slab.clone(),
            view: pipeline.get(BuildView { outcome }, &mut times)?.value,
            backdrop: Self::backdrop_with(pipeline, loaded, render_scene, &mut times)?,
            times,
            lights,
            repeat: Vec2::from_array(loaded.scene.slab.as_ref().map_or([1, 1], |slab| slab.repeat).map(|n| n as f32)),
            paths: outcome.settings.paths,
            seed: outcome.settings.seed,
        })
    }

    /// The backdrop behind the object of a scene.
    ///
    /// # Errors
    /// An environment or a background that cannot be used.
    pub fn backdrop(pipeline: &Pipeline, loaded: &LoadedScene, render_scene: &RenderScene) -> Result<Arc<Backdrop>> {
        Self::backdrop_with(pipeline, loaded, render_scene, &mut StageTimes::new())
    }

    fn backdrop_with(
        pipeline: &Pipeline,
        loaded: &LoadedScene,
        render_scene: &RenderScene,
        times: &mut StageTimes,
    ) -> Result<Arc<Backdrop>> {
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
        render(&self.input(&*self.view, render_scene, size, samples_per_side, cancel))
    }

    /// Renders the object with the transmitted light of the slab's BTDF, in place of paths through both faces.
    ///
    /// # Errors
    /// As [`render`].
    pub fn render_btdf(&self, render_scene: &RenderScene, size: [usize; 2], cancel: &Cancel) -> Result<Rendered> {
        let view = BtdfView::new(self.slab.clone(), self.view.clone());
        render(&self.input(&view, render_scene, size, 1, cancel))
    }

    fn input<'a, S: VaryingSurface>(
        &'a self,
        surface: &'a S,
        render_scene: &'a RenderScene,
        size: [usize; 2],
        samples_per_side: usize,
        cancel: &Cancel,
    ) -> SeenThrough<'a, S> {
        SeenThrough {
            mesh: render_scene.mesh(),
            camera: &render_scene.camera,
            backdrop: &self.backdrop,
            surface,
            places: self.places(render_scene),
            reflectance: &*self.slab,
            transmittance: &*self.slab,
            lights: &self.lights,
            size,
            samples_per_side,
            paths: self.paths,
            seed: self.seed,
            cancel: cancel.clone(),
        }
    }

    /// A captured sheet lies over the x and y of the object.
    fn places(&self, render_scene: &RenderScene) -> Places {
        let positions = || render_scene.mesh().positions.iter().map(|position| position.truncate());
        let origin = positions().reduce(Vec2::min).unwrap_or(Vec2::ZERO);
        let extent = positions().reduce(Vec2::max).unwrap_or(Vec2::ONE) - origin;
        Places { origin, scale: self.repeat / extent.max(Vec2::splat(f32::MIN_POSITIVE)) }
    }

    /// The backdrop of the object, and its surroundings.
    pub fn behind(&self) -> &Backdrop {
        &self.backdrop
    }

    /// The table of lobes from which drafts are made; `None` if an image needs more than the table.
    pub fn draft_lobes(&self) -> Option<&[ViewLobes]> {
        if self.paths == 0 && self.lights.is_empty() { self.view.lobe_nodes() } else { None }
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
            0 => "two filtered lookups per lobe".to_owned(),
            paths => format!("{paths} paths per point through facets of both faces"),
        }
    }
}
