//! Rendering of preview images. The renderer caches the object, lights, shadows and GPU state, and recomputes each only
//! when its input changes.

use std::sync::Arc;
use std::time::Instant;

use crate::base::{Cancel, Error, Result};
use crate::brdf::MaterialAssignment;
use crate::cache::Key;
use crate::effective::{Black, EffectiveBrdf, Reflectance};
use crate::interreflection::InterreflectionTable;
use crate::pipeline::{GpuTile, Outcome, Pipeline, ShadingBrdf};
use crate::render::image::render::{RenderTimes, VisiblePoints};
use crate::render::image::shading::ImageBackground;
use crate::render::image::tone_map::ToneMap;
use crate::render::tile_view::filtered::Corrections;
use crate::render::tile_view::{ShadedMaterials, TileScene, on_object};
use crate::render::{CameraView, RenderInput, RenderScene, Rendered};
use crate::scene::{Camera, LoadedScene};
use glam::Vec3;

use super::gpu_state::{GpuState, PreviewInput};
use super::screen::{GpuImage, ImagePool, Screen};

/// The object, lights and shadows of a scene, ready to be shaded.
#[derive(Default)]
pub struct PreviewRenderer {
    scene: Option<RenderScene>,
    gpu: GpuState,
    screen: Option<Screen>,
    images: ImagePool,
    /// Points of the last images on the CPU, which the next image has unless the view changed. The newest is the last.
    visible: Vec<(ViewKey, VisiblePoints)>,
}

/// Number of images whose points are kept: one before the final image, and the final one.
const KEPT_POINTS: usize = 2;

/// Inputs of the visible points of an image.
#[derive(Debug, Clone, PartialEq)]
struct ViewKey {
    scene: [Key; 2],
    camera: Camera,
    size: [usize; 2],
    samples_per_side: usize,
    has_shadow_cache: bool,
}

/// Points of an image that are kept from the last ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KnownPoints {
    /// One of the last images had the same points.
    All,
    /// One of the last images showed the same view with other pixels or samples.
    OtherSampling,
    None,
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
    /// The interreflection of a similar material, for a draft that was computed without.
    pub bounced: Option<&'a Arc<InterreflectionTable>>,
    pub size: [usize; 2],
    pub samples_per_side: usize,
    /// Allows building a shadow cache, which takes longer than a draft and pays off when the camera moves.
    pub build_caches: bool,
    /// `auto`, `gpu` or `cpu`.
    pub backend: &'a str,
}

impl PreviewRenderer {
    /// Prepares the object and the lights of a scene. The pipeline recomputes only what the scene changed.
    pub fn prepare(&mut self, pipeline: &Pipeline, loaded: &LoadedScene) -> Result<()> {
        let mut scene = RenderScene::with(pipeline, loaded)?;
        if let Some(last) = &self.scene {
            scene.reuse_shadows(last);
            if last.object_key() != scene.object_key() {
                self.gpu.forget_object();
            }
        }
        self.scene = Some(scene);
        Ok(())
    }

    /// Warnings about the object and the lights.
    pub fn warnings(&self) -> Vec<String> {
        self.scene.iter().flat_map(RenderScene::warnings).cloned().collect()
    }

    /// The prepared object and lights, for picking.
    pub fn scene(&self) -> Option<&RenderScene> {
        self.scene.as_ref()
    }

    /// Distance from the camera to the object in the object's radii, with automatic framing resolved.
    pub fn distance(&self, camera: &Camera, size: [usize; 2]) -> f32 {
        let of = |scene: &RenderScene| {
            let view = CameraView::new(camera, scene.mesh(), size).ok()?;
            let bounds = &scene.mesh().bounds;
            Some((view.eye - bounds.center).dot(view.back) / bounds.radius)
        };
        self.scene.as_ref().and_then(of).unwrap_or(4.0)
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
    /// Returns an error if the camera is invalid, or [`Error::Cancelled`].
    pub fn render_to_screen(
        &mut self,
        request: &RenderRequest,
        tone_map: &ToneMap,
        cancel: &Cancel,
    ) -> Result<Option<GpuPreview>> {
        let (Some(scene), Some(screen)) = (&self.scene, &self.screen) else { return Ok(None) };
        let preview_input = PreviewInput { scene, request, screen: Some(screen) };
        let background = ImageBackground::default();
        let input = render_input(scene, request, &Black, &background);
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
    /// Returns an error if the camera is invalid, or [`Error::Cancelled`].
    pub fn render(
        &mut self,
        pipeline: &Pipeline,
        request: &RenderRequest,
        close: Option<&CloseUpTile>,
        cancel: &Cancel,
    ) -> Result<(Rendered, f64)> {
        let (Some(scene), ShadedMaterial::Outcome(outcome)) = (&mut self.scene, request.material) else {
            return Err(Error::failed("nothing was prepared"));
        };
        let background = ImageBackground::default();
        let preview_input = PreviewInput { scene, request, screen: self.screen.as_ref() };
        let exact = Cancellable { brdf: &outcome.brdf, cancel };
        let input = RenderInput { shadow_cache: None, ..render_input(scene, request, &exact, &background) };
        let on_gpu = self.gpu.run(preview_input, cancel, |renderer, gpu| renderer.render(gpu, &input, cancel))?;
        let (mut rendered, table_ms) = match on_gpu {
            Some(rendered) => rendered,
            None => {
                if request.build_caches && scene.shadow_cache().is_none() {
                    scene.cache_shadows(pipeline)?;
                }
                let ShadingBrdf { brdf, ms, .. } = outcome.shading_brdf(cancel)?;
                let brdf = with_bounced(brdf, request);
                let reflectance = Cancellable { brdf: &brdf, cancel };
                let input = render_input(scene, request, &reflectance, &background);
                let key = view_key(scene, request.camera, request.size, request.samples_per_side);
                let known = self.visible.iter().position(|(known, _)| *known == key);
                let (visible, times) = match known {
                    Some(at) => (self.visible.remove(at).1, RenderTimes::default()),
                    None => VisiblePoints::new(&input)?,
                };
                let rendered = visible.shade(&input)?;
                if self.visible.len() == KEPT_POINTS {
                    self.visible.remove(0);
                }
                self.visible.push((key, visible));
                let times = RenderTimes { shading_ms: rendered.times.shading_ms, ..times };
                (Rendered { times, ..rendered }, ms)
            }
        };
        cancel.check()?;
        if let Some((tile, assignment)) = close {
            let start = Instant::now();
            let materials =
                ShadedMaterials { material_of_slot: &assignment.material_of_slot, materials: &assignment.materials };
            // Only pixels under a colour map read `f̄`: from the representation that images read.
            let brdf = match tile.filtered() {
                Some(_) => outcome.shading_brdf(cancel)?.brdf,
                None => outcome.brdf.clone(),
            };
            let brdf = with_bounced(brdf, request);
            let reflectance = Cancellable { brdf: &brdf, cancel };
            let input = render_input(scene, request, &reflectance, &background);
            let corrections = if request.build_caches { Corrections::Measured } else { Corrections::Known };
            tile.blend_into(&mut rendered.image, &input, materials, corrections, cancel)?;
            rendered.times.shading_ms += start.elapsed().as_secs_f64() * 1e3;
        }
        Ok((rendered, table_ms))
    }

    /// Compares the points of an image on the CPU with those that are kept.
    pub fn known_points(&self, camera: &Camera, size: [usize; 2], samples_per_side: usize) -> KnownPoints {
        let Some(scene) = &self.scene else { return KnownPoints::None };
        let key = view_key(scene, camera, size, samples_per_side);
        let mut is_same_view = false;
        for (known, _) in &self.visible {
            if *known == key {
                return KnownPoints::All;
            }
            let (size, samples_per_side) = (known.size, known.samples_per_side);
            is_same_view |= ViewKey { size, samples_per_side, ..key.clone() } == *known;
        }
        if is_same_view { KnownPoints::OtherSampling } else { KnownPoints::None }
    }

    /// Returns true if the camera is so close that the tiles themselves are visible.
    pub fn is_close(&self, camera: &Camera, size: [usize; 2], has_color_map: bool) -> bool {
        let of = |scene: &RenderScene| {
            CameraView::new(camera, scene.mesh(), size)
                .is_ok_and(|view| on_object::tiles_are_visible(&view, scene.mesh(), has_color_map))
        };
        self.scene.as_ref().is_some_and(of)
    }

    /// Returns true if images are rendered on a hardware GPU: one that is open, or the window's, which the next image
    /// opens.
    pub fn is_hardware(&self) -> bool {
        let opens_screen = matches!(self.gpu, GpuState::Unopened);
        self.gpu.is_hardware() || opens_screen && self.screen.as_ref().is_some_and(|screen| screen.is_hardware)
    }

    /// Returns true if no hardware GPU renders images: none is open, and the next image opens none.
    pub fn has_no_hardware(&self) -> bool {
        !self.gpu.is_hardware() && !matches!(self.gpu, GpuState::Unopened)
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

fn view_key(scene: &RenderScene, camera: &Camera, size: [usize; 2], samples_per_side: usize) -> ViewKey {
    let has_shadow_cache = scene.shadow_cache().is_some();
    ViewKey { scene: scene.keys(), camera: camera.clone(), size, samples_per_side, has_shadow_cache }
}

/// A BRDF with the interreflection that a draft adds.
fn with_bounced(brdf: Arc<EffectiveBrdf>, request: &RenderRequest) -> Arc<EffectiveBrdf> {
    match request.bounced {
        Some(bounced) => Arc::new(brdf.as_ref().clone().interreflecting(bounced.clone())),
        None => brdf,
    }
}

/// Collects the inputs of an image.
fn render_input<'a>(
    scene: &'a RenderScene,
    request: &'a RenderRequest,
    reflectance: &'a dyn Reflectance,
    background: &'a ImageBackground,
) -> RenderInput<'a> {
    let input = scene.input(reflectance, request.size, request.samples_per_side, background);
    let tolerance = match request.material {
        ShadedMaterial::Outcome(outcome) => outcome.settings.point_tolerance(),
        ShadedMaterial::GpuTile(_) => 0.0,
    };
    RenderInput { camera: request.camera, tolerance, ..input }
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

    fn eval_direct(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) -> bool {
        !self.cancel.is_set() && self.brdf.eval_direct(lights, o, out)
    }

    fn eval_bounced(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        if !self.cancel.is_set() {
            self.brdf.eval_bounced(lights, o, out);
        }
    }
}
