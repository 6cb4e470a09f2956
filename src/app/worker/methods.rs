//! Images of one scene by several methods beside each other, each a mean over passes: a colour map by the colour of the
//! mean, by rays and filtered; a slab by Eq. 11, by its sum over facets and by paths.

use std::sync::Arc;

use crate::base::{Cancel, Error, InputError, Result};
use crate::color_map::naive::NaiveMap;
use crate::effective::EffectiveBrdf;
use crate::geometry::ColorField;
use crate::pipeline::Pipeline;
use crate::render::image::shading::ImageBackground;
use crate::render::image::tone_map::ToneMap;
use crate::render::seen_through::SlabScene;
use crate::render::tile_view::filtered::Corrections;
use crate::render::tile_view::{ShadedMaterials, TileScene};
use crate::render::{Image, RenderScene, render};
use crate::scene::{
    ColorLayer, ColorMap, Driver, GradientStop, HeightDriver, LayerWeight, LoadedScene, SlabMethod, StopUnit,
};
use eframe::egui::ColorImage;
use glam::Vec3;

use super::image_worker::camera;
use super::pixel_costs::fitting;
use super::runner::JobContext;
use super::tone::color_image;

/// Largest number of pixels of an image, so that a pass of the truth takes about a second.
const MAX_PIXELS: f64 = 320.0 * 240.0;
/// Most passes of a method, and the relative standard error at which it has enough.
const PASSES: usize = 64;
const NOISE: f32 = 0.01;
/// Paths per point and pass of a slab: by BTDFs, and by paths through both faces.
const BTDF_PATHS: usize = 16;
const TRUE_PATHS: usize = 128;
/// Rays per point and pass of the truth of a colour map.
const RAYS: usize = 8;

/// A scene whose methods are compared.
#[derive(Debug, Clone)]
pub struct MethodsJob {
    /// Version of the document, returned with every result.
    pub version: u64,
    pub loaded: Arc<LoadedScene>,
    /// Size of the view in pixels.
    pub size: [usize; 2],
}

/// The image of one method.
#[derive(Debug, Clone)]
pub struct MethodImage {
    pub name: &'static str,
    pub image: Arc<ColorImage>,
    pub passes: usize,
    /// Relative L2 of the standard errors; `None` for a method without noise, and with a single pass.
    pub noise: Option<f32>,
    /// Relative L2 of the difference from the truth, without the noise of both; `None` for the truth.
    pub difference: Option<f32>,
}

/// A report of the worker.
#[derive(Debug, Clone)]
pub enum MethodsResult {
    Images(u64, Vec<MethodImage>),
    Failed(u64, String),
}

/// The worker's state: pipelines of the scene, and of the scene under a white map or by another method.
pub struct MethodsWorker {
    pipelines: [Pipeline; 2],
}

impl Default for MethodsWorker {
    fn default() -> Self {
        Self { pipelines: [Pipeline::new(), Pipeline::new()] }
    }
}

impl MethodsWorker {
    pub fn work(&mut self, job: &MethodsJob, context: &JobContext<MethodsJob>, report: &dyn Fn(MethodsResult)) {
        self.pipelines.iter_mut().for_each(|pipeline| pipeline.set_cancel(context.cancel.clone()));
        match self.compare(job, context.cancel, report) {
            Ok(()) | Err(Error::Cancelled) => {}
            Err(error) => report(MethodsResult::Failed(job.version, error.to_string())),
        }
    }

    fn compare(&self, job: &MethodsJob, cancel: &Cancel, report: &dyn Fn(MethodsResult)) -> Result<()> {
        let size = fitting(job.size, MAX_PIXELS);
        let methods: [Box<dyn Method + '_>; 3] = if job.loaded.scene.slab.is_some() {
            slab_methods(&self.pipelines, &job.loaded, size)?
        } else {
            // The colour of what is seen and lit does not hold for light that facets send to each other.
            map_methods(&self.pipelines, &job.loaded.without_interreflection(), size, cancel)?
        };
        let mut means = methods.each_ref().map(|_| MeanImage::default());
        let tone_map = ToneMap::new(&camera(&job.loaded))?;
        for pass in 0..PASSES {
            let mut added = false;
            for (method, mean) in methods.iter().zip(&mut means) {
                if pass > 0 && (!method.is_noisy() || mean.noise() < NOISE) {
                    continue;
                }
                mean.add(method.pass(pass as u64, cancel)?);
                added = true;
            }
            if !added {
                break;
            }
            report(MethodsResult::Images(job.version, shown(&methods, &means, &tone_map)));
        }
        Ok(())
    }
}

/// A way to render a scene.
trait Method {
    fn name(&self) -> &'static str;

    /// Returns true if passes differ, so that their mean is needed.
    fn is_noisy(&self) -> bool;

    fn pass(&self, seed: u64, cancel: &Cancel) -> Result<Image>;
}

/// The name of the method with which the others are compared.
const REFERENCE: &str = "reference";

/// The images of all methods.
fn shown(methods: &[Box<dyn Method + '_>; 3], means: &[MeanImage; 3], tone_map: &ToneMap) -> Vec<MethodImage> {
    let truth = methods.iter().position(|method| method.name() == REFERENCE).map(|at| &means[at]);
    let of = |method: &dyn Method, mean: &MeanImage| MethodImage {
        name: method.name(),
        image: Arc::new(color_image(&mean.mean, tone_map)),
        passes: mean.passes,
        noise: (method.is_noisy() && mean.passes > 1).then(|| mean.noise()),
        difference: truth.filter(|_| method.name() != REFERENCE).map(|truth| mean.difference(truth)),
    };
    methods.iter().zip(means).map(|(method, mean)| of(method.as_ref(), mean)).collect()
}

/// The mean of passes, with the variance of each pixel.
#[derive(Default)]
struct MeanImage {
    mean: Image,
    /// Sums of squared differences from the mean.
    squares: Vec<Vec3>,
    passes: usize,
}

impl MeanImage {
    fn add(&mut self, image: Image) {
        self.passes += 1;
        if self.passes == 1 {
            self.squares = vec![Vec3::ZERO; image.pixels.len()];
            self.mean = image;
            return;
        }
        let part = 1.0 / self.passes as f32;
        for ((mean, square), value) in self.mean.pixels.iter_mut().zip(&mut self.squares).zip(image.pixels) {
            let before = value - *mean;
            *mean += before * part;
            *square += before * (value - *mean);
        }
    }

    fn norm(&self) -> f64 {
        self.mean.pixels.iter().map(|pixel| f64::from(pixel.length_squared())).sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// Sum of the variances of the mean; 0 with a single pass.
    fn variance(&self) -> f64 {
        let sum: f64 = self.squares.iter().map(|square| f64::from(square.element_sum())).sum();
        sum / (self.passes.max(1) * self.passes.saturating_sub(1).max(1)) as f64
    }

    /// Relative L2 of the standard errors; infinite with a single pass.
    fn noise(&self) -> f32 {
        if self.passes < 2 { f32::INFINITY } else { (self.variance() / self.norm()).sqrt() as f32 }
    }

    /// Relative L2 of the difference from a truth, without the noise of both.
    fn difference(&self, truth: &Self) -> f32 {
        let pairs = self.mean.pixels.iter().zip(&truth.mean.pixels);
        let square: f64 = pairs.map(|(a, b)| f64::from((*a - *b).length_squared())).sum();
        ((square - self.variance() - truth.variance()).max(0.0) / truth.norm()).sqrt() as f32
    }
}

/// A tile with everything that an image of an object under it reads.
struct MappedObject {
    scene: RenderScene,
    brdf: Arc<EffectiveBrdf>,
    tile: TileScene,
    material_of_slot: Vec<usize>,
    materials: Vec<crate::brdf::Material>,
    size: [usize; 2],
    /// The image that has `f̄` everywhere.
    far: Image,
}

impl MappedObject {
    fn new(pipeline: &Pipeline, loaded: &LoadedScene, size: [usize; 2], cancel: &Cancel) -> Result<Self> {
        let outcome = pipeline.effective(loaded)?;
        let scene = RenderScene::with(pipeline, loaded)?;
        let brdf = outcome.shading_brdf(cancel)?.brdf;
        let assignment = pipeline.materials(loaded)?;
        let background = ImageBackground::default();
        let far = render(&scene.input(&*brdf, size, 1, &background))?.image;
        let tile = TileScene::new(Arc::new(pipeline.mesh(loaded)?));
        cancel.check()?;
        let (material_of_slot, materials) = (assignment.material_of_slot, assignment.materials);
        Ok(Self { scene, brdf, tile, material_of_slot, materials, size, far })
    }

    fn materials(&self) -> ShadedMaterials<'_> {
        ShadedMaterials { material_of_slot: &self.material_of_slot, materials: &self.materials }
    }
}

/// A colour map: filtered, by rays, or by the colour of the mean.
enum MapMethod {
    Naive(Arc<MappedObject>, NaiveMap),
    Truth(Arc<MappedObject>),
    Filtered(Arc<MappedObject>),
}

impl Method for MapMethod {
    fn name(&self) -> &'static str {
        match self {
            Self::Naive(..) => "naive",
            Self::Truth(_) => REFERENCE,
            Self::Filtered(_) => "filtered",
        }
    }

    fn is_noisy(&self) -> bool {
        matches!(self, Self::Truth(_))
    }

    fn pass(&self, seed: u64, cancel: &Cancel) -> Result<Image> {
        let (Self::Naive(object, _) | Self::Truth(object) | Self::Filtered(object)) = self;
        let background = ImageBackground::default();
        let input = object.scene.input(&*object.brdf, object.size, 1, &background);
        let (mut image, materials) = (object.far.clone(), object.materials());
        match (self, object.tile.filtered()) {
            (Self::Truth(_), _) => object.tile.cast_into(&mut image, &input, materials, (RAYS, seed), cancel)?,
            (Self::Naive(_, map), Some(tile)) => {
                tile.shade_naive_into(&mut image, &input, materials, map, cancel)?;
            }
            (Self::Filtered(_), Some(tile)) => {
                tile.shade_into(&mut image, &input, materials, Corrections::Measured, cancel)?;
            }
            (_, None) => {}
        }
        Ok(image)
    }
}

fn map_methods(
    [pipeline, other]: &[Pipeline; 2],
    loaded: &LoadedScene,
    size: [usize; 2],
    cancel: &Cancel,
) -> Result<[Box<dyn Method>; 3]> {
    let object = Arc::new(MappedObject::new(pipeline, loaded, size, cancel)?);
    let map = match &object.tile.mesh.color {
        ColorField::Mapped { map, .. } if !map.is_analytic => NaiveMap::new(map),
        _ => {
            let expected = "a colour map of the tile's own surface, which rays can meet";
            return Err(InputError::new("color_map", "a map whose pixels cannot be filtered", expected).into());
        }
    };
    let white = Arc::new(MappedObject::new(other, &white(loaded), size, cancel)?);
    Ok([
        Box::new(MapMethod::Naive(white, map)),
        Box::new(MapMethod::Truth(object.clone())),
        Box::new(MapMethod::Filtered(object)),
    ])
}

/// The scene with a colour map that is white everywhere.
fn white(loaded: &LoadedScene) -> LoadedScene {
    let layer = ColorLayer {
        name: String::new(),
        driver: Driver::Height(HeightDriver::default()),
        unit: StopUnit::Deviation,
        stops: vec![GradientStop { value: 0.0, color: Vec3::ONE }],
        weight: LayerWeight::Number(1.0),
    };
    let mut white = loaded.clone();
    white.scene.color_map = Some(ColorMap { layer: vec![layer], ..ColorMap::default() });
    white
}

/// A slab: by the BTDF of a model, or by paths through both faces.
struct SlabMethodImage {
    name: &'static str,
    scene: SlabScene,
    render_scene: RenderScene,
    size: [usize; 2],
}

impl Method for SlabMethodImage {
    fn name(&self) -> &'static str {
        self.name
    }

    fn is_noisy(&self) -> bool {
        true
    }

    fn pass(&self, seed: u64, cancel: &Cancel) -> Result<Image> {
        let is_truth = self.name == REFERENCE;
        let mut scene = self.scene.clone();
        scene.seed = scene.seed.wrapping_add(seed);
        scene.paths = if is_truth { TRUE_PATHS } else { BTDF_PATHS };
        let rendered = if is_truth {
            scene.render(&self.render_scene, self.size, 1, cancel)
        } else {
            scene.render_btdf(&self.render_scene, self.size, cancel)
        };
        Ok(rendered?.image)
    }
}

fn slab_methods(
    [pipeline, other]: &[Pipeline; 2],
    loaded: &LoadedScene,
    size: [usize; 2],
) -> Result<[Box<dyn Method>; 3]> {
    if loaded.scene.slab.as_ref().is_some_and(|slab| slab.svbtdf.is_some()) {
        let expected = "a slab of two faces: a captured sheet has one method";
        return Err(InputError::new("slab.svbtdf", "a captured sheet", expected).into());
    }
    let by = |pipeline: &Pipeline, name: &'static str, method: SlabMethod| -> Result<Box<dyn Method>> {
        let mut loaded = loaded.clone();
        if let Some(slab) = &mut loaded.scene.slab {
            slab.method = method;
        }
        let outcome = pipeline.slab(&loaded)?;
        let render_scene = RenderScene::with(pipeline, &loaded)?;
        let scene = SlabScene::with(pipeline, &loaded, &outcome, &render_scene)?;
        Ok(Box::new(SlabMethodImage { name, scene, render_scene, size }))
    };
    Ok([
        by(pipeline, "Eq. 11", SlabMethod::Dual)?,
        by(other, "faces", SlabMethod::Faces)?,
        by(pipeline, REFERENCE, SlabMethod::Dual)?,
    ])
}

#[cfg(test)]
#[path = "methods_tests.rs"]
mod tests;
