//! `biscale render` writes an image of the scene's object.

use anyhow::Result;
use serde::Serialize;

use super::render_path::RenderPath;
#[cfg(feature = "gpu")]
use super::render_path::on_gpu;
use super::render_zoom::MappedTile;
use super::watch::Watch;
use super::{RenderArgs, cache, check_outputs, print_json, render_zoom};
use crate::base::{GpuError, print_on_stderr};
use crate::diagnostics::Health;
use crate::effective::{ErrorEstimate, ErrorEstimator};
use crate::pipeline::{Outcome, Pipeline, SlabOutcome, StageTimes};
#[cfg(feature = "gpu")]
use crate::plan::Settings;
use crate::render::image::pixels::ImageFormat;
use crate::render::image::shading::ImageBackground;
use crate::render::image::tone_map::ToneMap;
use crate::render::seen_through::SlabScene;
use crate::render::{Image, RenderScene, Rendered};
use crate::scene::LoadedScene;

#[derive(Serialize)]
struct Report<'a> {
    #[serde(rename = "picture")]
    image: String,
    width: usize,
    height: usize,
    lights: usize,
    points: usize,
    /// Processor that shaded: `cpu`, or the name of the adapter.
    device: String,
    /// Representation of the effective BRDF that was read.
    reads: String,
    stages: serde_json::Map<String, serde_json::Value>,
    /// Stated error of the effective BRDF, without that of the representation that was read.
    error: Option<ErrorEstimate>,
    health: &'a Health,
}

pub fn run(args: &RenderArgs) -> Result<()> {
    if let Some(zoom) = &args.zoom {
        return render_zoom::run(args, zoom);
    }
    ImageFormat::of(&args.output)?;
    let cache = args.caching.open();
    let mut pipeline = crate::gpu::pipeline();
    pipeline.set_cache(cache.clone());
    let (loaded, render_scene) = args.scene.open(|loaded| {
        check_outputs(&args.scene.scene, loaded, &[], [&args.output])?;
        let render_scene = RenderScene::with(&pipeline, loaded)?;
        if loaded.scene.slab.is_some() {
            // A background that cannot be used is reported before the slab is computed.
            SlabScene::backdrop(&pipeline, loaded, &render_scene)?;
        }
        Ok(render_scene)
    })?;
    if loaded.scene.slab.is_some() {
        return of_slab(args, &mut pipeline, &loaded, &render_scene);
    }
    let watch = Watch::new(args.scene.quiet);
    pipeline.set_cancel(watch.cancel());
    let tone_map = ToneMap::new(&render_scene.camera)?;
    let outcome = pipeline.effective(&loaded)?;
    drop(watch);
    if !args.scene.quiet {
        for warning in render_scene.warnings() {
            print_on_stderr(format_args!("note: {warning}"));
        }
    }
    args.scene.notes(&outcome);
    let shaded = shade(&pipeline, &loaded, &render_scene, &outcome, &Shot::of(args))?;
    if let (Some(error), false) = (&shaded.refused, args.scene.quiet) {
        print_on_stderr(format_args!("note: shaded on the CPU: {error}"));
    }
    shaded.image.write(&args.output, &tone_map)?;
    cache::finish(&cache, args.scene.quiet);
    if args.scene.json {
        let error = outcome.errors().map(ErrorEstimator::estimate);
        return print_json(&report(args, &render_scene, &shaded, error, outcome.health()));
    }
    Ok(())
}

/// The size and the sampling of an image, and the handle that cancels it.
pub struct Shot {
    pub size: [usize; 2],
    pub samples_per_side: usize,
    pub watch: Watch,
}

impl Shot {
    fn of(args: &RenderArgs) -> Self {
        let samples_per_side = usize::from(args.samples);
        Self { size: args.size, samples_per_side, watch: Watch::new(args.scene.quiet) }
    }
}

/// An image, and how it was computed.
pub struct Shaded {
    pub image: Image,
    pub points: usize,
    /// Processor that shaded: `cpu`, or the name of the adapter.
    pub device: String,
    /// Representation of the effective BRDF that was read.
    pub reads: String,
    pub times: StageTimes,
    /// The reason why the GPU of the machine did not shade.
    pub refused: Option<GpuError>,
}

/// Renders the object of a scene with its effective BRDF.
///
/// # Errors
/// The camera cannot frame the object, a GPU that was asked for fails, or [`crate::Error::Cancelled`].
pub fn shade(
    pipeline: &Pipeline,
    loaded: &LoadedScene,
    render_scene: &RenderScene,
    outcome: &Outcome,
    shot: &Shot,
) -> Result<Shaded> {
    let cancel = shot.watch.cancel();
    let mut path = RenderPath::of(render_scene, outcome)?;
    let shading_brdf = path.shading_brdf(outcome, &cancel)?;
    let mut rendered = path.render(render_scene, &shading_brdf.brdf, shot.size, shot.samples_per_side)?;
    if let Some(tile) = MappedTile::of(pipeline, loaded)? {
        let start = std::time::Instant::now();
        let background = ImageBackground::default();
        let input = render_scene.input(&*shading_brdf.brdf, shot.size, shot.samples_per_side, &background);
        tile.shade_into(&mut rendered.image, &input, &cancel)?;
        rendered.times.shading_ms += start.elapsed().as_secs_f64() * 1e3;
    }
    cancel.check()?;
    let times = rendered.times;
    let large = [
        (if shading_brdf.was_cached { "cached_picture_table" } else { "picture_table" }, shading_brdf.ms),
        ("g_buffer", times.gbuffer_ms),
        ("shadows", times.shadows_ms),
        ("shading", times.shading_ms),
    ];
    Ok(Shaded {
        image: rendered.image,
        points: rendered.points,
        device: path.describe(),
        reads: shading_brdf.brdf.representation.describe(),
        times: outcome.times.iter().copied().chain(large).collect(),
        refused: match path {
            RenderPath::Cpu { refused } => refused,
            #[cfg(feature = "gpu")]
            RenderPath::Gpu(_) => None,
        },
    })
}

/// The report that `--json` prints.
fn report<'a>(
    args: &RenderArgs,
    render_scene: &RenderScene,
    shaded: &Shaded,
    error: Option<ErrorEstimate>,
    health: &'a Health,
) -> Report<'a> {
    Report {
        image: args.output.display().to_string(),
        width: args.size[0],
        height: args.size[1],
        lights: render_scene.lights().directional.len(),
        points: shaded.points,
        device: shaded.device.clone(),
        reads: shaded.reads.clone(),
        stages: shaded.times.iter().map(|(name, ms)| ((*name).to_owned(), (*ms).into())).collect(),
        error,
        health,
    }
}

/// Renders the object of a scene with a slab.
///
/// # Errors
/// The camera cannot frame the object, the background cannot be used, or [`crate::Error::Cancelled`].
pub fn shade_slab(
    pipeline: &Pipeline,
    loaded: &LoadedScene,
    render_scene: &RenderScene,
    outcome: &mut SlabOutcome,
    shot: &Shot,
) -> Result<Shaded> {
    let scene = SlabScene::with(pipeline, loaded, outcome, render_scene)?;
    outcome.health.warnings.extend(scene.warnings(render_scene)?);
    let (rendered, device) = draw_slab(shot, loaded, &scene, render_scene)?;
    let times = rendered.times;
    let large = [("g_buffer", times.gbuffer_ms), ("shading", times.shading_ms)];
    Ok(Shaded {
        image: rendered.image,
        points: rendered.points,
        device,
        reads: scene.describe(),
        times: outcome.times.iter().chain(&scene.times).copied().chain(large).collect(),
        refused: None,
    })
}

/// Writes the image of a scene with a slab.
fn of_slab(args: &RenderArgs, pipeline: &mut Pipeline, loaded: &LoadedScene, render_scene: &RenderScene) -> Result<()> {
    let tone_map = ToneMap::new(&render_scene.camera)?;
    let shot = Shot::of(args);
    pipeline.set_cancel(shot.watch.cancel());
    let mut outcome = pipeline.slab(loaded)?;
    let shaded = shade_slab(pipeline, loaded, render_scene, &mut outcome, &shot)?;
    drop(shot);
    args.scene.warn(&outcome.health);
    shaded.image.write(&args.output, &tone_map)?;
    if args.scene.json {
        return print_json(&report(args, render_scene, &shaded, None, &outcome.health));
    }
    Ok(())
}

/// Draws what is seen through a slab, and names the processor that did.
fn draw_slab(
    shot: &Shot,
    loaded: &LoadedScene,
    scene: &SlabScene,
    render_scene: &RenderScene,
) -> Result<(Rendered, String)> {
    #[cfg(feature = "gpu")]
    {
        let backend = Settings::from_quality(&loaded.scene.quality).backend;
        if let Some(drawn) = on_gpu::seen_through(backend, scene, render_scene, (shot.size, shot.samples_per_side))? {
            return Ok(drawn);
        }
    }
    #[cfg(not(feature = "gpu"))]
    let _ = loaded;
    let cancel = shot.watch.cancel();
    Ok((scene.render(render_scene, shot.size, shot.samples_per_side, &cancel)?, "cpu".to_owned()))
}
